"""Processes that grow branches, each with its own engine."""

import os
import tempfile
import uuid
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from actuated_characters.reconstruction.problem import Problem
from actuated_characters.reconstruction.world import Branch, Grown, Lost, TrialWorld
from msgs_config.runtime.extras import is_installed

if TYPE_CHECKING:  # it takes a second to import, and is needed for several processes alone
    from distributed import Client

_worlds: dict[str, TrialWorld] = {}  # of this process, by the search: one at most


def usual_count() -> int:
    """As many processes as there are processors, if there can be; else one."""
    return len(os.sched_getaffinity(0)) if is_installed("sweep") else 1


class Workers:
    """Grows branches: in this process alone, or on a cluster of Dask.

    To be closed by its opener, which ends all processes of a cluster on this machine. What a
    process did that dies is done again.
    """

    def __init__(
        self, problem: Problem, window_ticks: int, count: int, scheduler: str | None = None
    ) -> None:
        """On a number of processes of this machine, or on the cluster of a scheduler's address."""
        self._engine = problem, window_ticks
        self._count, self._scheduler = count, scheduler
        self._session = uuid.uuid4().hex
        self._open = ExitStack()
        self._client: Client | None = None
        self._own: TrialWorld | None = None

    def __enter__(self) -> "Workers":
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()
        if self._own is not None:
            self._own.close()

    def grow(self, branches: Sequence[Branch]) -> Iterator[Grown | Lost]:
        """What becomes of branches, in their order.

        Raises:
            ActuatedCharactersError: a process cannot make the problem's plan, all of them die, or
                there is no such scheduler.
        """
        if self._count == 1 and self._scheduler is None:
            self._own = self._own or TrialWorld(*self._engine)
            for branch in branches:
                yield self._own.grow(branch)
            return
        from actuated_characters.cluster import results_in_order

        self._client = self._client or self._started()
        task = partial(_grow, self._session, *self._engine)
        yield from results_in_order(self._client, task, branches)

    def _started(self) -> "Client":
        from actuated_characters.cluster import joined_cluster, local_cluster

        if self._scheduler is not None:
            return self._open.enter_context(joined_cluster(self._scheduler))
        scratch = self._open.enter_context(tempfile.TemporaryDirectory(prefix="reconstruct-"))
        return self._open.enter_context(local_cluster(self._count, Path(scratch)))


def _grow(session: str, problem: Problem, window_ticks: int, branch: Branch) -> Grown | Lost:
    """Grow a branch in a worker's process."""
    from actuated_characters.cluster import ALONE

    with ALONE:
        if session not in _worlds:
            while _worlds:  # of a search that is over
                _worlds.popitem()[1].close()
            _worlds[session] = TrialWorld(problem, window_ticks)
        return _worlds[session].grow(branch)
