"""The workers of commands that compute many runs: where they are, and where results go."""

import argparse
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from actuated_characters.commands.common.interruption import check_interruption
from actuated_characters.commands.common.progress import say
from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.sweep.work import Workers

_SCRATCH = ".workers"


def add_row_workers(command: argparse.ArgumentParser, folder: Path) -> None:
    """Add the file, where its results go, and who computes them."""
    command.add_argument("file", type=Path, metavar="FILE.yaml", help="what varies, and how")
    command.add_argument(
        "--output", type=Path, metavar="DIR", help=f"where the results go ({folder}/FILE)"
    )
    command.add_argument(
        "--again", action="store_true", help="forget the results in DIR, and begin again"
    )
    where = command.add_mutually_exclusive_group()
    add_workers(where)
    where.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="of any cluster of Dask, which computes the rows: tcp://HOST:PORT",
    )


def add_workers(command: argparse._ActionsContainer) -> None:
    """Add how many processes compute runs."""
    command.add_argument(
        "--workers", type=int, metavar="N", help="processes (as many as there are processors)"
    )


def worker_count(options: argparse.Namespace) -> int:
    """How many processes are asked for; raises ConfigurationError if that is none."""
    if options.workers is not None and options.workers < 1:
        raise ConfigurationError(f"--workers is {options.workers}; it must be 1 or more")
    return options.workers or len(os.sched_getaffinity(0))


def results_directory(options: argparse.Namespace, folder: Path) -> Path:
    """Where the results go."""
    directory: Path = options.output or folder / options.file.stem
    return directory.absolute()


@contextmanager
def scratch_folder(directory: Path) -> Iterator[Path]:
    """A folder in that of the results, for what workers write meanwhile; it is gone in the end."""
    scratch = directory / _SCRATCH
    shutil.rmtree(scratch, ignore_errors=True)  # of a command that was killed
    scratch.mkdir()
    try:
        yield scratch
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


@contextmanager
def row_workers(options: argparse.Namespace, directory: Path) -> "Iterator[Workers]":
    """The workers that the options ask for.

    Raises:
        ConfigurationError: there is no such scheduler.
    """
    from actuated_characters.cluster import joined_cluster, local_cluster
    from actuated_characters.commands.common.row_runs import asked_run
    from actuated_characters.sweep.dask_workers import DaskWorkers

    check_interruption()
    if options.scheduler is not None:
        with joined_cluster(options.scheduler) as client:
            if not client.nthreads():
                say("no worker has joined yet; it waits for the first one")
            yield DaskWorkers(client, asked_run)
        return
    with (
        scratch_folder(directory) as scratch,
        local_cluster(worker_count(options), scratch) as client,
    ):
        yield DaskWorkers(client, asked_run)
