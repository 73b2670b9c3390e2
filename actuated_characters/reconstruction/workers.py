"""Processes that grow branches, each with its own engine."""

from collections.abc import Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool

from actuated_characters.reconstruction.problem import Problem
from actuated_characters.reconstruction.world import Branch, Grown, Lost, TrialWorld
from msgs_config.errors import RunError
from msgs_config.runtime.worker_processes import WorkerProcesses

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
        self._pool: WorkerProcesses | None = None
        self._own: TrialWorld | None = None

    def __enter__(self) -> "Workers":
        return self

    def __exit__(self, *error: object) -> None:
        if self._pool is not None:
            self._pool.__exit__(*error)
        if self._own is not None:
            self._own.close()

    def grow(self, branches: Sequence[Branch]) -> Iterator[Grown | Lost]:
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
            self._pool = self._pool or WorkerProcesses(self._count, _begin, *self._engine)
            try:
                for grown in self._pool.map(_grow, branches[done:]):
                    done += 1
                    yield grown
            except BrokenProcessPool:
                self._pool.close()
                self._pool = None
                continue
            return
        raise RunError(f"{_MOST_DEATHS} times a process of the search has died")


def _begin(problem: Problem, window_ticks: int) -> None:
    """What a worker's process does first."""
    global _engine
    _engine = problem, window_ticks


def _grow(branch: Branch) -> Grown | Lost:
    global _world
    if _world is None:
        assert _engine is not None
        _world = TrialWorld(*_engine)  # an error in this line becomes the task's error
    return _world.grow(branch)
