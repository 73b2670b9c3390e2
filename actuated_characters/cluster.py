"""Clusters of Dask: processes that work for this one, on this machine or on any number of them."""

import logging
import os
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from typing import TypeVar

import dask
from distributed import Client, KilledWorker, LocalCluster, Security
from distributed.comm.core import CommClosedError

from actuated_characters.runs.held_signals import signals_held
from msgs_config.errors import ConfigurationError, RunError
from msgs_config.runtime.worker_processes import interrupts_blocked
from msgs_config.versions import engine_versions

T = TypeVar("T")
Item = TypeVar("Item")
LOST = (CancelledError, CommClosedError)
"""What Dask raises where a scheduler is there no more."""
WORKERS_DIED = "each worker that was at it died"
ALONE = Lock()
"""For tasks: a worker's process with several threads has one engine at work all the same."""
_PACKAGE = "actuated_characters"
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


@contextmanager
def local_cluster(count: int, scratch: Path) -> Iterator[Client]:
    """A cluster on this machine, of which nothing is left in the end; it listens to it alone.

    Args:
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
        yield clients[0]


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
def joined_cluster(address: str) -> Iterator[Client]:
    """The cluster whose scheduler has that address.

    Raises:
        ConfigurationError: there is none, or one of its workers has not this package,
            or other engines.
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
        _check_workers(client)
        yield client


def _check_workers(client: Client) -> None:
    """Check that the workers have this package, or they die of what they are sent; and engines."""
    found = client.run(find_spec, _PACKAGE, on_error="return")
    without = [address for address, spec in found.items() if spec is None]
    if without:
        raise ConfigurationError(
            f"the worker {without[0]} has no {_PACKAGE}; install it in the Python that runs it"
        )
    here = engine_versions()
    for address, versions in client.run(engine_versions, on_error="return").items():
        if not isinstance(versions, Mapping):  # it has died meanwhile
            continue
        other = [name for name in here if versions[name] != here[name]]
        if other:
            raise ConfigurationError(
                f"the worker {address} has {other[0]} {versions[other[0]]} (here "
                f"{here[other[0]]}); install the same there"
            )


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


def results_in_order(
    client: Client, task: Callable[[Item], T], items: Sequence[Item]
) -> Iterator[T]:
    """Have the workers do a task for each item; the results in the items' order.

    What a worker did that dies is done again.

    Raises:
        Exception: what the task raised.
        RunError: the scheduler is gone, or each worker that was at a task died.
    """
    futures = client.map(task, items, pure=False)
    for future in futures:
        try:
            yield future.result()
        except KilledWorker as error:
            raise RunError(WORKERS_DIED) from error
        except LOST as error:
            raise lost() from error


def lost() -> RunError:
    """The error where a scheduler is there no more."""
    return RunError("the scheduler of the cluster is gone")
