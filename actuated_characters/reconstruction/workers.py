"""Processes that grow branches, each with its own engine."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from actuated_characters.reconstruction.problem import Problem
from actuated_characters.reconstruction.world import Branch, Grown, TrialWorld
from msgs_config.errors import RunError

_MOST_DEATHS = 5  # deaths of processes in one window, after which something else must be wrong

_engine: tuple[Problem, int] | None = None  # what a process makes its world of
_world: TrialWorld | None = None


class Workers:
    """Grows branches on a number of processes; 1 is this process alone.

    To be closed by its opener, which ends all the processes. A process that dies is replaced, and
    what it was doing is done again.
    """

    def __init__(self, problem: Problem, window_ticks: int, count: int) -> None:
        self._engine = problem, window_ticks
        self._count = count
        self._pool = None if count == 1 else self._fresh_pool()
        self._own: TrialWorld | None = None

    def __enter__(self) -> "Workers":
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if self._pool is not None:
            if kind is not None:  # after an error nobody waits for the processes' work
                for process in multiprocessing.active_children():
                    process.terminate()
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
                with _interrupts_blocked():  # here while processes start, and in them for good
                    results = self._pool.map(_grow, branches[done:])
                for grown in results:
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


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Ctrl-C waits; a process that is begun meanwhile leaves it to the one that began it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
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


def _begin(problem: Problem, window_ticks: int) -> None:
    """What a worker's process does first."""
    global _engine
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _engine = problem, window_ticks


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _grow(branch: Branch) -> Grown | None:
    global _world
    if _world is None:
        assert _engine is not None
        _world = TrialWorld(*_engine)  # an error in this line becomes the task's error
    return _world.grow(branch)
