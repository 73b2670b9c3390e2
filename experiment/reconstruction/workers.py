"""Processes that grow branches, each with an engine of its own."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from types import TracebackType

from experiment.reconstruction.problem import Problem
from experiment.reconstruction.world import Branch, Grown, TrialWorld
from msgs_config.errors import RunError

_MOST_DEATHS = 5  # of processes in one window, one after another; then something else is wrong

_world: TrialWorld | None = None


class Workers:
    """Grows branches on a number of processes; 1 is this process alone.

    Whoever opens it closes it: with it all the processes end. A process that dies is replaced, and
    what it was doing is done again.
    """

    def __init__(self, problem: Problem, window_ticks: int, count: int) -> None:
        self._engine = problem, window_ticks
        self._count = count
        self._pool = None if count == 1 else self._fresh_pool()
        self._own: TrialWorld | None = None

    def __enter__(self) -> "Workers":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
        if self._own is not None:
            self._own.close()

    def grow(self, branches: Sequence[Branch]) -> Iterator[Grown | None]:
        """What becomes of branches, in their order.

        Raises:
            ActuatedCharactersError: a process cannot make the problem's plan, or all of them die.
        """
        if self._count == 1:
            self._own = self._own or TrialWorld(*self._engine)
            for branch in branches:
                yield self._own.grow(branch)
            return
        done = 0
        for _ in range(_MOST_DEATHS):
            self._pool = self._pool or self._fresh_pool()
            try:
                for grown in self._pool.map(_grow, branches[done:]):
                    done += 1
                    yield grown
            except BrokenProcessPool:
                self._pool.shutdown(cancel_futures=True)
                self._pool = None
                continue
            return
        raise RunError(f"{_MOST_DEATHS} times a process of the search has died")

    def _fresh_pool(self) -> ProcessPoolExecutor:
        spawn = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self._count, spawn, _begin, self._engine)


def _begin(problem: Problem, window_ticks: int) -> None:
    """What a worker's process does first: Ctrl-C is for the process that started it."""
    global _world
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _world = TrialWorld(problem, window_ticks)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _grow(branch: Branch) -> Grown | None:
    assert _world is not None
    return _world.grow(branch)
