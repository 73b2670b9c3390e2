"""Tasks that threads share."""

import os
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


def test_after_an_interruption_nobody_works_any_more() -> None:
    threads, free = WorkerThreads([0, 1]), threading.Event()
    begun, ended = list[int](), list[int]()

    def work(own: int, task: int) -> None:
        begun.append(task)
        if own == 0:
            while len(begun) < 2:  # until the other one works, too
                free.wait(0.001)
            threading.Timer(0.05, free.set).start()
            raise KeyboardInterrupt
        assert free.wait(30.0)
        ended.append(task)

    with pytest.raises(KeyboardInterrupt):
        threads.share(100, work)

    assert len(begun) == 2
    assert len(ended) == 1
    threads.close()


def test_callers_take_turns() -> None:
    threads, working, most = WorkerThreads([0, 1]), [0, 0], list[int]()

    def work(own: int, task: int) -> None:
        working[own] += 1
        most.append(working[own])
        threading.Event().wait(0.001)
        working[own] -= 1

    callers = [threading.Thread(target=threads.share, args=(20, work)) for _ in range(3)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    threads.close()

    assert len(most) == 60
    assert set(most) == {1}


def test_the_child_of_a_fork_has_threads_of_its_own() -> None:
    threads = WorkerThreads([0, 1])
    threads.share(8, lambda own, task: None)

    child = os.fork()
    if child == 0:
        done = list[int]()
        threads.share(8, lambda own, task: done.append(task))
        os._exit(sorted(done) != list(range(8)))
    _, status = os.waitpid(child, 0)

    assert os.waitstatus_to_exitcode(status) == 0
    threads.close()
