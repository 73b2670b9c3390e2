"""Threads that share tasks which hold no lock of Python's."""

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Generic, TypeVar

Own = TypeVar("Own")


class WorkerThreads(Generic[Own]):
    """Workers with something of their own each; the thread that asks is the first one."""

    def __init__(self, owned: Sequence[Own]) -> None:
        """One worker for each entry, such as an engine that no other thread may use."""
        self._owned = owned
        self._threads = ThreadPoolExecutor(max(len(owned) - 1, 1))

    def share(self, tasks: int, work: Callable[[Own, int], object]) -> None:
        """Do tasks 0 to `tasks - 1`, each once: whoever is free takes the next one."""
        numbers = itertools.count()

        def go_on(own: Own) -> None:
            while (number := next(numbers)) < tasks:
                work(own, number)

        first, *others = self._owned
        futures = [self._threads.submit(go_on, own) for own in others[: tasks - 1]]
        go_on(first)
        for done in futures:
            done.result()

    def close(self) -> None:
        """End the threads."""
        self._threads.shutdown()
