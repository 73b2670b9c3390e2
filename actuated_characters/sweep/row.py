"""One row of a sweep: a run in this process, and what became of it."""

import os
import shutil
import socket
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from actuated_characters.recorder.run_directory import prepare_directory, read_metrics
from actuated_characters.report.verdict import describe_end, describe_law
from actuated_characters.runs.in_process import run_in_process
from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.sweep.grid import Cell
from msgs_config.errors import ActuatedCharactersError, RecordingError

FIGURES = (
    *("ticks", "sim_time_s", "actuators", "root_actuators", "degrees_of_freedom"),
    *("fell", "fell_at_s", "fell_in_mode"),
    *("joint_error_mean_rad", "slider_error_mean_m", "slider_error_max_m"),
    *("root_error_mean_m", "root_error_max_m", "assist_force_mean_n", "body_weight_n"),
    *("saturated_fraction", "rejected_commands", "duplicate_commands"),
    *("missing_ticks", "dropped_references"),
)
"""Of a run's summary, those that are the same whenever and wherever it is computed again."""
_THREADS = "controller_node.plan.workers"
ROWS = "rows"
"""The folder of the bags that are kept."""
_RUN = "run"


@dataclass(frozen=True)
class AskedRun:
    """A run as its arguments ask for it."""

    plan: RunPlan
    inputs: PlannedInputs
    recording: Mapping[str, object]  # parameters of the recorder
    warnings: Sequence[str] = ()  # sentences that the user should read


Ask: TypeAlias = Callable[[Sequence[str]], AskedRun]
"""Makes a run of the arguments of `run`; raises ActuatedCharactersError if there is none."""


@dataclass(frozen=True)
class RowTask:
    """What a worker is told of a row."""

    number: int
    arguments: tuple[str, ...]
    bags: str  # whether its bag is kept: `none`, `failures` or `all`
    results: Path  # of the sweep
    until_fall: bool = False  # whether it ends when its character fell, which is all it says


@dataclass(frozen=True)
class Outcome:
    """What became of a row; equal wherever it is computed."""

    figures: Mapping[str, Cell]
    verdict: str = ""
    state_hash: str = ""
    error: str = ""  # why it was refused, or failed: one line
    is_refused: bool = False  # whether there is no such run, so that it never began

    @property
    def has_failed(self) -> bool:
        """Whether its character fell, or did not pass a trial, or there was an error."""
        fell, survived = self.figures.get("fell"), self.figures.get("survived")
        return bool(self.error) or fell is True or survived is False


def row_directory(results: Path, number: int) -> Path:
    """Where a row's bag is kept."""
    return results / ROWS / f"{number:05d}"


def compute(
    task: RowTask,
    ask: Ask,
    scratch: Path | None = None,
    run: Callable[[RowTask, Ask, Path], Outcome] | None = None,
) -> Outcome:
    """Run a row.

    The planner of each has one thread, unless the row says otherwise: the workers have the
    processors. What the row itself is to blame for is part of the outcome.

    Args:
        task: The row.
        ask: Makes its run.
        scratch: Where a folder for its files is made, which is deleted in the end.
        run: Runs it into a directory; by default in this process.

    Raises:
        OSError: the files cannot be written.
        RecordingError: likewise.
    """
    with tempfile.TemporaryDirectory(prefix="row-", dir=scratch) as folder:
        directory = Path(folder) / _RUN
        outcome = (run or partial(run_row, run=_run_whole))(task, ask, directory)
        if task.bags == "all" or (task.bags == "failures" and outcome.has_failed):
            _keep(directory, row_directory(task.results, task.number))
        return outcome


def with_one_thread(arguments: Sequence[str]) -> list[str]:
    """The arguments of a run whose planner has one thread, unless they say otherwise."""
    if any(each.startswith(f"--set={_THREADS}:=") for each in arguments):
        return list(arguments)
    return [*arguments, f"--set={_THREADS}:=1"]


def run_row(
    task: RowTask, ask: Ask, directory: Path, run: Callable[[AskedRun, RowTask, Path], Outcome]
) -> Outcome:
    """Run a row; its outcome, also if there is no such run, or it fails on its way.

    Raises:
        RecordingError: the files cannot be written.
    """
    try:
        asked = ask(with_one_thread(task.arguments))
    except ActuatedCharactersError as error:
        return replace(failed(error, directory), is_refused=True)
    try:
        prepare_directory(directory, overwrite=False)
        return run(asked, task, directory)
    except RecordingError:
        raise  # the disk is full, or the like: not what becomes of the row anywhere
    except ActuatedCharactersError as error:
        return replace(_measured(directory), error=failed(error, directory).error)


def _measured(directory: Path) -> Outcome:
    """What a run has shown by now, which may have failed; without a verdict."""
    try:
        summary, _ = read_metrics(directory)
    except RecordingError:
        return Outcome({})
    return Outcome(_figures(summary), state_hash=summary["state_hash"])


def _run_whole(asked: AskedRun, task: RowTask, directory: Path) -> Outcome:
    run_in_process(
        asked.plan,
        directory,
        write_bag=task.bags != "none",
        recording=asked.recording,
        inputs=asked.inputs,
    )
    summary, series = read_metrics(directory)
    has_reference = bool(np.isfinite(series["joint_error_mean_rad"]).any())
    verdict = describe_end(
        summary, describe_law(asked.plan.controller), has_reference=has_reference
    )
    return Outcome(_figures(summary), verdict, summary["state_hash"])


def failed(error: ActuatedCharactersError, directory: Path) -> Outcome:
    """The outcome of a row that was refused, or failed; without the path of this worker."""
    return Outcome({}, error=" ".join(str(error).split()).replace(str(directory), _RUN))


def _figures(summary: Mapping[str, Any]) -> dict[str, Cell]:
    return {name: summary[name] for name in FIGURES}


def _keep(directory: Path, kept: Path) -> None:
    """Move a run's files to where they are kept, whole or not at all; they may be there already."""
    if not directory.is_dir():
        return  # the row was refused
    if not kept.parent.parent.is_dir():
        raise RecordingError(
            f"{kept.parent.parent} is not there on {socket.gethostname()}; bags need a folder that "
            "all workers see, or 'bags: none'"
        )
    kept.parent.mkdir(exist_ok=True)
    part = Path(tempfile.mkdtemp(prefix=f".{kept.name}.", dir=kept.parent))
    try:
        shutil.move(directory, part / kept.name)
        shutil.rmtree(kept, ignore_errors=True)
        os.rename(part / kept.name, kept)
    finally:
        shutil.rmtree(part, ignore_errors=True)
