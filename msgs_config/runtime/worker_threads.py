"""Threads that share tasks which hold no lock of Python's."""

import itertools
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Generic, TypeVar

Own = TypeVar("Own")


class WorkerThreads(Generic[Own]):
    """Workers with something of their own each; the thread that asks is the first one."""

    def __init__(self, owned: Sequence[Own]) -> None:
        """One worker for each entry, such as an engine that no other thread may use."""
        self._owned = owned
        self._begin()

    def _begin(self) -> None:
        self._process = os.getpid()
        self._sharing = threading.Lock()
        self._threads = ThreadPoolExecutor(max(len(self._owned) - 1, 1))
        self._working: list[Future[None]] = []

    def share(self, tasks: int, work: Callable[[Own, int], object]) -> None:
        """Do tasks 0 to `tasks - 1`, each once: whoever is free takes the next one.

        One caller after the other. After an error, or an interruption, no more tasks are begun, and
        it is the caller's when those under way have ended.
        """
        if self._process != os.getpid():  # a fork's child has none of the threads
            self._begin()
        with self._sharing:
            wait(self._working)  # of a caller that was interrupted twice
            numbers, is_over = itertools.count(), threading.Event()

            def go_on(own: Own) -> None:
                while not is_over.is_set() and (number := next(numbers)) < tasks:
                    work(own, number)

            first, *others = self._owned
            try:
                self._working = [
                    self._threads.submit(go_on, own) for own in others[: max(tasks - 1, 0)]
                ]
                go_on(first)
                for done in self._working:
                    done.result()
            finally:
                is_over.set()
                wait(self._working)

    def close(self) -> None:
        """End the threads."""
        self._threads.shutdown()
