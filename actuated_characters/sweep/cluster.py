"""The workers of a sweep: processes of Dask, on this machine or on any cluster."""

import itertools
import logging
import os
import signal
import socket
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import TypeAlias

import dask
from distributed import (
    Client,
    Future,
    KilledWorker,
    LocalCluster,
    Security,
    as_completed,
    get_worker,
)

from actuated_characters.runs.held_signals import signals_held
from actuated_characters.sweep.row import Ask, Outcome, RowTask, compute, engine_versions
from actuated_characters.sweep.work import Answer
from msgs_config.errors import ActuatedCharactersError, ConfigurationError, RunError
from msgs_config.runtime.worker_processes import interrupts_blocked

_MOST_SHOWN = 300  # characters of an error that nobody foresaw
_MOST_TRIES = 5  # of a row that another worker is to do
_WAITING = 3  # rows that wait, for each one that is computed
_PATIENCE = 10.0  # s until a scheduler must have answered
_CONFIGURATION = {
    # Samples of stacks every 10 ms and of loops every 20 ms are for dashboards, and here are none.
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "2s",
    "distributed.admin.tick.limit": "1h",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.admin.system-monitor.disk": False,
    "distributed.admin.system-monitor.gil.enabled": False,
    # Memory that goes back to the system whenever it can comes back in every run: a tenth of it.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None,
    # Dask opens a port for pages in any case; there is nothing to be had at it.
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}
_Result: TypeAlias = tuple[Outcome, str, str]  # the worker is named, and has its address
_one_at_a_time = Lock()  # a process with several threads has one engine at work all the same


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
                raise _lost()
            error = future.exception()
            if error is not None:
                return Answer(asked.task, asked.is_repeat, None, failure=_failure(asked, error))
            outcome, by, address = future.result()
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
            raise _lost() from error
        return threads


@contextmanager
def local_workers(ask: Ask, count: int, scratch: Path) -> Iterator[DaskWorkers]:
    """Workers on this machine, of which nothing is left in the end; they listen to it alone.

    Args:
        ask: Makes the rows' runs.
        count: Of the processes, each with one thread.
        scratch: Takes their files.
    """
    with _quiet(), dask.config.set(_CONFIGURATION), ExitStack() as at_end:
        # what is begun meanwhile, threads and processes, leaves Ctrl-C to this one
        with signals_held(), interrupts_blocked():
            cluster = LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                scheduler_kwargs={"dashboard": False},
                security=Security.temporary(),  # else whoever has an account here could send work
                memory_limit=0,  # what runs take is theirs, not Dask's to be moved to the disk
                local_directory=str(scratch),
                silence_logs=logging.CRITICAL,
            )
            clients: list[Client] = []
            at_end.callback(_end, cluster, clients)
            clients.append(Client(cluster))
        yield DaskWorkers(clients[0], ask)


def _end(cluster: LocalCluster, clients: Sequence[Client]) -> None:
    """End the processes there and then: nobody waits for what they are at."""
    with signals_held(most=2):
        for nanny in cluster.workers.values():
            nanny.auto_restart = False
            if (process := nanny.pid) is not None:
                with suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
        for client in clients:
            client.close()
        cluster.close()


@contextmanager
def joined_workers(ask: Ask, address: str) -> Iterator[DaskWorkers]:
    """The workers of a cluster whose scheduler has that address.

    Raises:
        ConfigurationError: there is none.
    """
    with _quiet(), dask.config.set(_CONFIGURATION), ExitStack() as at_end:
        try:
            with signals_held(), interrupts_blocked():
                client = Client(address, timeout=_PATIENCE)
                at_end.callback(_leave, client)
        except (OSError, TimeoutError, ValueError) as error:
            raise ConfigurationError(
                f"--scheduler {address}: no scheduler of Dask answers there; write it as "
                "tcp://HOST:PORT"
            ) from error
        yield DaskWorkers(client, ask)


def _leave(client: Client) -> None:
    with signals_held(most=2), suppress(OSError, TimeoutError):
        client.close()


@contextmanager
def _quiet() -> Iterator[None]:
    """Leave it to this package to say what went wrong."""
    loggers = [logging.getLogger(name) for name in logging.root.manager.loggerDict]
    levels = {each: each.level for each in loggers if each.name.startswith("distributed")}
    try:
        for logger in levels:
            logger.setLevel(logging.CRITICAL)
        yield
    finally:
        for logger, level in levels.items():
            logger.setLevel(level)


def _failure(asked: _Asked, error: BaseException) -> str:
    """Why a row could not be done; raises RunError if it is no matter of that row."""
    if isinstance(error, (ActuatedCharactersError, OSError, ImportError)):
        raise RunError(f"row {asked.task.number}: {error}")
    if isinstance(error, KilledWorker):
        return "each worker that was at it died"
    return " ".join(f"{type(error).__name__}: {error}".split())[:_MOST_SHOWN]


def _lost() -> RunError:
    return RunError("the scheduler is gone; the same command goes on when there is one again")


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
    with _one_at_a_time:
        outcome = compute(task, ask, Path(worker.local_directory))
    return outcome, by, worker.address
