"""Rows of a trial, several at once: each in a process that starts those of its run."""

import os
import signal
import socket
import sys
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import FrameType

from actuated_characters.sweep.row import Outcome, RowTask, compute
from actuated_characters.sweep.work import Answer
from actuated_characters.trial.row import Trial
from msgs_config.errors import ActuatedCharactersError, RunError
from msgs_config.runtime.ros_environment import DOMAIN_ID
from msgs_config.runtime.worker_processes import WorkerProcesses

_WAITING = 1  # rows that wait, so that no process does


class RunsAtOnce:
    """Processes that run rows over topics, as the workers of a sweep."""

    def __init__(self, pool: WorkerProcesses, count: int, trial: Trial, scratch: Path) -> None:
        self._pool, self._count, self._trial, self._scratch = pool, count, trial, scratch
        self._asked: dict[Future[tuple[Outcome, str]], tuple[RowTask, bool]] = {}

    def size(self) -> int:
        """How many rows should be with them at once."""
        return self._count + _WAITING

    def submit(self, task: RowTask) -> None:
        """Have a row run."""
        self._submit(task, is_repeat=False)

    def repeat(self, task: RowTask, address: str) -> None:
        """Have a row run once more; all are of this machine."""
        del address
        self._submit(task, is_repeat=True)

    def _submit(self, task: RowTask, *, is_repeat: bool) -> None:
        future = self._pool.submit(_work, task, self._trial, self._scratch)
        self._asked[future] = (task, is_repeat)

    def wait(self) -> Answer:
        """The next answer; see `Workers`."""
        done, _ = wait(self._asked, return_when=FIRST_COMPLETED)
        future = done.pop()
        task, is_repeat = self._asked.pop(future)
        try:
            outcome, by = future.result()
        except BrokenProcessPool as error:
            raise RunError(
                "a process that runs rows was killed; the same command goes on"
            ) from error
        except (ActuatedCharactersError, OSError) as error:
            return Answer(task, is_repeat, None, failure=" ".join(str(error).split()))
        return Answer(task, is_repeat, outcome, by)


@contextmanager
def runs_at_once(trial: Trial, count: int, scratch: Path) -> Iterator[RunsAtOnce]:
    """So many runs at once; after an error nothing is left of those that were not over.

    Args:
        trial: Who is on trial.
        count: Of the runs.
        scratch: Takes their files.
    """
    with WorkerProcesses(count, _begin) as pool:
        yield RunsAtOnce(pool, count, trial, scratch)


class _Ended(BaseException):
    """This process is to end; it is no error of any kind that a run could take for its own."""


class _Worker:
    """What a process that runs rows knows of itself."""

    is_busy = False
    is_to_end = False


def _begin() -> None:
    """Have each run find a domain of its own, and end in good order.

    Ctrl-C is the parent's. To block it is not enough: the processes of a run would have it blocked
    as well, and they are asked to end by it.
    """
    signal.signal(signal.SIGINT, lambda number, frame: None)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    os.environ.pop(DOMAIN_ID, None)
    sys.stdout = open(os.devnull, "w")  # noqa: SIM115  the domain is of nobody's interest
    signal.signal(signal.SIGTERM, _end)


def _end(number: int, frame: FrameType | None) -> None:
    """End, but not amid a run whose processes are to be ended first."""
    del number, frame
    _Worker.is_to_end = True
    if not _Worker.is_busy:
        os._exit(1)


def _go_on(ticks: int) -> None:
    del ticks
    if _Worker.is_to_end:
        raise _Ended


def _work(task: RowTask, trial: Trial, scratch: Path) -> tuple[Outcome, str]:
    """Run a row; returns its outcome, and who it was."""
    by = f"{socket.gethostname()} (process {os.getpid()})"
    _Worker.is_busy = True
    try:
        return compute(task, trial.ask, scratch, partial(trial.run, progress=_go_on)), by
    except _Ended:
        os._exit(1)
    finally:
        _Worker.is_busy = False
        if _Worker.is_to_end:
            os._exit(1)
