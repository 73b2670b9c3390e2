"""The command `actuated_characters search`: from which value on runs fail."""

import argparse
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from actuated_characters.commands.common.interruption import check_interruption
from actuated_characters.commands.common.progress import progress_bar, say
from actuated_characters.commands.common.row_workers import (
    add_row_workers,
    results_directory,
    row_workers,
    worker_count,
)
from actuated_characters.commands.common.settings import Commands, add_command
from actuated_characters.commands.common.tables import make_table, show
from msgs_config.runtime.extras import require_extra

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.boundary.survey import Survey
    from actuated_characters.sweep.journal import Journal
    from actuated_characters.sweep.table import Record
    from actuated_characters.sweep.work import Report

_FOLDER = Path("searches")
_MOST_CHECKED = 25  # points whose ends are planned before the first run
_MOST_SHOWN = 30  # points in the table on the screen


def add_search(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    command = add_command(
        commands,
        _search,
        "search",
        "search the least push, or any other value, with which runs fail",
        "Search from which value on runs fail, at each point of a grid: the least push by side and "
        "phase that fells a walk, the lowest friction, the longest delay. DIR/boundary.csv has a "
        "line for each point, DIR/boundary.png is their picture, DIR/rows has a bag of each, and "
        "DIR/table.csv all runs. Runs that hold beyond the first that fails are told. Ctrl-C keeps "
        "what is done; the same command goes on. docs/search.md says what the file may have.",
        ["search examples/longest_delay.yaml", "search examples/push_map_balance.yaml"],
    )
    add_row_workers(command, _FOLDER)


def _search(options: argparse.Namespace) -> int:
    require_extra("sweep", "search")
    from actuated_characters.boundary.file import read_search
    from actuated_characters.boundary.picture import PICTURE
    from actuated_characters.boundary.survey import Survey
    from actuated_characters.boundary.table import BOUNDARY
    from actuated_characters.commands.common.row_runs import asked_run, row_options
    from actuated_characters.sweep.grid import rows_to_check
    from actuated_characters.sweep.journal import Journal, fingerprint
    from actuated_characters.sweep.row import FIGURES, ROWS
    from actuated_characters.sweep.table import PARQUET, TABLE
    from actuated_characters.sweep.work import check_rows
    from msgs_config.versions import engine_versions

    worker_count(options)  # a wrong one is said before anything else
    search = read_search(options.file, row_options(), FIGURES)
    found = Survey(search)
    ends = [
        [search.row(point.number, value, point.number) for point in found.points]
        for value in (search.way.first, search.way.last)
    ]
    to_check = [row for rows in ends for row in rows_to_check(search.axes, rows, _MOST_CHECKED)]
    for warning in check_rows(options.file, asked_run, to_check):
        print(warning)
    directory = results_directory(options, _FOLDER)
    check_interruption()  # all modules are imported by now
    rows = [row for each in ends for row in each]
    made_of = fingerprint(rows, engine_versions(), search.way, search.figure, search.limit)
    with Journal(directory, made_of, again=options.again) as journal:
        if journal.has_forgotten:
            shutil.rmtree(directory / ROWS, ignore_errors=True)
            for name in (BOUNDARY, PICTURE, TABLE, PARQUET):
                (directory / name).unlink(missing_ok=True)
        try:
            report = _work(options, found, directory, journal)
        except BaseException:
            if journal.done:
                say(f"{len(journal.done)} runs are in {directory}; the same command goes on")
            raise
        return _conclude(found, directory, journal, report)


def _work(
    options: argparse.Namespace, found: "Survey", directory: Path, journal: "Journal"
) -> "Report":
    """Have the runs done; shows the progress."""
    from actuated_characters.boundary.survey import is_over, show_ends, survey
    from actuated_characters.sweep.work import Report

    if is_over(found, directory, journal):
        _write(found, directory, journal)
        return Report()
    with (
        row_workers(options, directory) as workers,
        progress_bar(options.file.stem, found.most_rows(), "runs") as bar,
    ):

        def progress() -> None:
            bar.update(bar.task_ids[0], completed=len(journal.done))

        progress()
        report = survey(found, directory, workers, journal, progress)
        if not report.undone:
            bar.update(bar.task_ids[0], total=len(found.all_rows()))  # it may have been fewer
            _write(found, directory, journal)  # what was found is there if bags cannot be kept
            report = show_ends(found, directory, workers, journal, progress)
        bar.update(bar.task_ids[0], total=len(journal.done), state="")
        _write(found, directory, journal)
        return report


def _write(found: "Survey", directory: Path, journal: "Journal") -> None:
    """Write the tables, and the picture if there is anything to be seen."""
    from actuated_characters.boundary.picture import PICTURE, draw
    from actuated_characters.boundary.table import write_boundary
    from actuated_characters.sweep.table import make_records, write_tables

    write_tables(directory, make_records(found.all_rows(), journal.done))
    write_boundary(directory, found, journal.done)
    draw(found, directory / PICTURE)


def _conclude(found: "Survey", directory: Path, journal: "Journal", report: "Report") -> int:
    """Say what was found; returns the exit code."""
    from actuated_characters.boundary.picture import PICTURE
    from actuated_characters.boundary.table import BOUNDARY, boundary_records

    errors = list(report.undone)
    records = boundary_records(found, journal.done)
    if records and len(records) <= _MOST_SHOWN:
        _print_points(records)
    _print_summary(found)
    print(f"the table: {directory / BOUNDARY}")
    if (directory / PICTURE).exists():
        print(f"the picture: {directory / PICTURE}")
    if found.search.bags == "all" and not report.undone:
        print(f"a bag of each point: {directory / 'rows'}")
    errors += [f"point {each.number}: {each.error}" for each in found.points if each.error]
    errors += found.differences(journal.done)
    for line in errors:
        print(f"error: {line}", file=sys.stderr)
    return int(bool(errors))


def _print_points(records: "Sequence[Record]") -> None:
    from actuated_characters.sweep.grid import parameter_name

    shown = [name for name in records[0] if name not in ("state_hash", "error")]
    rows = [[show(record[name]) for name in shown] for record in records]
    Console().print(make_table("", list(map(parameter_name, shown)), rows))


def _print_summary(found: "Survey") -> None:
    """Say how many runs there were, and what is not as one would think."""
    boundaries = [found.boundary(point) for point in found.points if not point.error]
    failure = found.search.describe_failure()
    print(f"{len(found.all_rows())} runs, {len(boundaries)} points; a run has failed if {failure}")
    for count, what in (
        (sum(each.fails is None for each in boundaries), "held all along the way"),
        (sum(each.holds is None for each in boundaries), "failed from the first value on"),
        (
            sum(bool(each.holes) for each in boundaries),
            "have holes: beyond the first value that fails, others hold again",
        ),
    ):
        if count:
            print(f"{count} of {len(boundaries)} points {what}")
