"""The command `actuated_characters sweep`: a table of runs, and a table of what became of them."""

import argparse
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from actuated_characters.commands.common.interruption import check_interruption
from actuated_characters.commands.common.progress import progress_bar, say
from actuated_characters.commands.common.row_workers import (
    add_row_workers,
    results_directory,
    row_workers,
    worker_count,
)
from actuated_characters.commands.common.settings import Commands, add_command
from msgs_config.errors import ConfigurationError
from msgs_config.runtime.extras import hint, require_extra

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.sweep.journal import Journal
    from actuated_characters.sweep.work import Job, Report

_FOLDER = Path("sweeps")
_MOST_CHECKED = 50  # rows that are planned before the first one runs


def add_sweep(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    command = add_command(
        commands,
        _sweep,
        "sweep",
        "run a table of runs, on all processors or on a cluster",
        "Run all rows of a table of runs: options of `run` and parameters, whose lists are a grid, "
        "random values and seeds, as a file says. DIR/table.csv and DIR/table.parquet have the "
        "figures, the verdict and the hash of the states of each. Ctrl-C keeps what is done; the "
        "same command goes on. docs/sweep.md says what the file may have.",
        [
            "sweep examples/pushes.yaml --verify 0.1",
            "sweep examples/pushes.yaml --scheduler tcp://HOST:8786",
        ],
    )
    add_row_workers(command, _FOLDER)
    command.add_argument(
        "--verify",
        type=float,
        default=0.0,
        metavar="SHARE",
        help="of the rows, such as 0.02, that is computed once more by another worker; the exit "
        "code is 1 if a result is not the same (0)",
    )


def _sweep(options: argparse.Namespace) -> int:
    require_extra("sweep", "sweep")
    from actuated_characters.commands.common.row_runs import asked_run, row_options
    from actuated_characters.sweep.file import read_sweep
    from actuated_characters.sweep.grid import rows_to_check
    from actuated_characters.sweep.journal import Journal, fingerprint
    from actuated_characters.sweep.row import FIGURES, ROWS
    from actuated_characters.sweep.work import Job, check_rows
    from msgs_config.versions import engine_versions

    if not 0.0 <= options.verify <= 1.0:
        raise ConfigurationError(f"--verify is {options.verify:g}; it must be a share from 0 to 1")
    worker_count(options)  # a wrong one is said before anything else
    sweep = read_sweep(options.file, row_options(), FIGURES)
    rows = sweep.rows()
    for warning in check_rows(
        options.file, asked_run, rows_to_check(sweep.axes, rows, _MOST_CHECKED)
    ):
        print(warning)
    directory = results_directory(options, _FOLDER)
    job = Job(rows, directory, sweep.bags, sweep.seed, options.verify)
    check_interruption()  # all modules are imported by now
    made_of = fingerprint(rows, engine_versions(), sweep.bags, sweep.seed)
    with Journal(directory, made_of, again=options.again) as journal:
        if journal.has_forgotten:
            shutil.rmtree(directory / ROWS, ignore_errors=True)
        try:
            report = _work(options, job, journal)
        except BaseException:
            if journal.done:
                _write_table(job, journal)
                done = f"{len(journal.done)} of {len(rows)} rows are in {directory}"
                say(f"{done}; the same command goes on")
            raise
        _write_table(job, journal)
        return _conclude(job, journal, report)


def _work(options: argparse.Namespace, job: "Job", journal: "Journal") -> "Report":
    """Have the rows done that are not; shows the progress."""
    from actuated_characters.sweep.work import Report, is_done, work

    if is_done(job, journal):
        return Report()
    rows = len(job.rows)
    with (
        row_workers(options, job.directory) as workers,
        progress_bar(options.file.stem, rows, "rows") as bar,
    ):

        def progress() -> None:
            outcomes = [done.outcome for done in journal.done.values()]
            fell = sum(outcome.figures.get("fell") is True for outcome in outcomes)
            errors = sum(bool(outcome.error) for outcome in outcomes)
            state = f"{fell} fell, {errors} with an error"
            bar.update(bar.task_ids[0], completed=len(outcomes), state=state)

        progress()
        return work(job, workers, journal, progress)


def _write_table(job: "Job", journal: "Journal") -> None:
    from actuated_characters.sweep.table import make_records, write_tables

    if not write_tables(job.directory, make_records(job.rows, journal.done)):
        say(f"without pyarrow there is no table.parquet: {hint('sweep')}")


def _conclude(job: "Job", journal: "Journal", report: "Report") -> int:
    """Say what became of the sweep; returns the exit code."""
    outcomes = [done.outcome for done in journal.done.values()]
    errors = sum(bool(outcome.error) for outcome in outcomes)
    fell = sum(outcome.figures.get("fell") is True for outcome in outcomes)
    print(f"{len(outcomes)} of {len(job.rows)} rows: {fell} fell, {errors} with an error")
    print(f"the table: {job.directory / 'table.csv'}")
    verified = [journal.verified[each] for each in sorted(journal.verified)]
    different = [each for each in verified if each.difference]
    if verified:
        own = sum(each.by == journal.done[each.number].by for each in verified)
        alone = f"; {own} by the same worker, for no other was there" if own else ""
        print(f"{len(verified)} rows were computed twice, {len(different)} differ{alone}")
    for each in different:
        print(f"error: row {each.number} differs: {each.difference}", file=sys.stderr)
    for line in report.undone:
        print(f"error: {line}", file=sys.stderr)
    return int(bool(different or report.undone))
