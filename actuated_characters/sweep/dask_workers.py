"""The computation of a sweep's rows by the workers of a cluster."""

import itertools
import os
import socket
import uuid
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

from distributed import Client, Future, KilledWorker, as_completed, get_worker

from actuated_characters.cluster import ALONE, LOST, WORKERS_DIED, lost
from actuated_characters.sweep.row import Ask, Outcome, RowTask, compute
from actuated_characters.sweep.until_fall import run_row_until_fall
from actuated_characters.sweep.work import Answer
from msgs_config.errors import ActuatedCharactersError, ConfigurationError, RunError
from msgs_config.versions import engine_versions

_MOST_SHOWN = 300  # characters of an error that nobody foresaw
_MOST_TRIES = 5  # of a row that another worker is to do
_WAITING = 3  # rows that wait, for each one that is computed
_Result: TypeAlias = tuple[Outcome, str, str]  # the worker is named, and has its address


@dataclass(frozen=True)
class _Asked:
    """What was asked of workers."""

    task: RowTask
    is_repeat: bool = False
    not_by: str = ""  # the address of a worker, if another one is to do it
    tries: int = 1


class DaskWorkers:
    """The workers of a cluster, as those of a sweep."""

    def __init__(self, client: Client, ask: Ask) -> None:
        self._client, self._ask = client, ask
        self._versions = engine_versions()
        self._session, self._numbers = uuid.uuid4().hex, itertools.count()
        self._asked: dict[str, _Asked] = {}
        self._answers = as_completed(raise_errors=False)

    def size(self) -> int:
        """How many rows should be with them at once."""
        return (1 + _WAITING) * max(1, sum(self._threads().values()))

    def submit(self, task: RowTask) -> None:
        """Have a row computed."""
        self._submit(_Asked(task))

    def repeat(self, task: RowTask, address: str) -> None:
        """Have a row computed once more, by another worker if there is another."""
        self._submit(_Asked(task, is_repeat=True, not_by=address))

    def _submit(self, asked: _Asked) -> None:
        # Keys of their own: Dask takes tasks with the same key for the same task.
        key = f"row-{asked.task.number}-{self._session}-{next(self._numbers)}"
        self._asked[key] = asked
        others = self._others(asked.not_by) if asked.not_by else []
        future = self._client.submit(
            _work,
            asked.task,
            self._ask,
            self._versions,
            key=key,
            pure=False,
            workers=others or None,
            allow_other_workers=bool(others),  # those that were there may be gone by then
        )
        self._answers.add(future)

    def wait(self) -> Answer:
        """The next answer; see `Workers`."""
        while True:
            future: Future[_Result] = next(self._answers)
            asked = self._asked.pop(str(future.key))
            if future.status not in ("finished", "error"):
                raise lost()
            try:
                error = future.exception()
                if error is not None:
                    return Answer(asked.task, asked.is_repeat, None, failure=_failure(asked, error))
                outcome, by, address = future.result()
            except LOST as closed:
                raise lost() from closed
            # Dask lets a worker that is idle take what is meant for others.
            if address == asked.not_by and asked.tries < _MOST_TRIES and self._others(address):
                self._submit(replace(asked, tries=asked.tries + 1))
                continue
            return Answer(asked.task, asked.is_repeat, outcome, by, address)

    def _others(self, address: str) -> list[str]:
        return [each for each in self._threads() if each != address]

    def _threads(self) -> Mapping[str, int]:
        """The number of threads of each worker, by address."""
        try:
            threads: Mapping[str, int] = self._client.nthreads()
        except (OSError, TimeoutError) as error:
            raise lost() from error
        return threads


def _failure(asked: _Asked, error: BaseException) -> str:
    """Why a row could not be done; raises RunError if it is no matter of that row."""
    if isinstance(error, (ActuatedCharactersError, OSError, ImportError)):
        raise RunError(f"row {asked.task.number}: {error}")
    if isinstance(error, KilledWorker):
        return WORKERS_DIED
    return " ".join(f"{type(error).__name__}: {error}".split())[:_MOST_SHOWN]


def _work(task: RowTask, ask: Ask, versions: Mapping[str, str]) -> "_Result":
    """Compute a row in a worker; returns the outcome, who it was, and its address."""
    worker = get_worker()
    by = f"{socket.gethostname()} (process {os.getpid()})"
    own = engine_versions()
    others = [
        f"{name} {version} (here {versions[name]})"
        for name, version in own.items()
        if version != versions[name]
    ]
    if others:
        raise ConfigurationError(f"{by} has {', '.join(others)}; install the same there")
    with ALONE:
        run = run_row_until_fall if task.until_fall else None
        outcome = compute(task, ask, Path(worker.local_directory), run)
    return outcome, by, worker.address
