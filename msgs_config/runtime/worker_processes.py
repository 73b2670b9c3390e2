"""Processes that work for this one: begun from nothing, deaf to Ctrl-C, and ended with it."""

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import ParamSpec, TypeVar

_PATIENCE = 20.0  # s that a process has which puts things away when it is to end

P = ParamSpec("P")
T = TypeVar("T")
Item = TypeVar("Item")


class WorkerProcesses:
    """A pool for a `with` block, which ends its processes: after an error without their work.

    Where one of them dies, what is asked of the pool is an error,
    `concurrent.futures.process.BrokenProcessPool`.
    """

    def __init__(
        self, count: int, begin: Callable[P, object], *given: P.args, **named: P.kwargs
    ) -> None:
        """Each of `count` processes calls `begin`, with what is given, before its first task."""
        spawn = multiprocessing.get_context("spawn")  # no engine survives a fork
        self._pool = ProcessPoolExecutor(count, spawn, _begin, (begin, given, named))

    def __enter__(self) -> "WorkerProcesses":
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if kind not in (None, GeneratorExit):  # nobody waits for what they are at
            for process in multiprocessing.active_children():
                process.terminate()
            self._end_results()
        self.close()

    def close(self) -> None:
        """End the processes, each after the task that it is at."""
        self._pool.shutdown(cancel_futures=True)

    def _end_results(self) -> None:
        """Have whoever reads results find their end, where a process was ended amid writing one.

        This process has the pipe's other end as well, to hand it to more processes; while it is
        open, the pool would wait for the rest for ever (seen in Python 3.11).
        """
        results = getattr(self._pool, "_result_queue", None)
        if results is not None:
            results._writer.close()

    def submit(self, task: Callable[P, T], *given: P.args, **named: P.kwargs) -> Future[T]:
        """Begin a task, and more processes if there are too few."""
        with interrupts_blocked():  # here while processes start, and in them for good
            return self._pool.submit(task, *given, **named)

    def map(self, task: Callable[[Item], T], items: Iterable[Item]) -> Iterator[T]:
        """Begin a task for each item; their results in order, as they are asked for.

        The pool's own `map` cancels what an interrupt leaves; a pool whose processes are ended
        then fails over what is cancelled, and waits for ever at the exit (seen in Python 3.11).
        """
        with interrupts_blocked():
            begun = [self._pool.submit(task, item) for item in items]
        return (future.result() for future in begun)


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Ctrl-C waits; a process that is begun meanwhile leaves it to the one that began it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    # Python's own tracker of what processes share lets Ctrl-C through again when it begins.
    resource_tracker.ensure_running()
    came: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        signal.signal(signal.SIGINT, handler)
        if came:  # it reached a thread that had not blocked it
            signal.raise_signal(signal.SIGINT)


def _begin(
    begin: Callable[..., object], given: tuple[object, ...], named: dict[str, object]
) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    begin(*given, **named)


def _end_with_parent() -> None:
    """End when the parent is killed, which ends nothing by itself."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)  # ends it at once, unless it has something to put away
        time.sleep(_PATIENCE)
        os._exit(1)
