"""Tasks that threads share."""

import threading

import pytest

from msgs_config.runtime.worker_threads import WorkerThreads


@pytest.mark.parametrize("workers", [1, 2, 5])
@pytest.mark.parametrize("tasks", [0, 1, 3, 50])
def test_each_task_is_done_once_by_a_worker_that_no_other_thread_is(
    workers: int, tasks: int
) -> None:
    threads, done, lock = (
        WorkerThreads(list(range(workers))),
        list[tuple[int, int]](),
        threading.Lock(),
    )
    whose: dict[int, int] = {}

    def work(own: int, task: int) -> None:
        with lock:
            done.append((task, own))
            assert whose.setdefault(own, threading.get_ident()) == threading.get_ident()

    threads.share(tasks, work)
    threads.close()

    assert sorted(task for task, _ in done) == list(range(tasks))


def test_an_error_is_the_callers() -> None:
    threads = WorkerThreads([0, 1])

    def fail(own: int, task: int) -> None:
        raise ValueError(str(task))

    with pytest.raises(ValueError, match=r"^[01]$"):
        threads.share(2, fail)
    threads.close()
