"""The command `actuated_characters verify`: rows of a trial once more, on any machine."""

import argparse
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from actuated_characters.commands.common.interruption import check_interruption
from actuated_characters.commands.common.progress import progress_bar, say
from actuated_characters.commands.common.row_workers import worker_count
from actuated_characters.commands.common.settings import Commands, add_command
from actuated_characters.commands.trial import (
    add_workers,
    build,
    check_trials,
    trial_workers,
)
from msgs_config.errors import ConfigurationError, RunError
from msgs_config.runtime.extras import require_extra

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.trial.controller_file import Controller
    from actuated_characters.trial.trial_set import TrialSet


def add_verify(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    command = add_command(
        commands,
        _verify,
        "verify",
        "run rows of a trial once more, and compare",
        "Run rows of a trial's results once more, here or on another machine, and compare the "
        "hashes of their states. The exit code is 1 if one is not the same; a line names the row, "
        "the first thing that differs, and both hosts.",
        ["verify trials/pd_controller-lift --row 3 --row 7"],
    )
    command.add_argument("result", type=Path, metavar="RESULT", help="the results of `trial`")
    which = command.add_mutually_exclusive_group()
    which.add_argument(
        "--row",
        type=int,
        action="append",
        default=[],
        metavar="N",
        help="this row (all); may be repeated",
    )
    which.add_argument(
        "--share", type=float, default=1.0, metavar="SHARE", help="of the rows, such as 0.1 (1)"
    )
    command.add_argument(
        "--controller",
        type=Path,
        metavar="CONTROLLER.yaml",
        help="the controller's file here, if it is not where it was",
    )
    add_workers(command)


def _verify(options: argparse.Namespace) -> int:
    require_extra("wheels", "verify")
    from actuated_characters.commands.common.row_runs import asked_run
    from actuated_characters.sweep.work import Job
    from actuated_characters.trial.results import read_done
    from actuated_characters.trial.row import Trial
    from actuated_characters.trial.verifying import chosen_rows, verify

    count = worker_count(options)
    if not 0.0 <= options.share <= 1.0:
        raise ConfigurationError(f"--share is {options.share:g}; it must be from 0 to 1")
    controller, trials = _read(options)
    done = read_done(options.result)
    rows = {row.number: row for row in trials.rows}
    if not done:
        raise RunError(f"{options.result}: none of its rows is done")
    if not done.keys() <= rows.keys():
        raise RunError(f"{options.result} has rows that its set of trials does not have")
    trial = Trial(controller, trials.goals(), asked_run)
    check_trials(trial, trials)
    job = Job(trials.rows, options.result.absolute())
    tasks = [job.task(rows[number]) for number in chosen_rows(done, options.row, options.share)]
    check_interruption()  # all modules are imported by now
    with (
        tempfile.TemporaryDirectory(prefix="verify-") as scratch,
        trial_workers(trial, min(count, len(tasks)), Path(scratch)) as workers,
        progress_bar(f"verify {options.result.name}", len(tasks), "rows") as bar,
    ):
        found = verify(tasks, done, workers, lambda: bar.advance(bar.task_ids[0]))
    different = {number: text for number, text in found.items() if text}
    print(f"{len(found)} of {len(done)} rows were run again, {len(different)} differ")
    for number, text in different.items():
        print(f"error: row {number} {text}", file=sys.stderr)
    return int(bool(different))


def _read(options: argparse.Namespace) -> "tuple[Controller, TrialSet]":
    """The controller and the set of a result; says what is otherwise than it was."""
    from actuated_characters.commands.common.row_runs import row_options
    from actuated_characters.trial.controller_file import read_controller
    from actuated_characters.trial.results import read_result
    from actuated_characters.trial.trial_set import read_set
    from actuated_characters.trial.verifying import changes

    result = read_result(options.result)
    file = options.controller or result.controller
    folder = file.absolute().parent if options.controller else result.folder
    if not folder.is_dir():
        raise ConfigurationError(
            f"{folder}, where the controller was, is not there; --controller says where its file is"
        )
    controller = read_controller(file, folder)
    trials = read_set(result.trials, controller, row_options(), result.engine)
    build(file, controller)
    for line in changes(result, controller.digests()):
        say(f"note: {line}")
    return controller, trials
