"""The command `actuated_characters trial`: anybody's controller put through a set of trials."""

import argparse
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from actuated_characters.commands.common.interruption import check_interruption
from actuated_characters.commands.common.progress import progress_bar, say
from actuated_characters.commands.common.row_workers import scratch_folder, worker_count
from actuated_characters.commands.common.settings import Commands, add_command
from actuated_characters.commands.common.tables import make_table
from msgs_config.errors import ConfigurationError
from msgs_config.runtime.extras import require_extra

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.sweep.journal import Journal
    from actuated_characters.sweep.work import Job
    from actuated_characters.trial.controller_file import Controller
    from actuated_characters.trial.row import Trial
    from actuated_characters.trial.runs_at_once import RunsAtOnce
    from actuated_characters.trial.trial_set import TrialSet

_FOLDER = Path("trials")
_FILMS = 5
_LAST_LINES = 3  # are told of a build that failed


def add_trial(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    command = add_command(
        commands,
        _trial,
        "trial",
        "put a controller through a set of trials",
        "Start a controller again and again, any command that a file names, beside a simulator "
        "that differs in each row of a set of trials: over topics in lockstep, several at once. "
        "DIR/index.html has the shares that survived, films of failures and the table. Ctrl-C "
        "keeps what is done; the same command goes on. docs/trials.md says what the files have.",
        [
            "trial examples/trials/pd_controller.yaml",
            "trial examples/trials/planner.yaml --workers 2",
        ],
    )
    command.add_argument("file", type=Path, metavar="CONTROLLER.yaml", help="who is on trial")
    command.add_argument(
        "--trials",
        metavar="NAME|FILE.yaml",
        help="a shipped set, or one of your own (that which the controller's file names)",
    )
    command.add_argument(
        "--output",
        type=Path,
        metavar="DIR",
        help=f"where the results go ({_FOLDER}/CONTROLLER-SET)",
    )
    command.add_argument(
        "--again", action="store_true", help="forget the results in DIR, and begin again"
    )
    command.add_argument(
        "--films",
        type=int,
        default=_FILMS,
        metavar="N",
        help="of so many failures (%(default)s); without the extra `video` they are pictures",
    )
    add_workers(command)


def add_workers(command: argparse.ArgumentParser) -> None:
    """Add the option that says how many runs are made at once."""
    command.add_argument(
        "--workers", type=int, metavar="N", help="runs at once (as many as there are processors)"
    )


def _trial(options: argparse.Namespace) -> int:
    require_extra("wheels", "trial")
    from actuated_characters.commands.common.row_runs import asked_run, row_options
    from actuated_characters.sweep.journal import Journal, fingerprint
    from actuated_characters.sweep.row import ROWS
    from actuated_characters.sweep.work import Job
    from actuated_characters.trial.controller_file import read_controller
    from actuated_characters.trial.results import FILMS, write_result
    from actuated_characters.trial.row import Trial
    from actuated_characters.trial.trial_set import find_set, read_set, shipped_sets
    from msgs_config.versions import engine_versions
    from sim_node.physics.engine import DEFAULT_ENGINE

    count = worker_count(options)
    controller = read_controller(options.file)
    named = options.trials or controller.trials
    if not named:
        raise ConfigurationError(
            f"{options.file} names no trials; --trials takes {', '.join(shipped_sets())} or a file"
        )
    folder = Path() if options.trials else controller.folder
    trials = read_set(find_set(named, folder), controller, row_options(), DEFAULT_ENGINE)
    build(options.file, controller)
    trial = Trial(controller, trials.goals(), asked_run)
    for warning in check_trials(trial, trials):
        print(warning)
    directory = (options.output or _FOLDER / f"{controller.name}-{trials.name}").absolute()
    job = Job(trials.rows, directory, trials.bags)
    check_interruption()  # all modules are imported by now
    goals = (f"{len(kind.rows)} {kind.goal}" for kind in trials.kinds)
    made_of = fingerprint(trials.rows, engine_versions(), trials.bags, *goals)
    made_of["controller"] = controller.fingerprint()
    with Journal(directory, made_of, again=options.again) as journal:
        if journal.has_forgotten:
            for name in (ROWS, FILMS):
                shutil.rmtree(directory / name, ignore_errors=True)
        write_result(directory, options.file, controller, trials, DEFAULT_ENGINE)
        return _work(options, trial, trials, job, journal, count)


def build(file: Path, controller: "Controller") -> None:
    """Build a controller, and check that there is its program.

    Raises:
        ConfigurationError: it cannot be built, or there is none.
    """
    from actuated_characters.trial.controller_file import check_program

    if controller.build:
        try:
            made = subprocess.run(
                controller.build,
                cwd=controller.folder,
                capture_output=True,
                text=True,
                errors="replace",
            )
        except OSError as error:
            raise ConfigurationError(
                f"{file}: build: cannot start {controller.build[0]}: {error.strerror or error}"
            ) from error
        if made.returncode:
            words = (made.stdout + made.stderr).strip().splitlines()
            last = " | ".join(words[-_LAST_LINES:]) or "it printed nothing"
            raise ConfigurationError(f"{file}: build: exit code {made.returncode}: {last}")
    check_program(file, controller)


def check_trials(trial: "Trial", trials: "TrialSet") -> list[str]:
    """Plan rows with each choice of each kind, so that what is wrong is said before anything runs.

    Returns the sentences that the user should read, each once.

    Raises:
        ConfigurationError: a row cannot be; names it.
    """
    from actuated_characters.sweep.work import check_rows

    warnings: dict[str, None] = {}
    for kind in trials.kinds:
        check = partial(trial.check, kind.rows[0].number)  # all rows of a kind have one goal
        warnings |= dict.fromkeys(check_rows(trials.path, check, kind.to_check()))
    return list(warnings)


@contextmanager
def trial_workers(trial: "Trial", count: int, directory: Path) -> "Iterator[RunsAtOnce]":
    """So many runs at once, whose files go into a directory meanwhile."""
    from actuated_characters.trial.runs_at_once import runs_at_once

    with scratch_folder(directory) as scratch, runs_at_once(trial, count, scratch) as workers:
        yield workers


def _work(
    options: argparse.Namespace,
    trial: "Trial",
    trials: "TrialSet",
    job: "Job",
    journal: "Journal",
    count: int,
) -> int:
    """Have the rows done that are not, and say what became of all; returns the exit code."""
    from actuated_characters.sweep.work import is_done, work

    undone: list[str] = []
    try:
        if not is_done(job, journal):
            with (
                trial_workers(trial, min(count, len(job.rows)), job.directory) as workers,
                progress_bar(
                    f"{trial.controller.name}: {trials.name}", len(job.rows), "rows"
                ) as bar,
            ):

                def progress() -> None:
                    failed = sum(each.outcome.has_failed for each in journal.done.values())
                    state = f"{failed} failed"
                    bar.update(bar.task_ids[0], completed=len(journal.done), state=state)

                progress()
                undone = work(job, workers, journal, progress).undone
    except BaseException:
        if journal.done:
            done = f"{len(journal.done)} of {len(job.rows)} rows are in {job.directory}"
            say(f"{done}; the same command goes on")
        raise
    _conclude(options, trial, trials, job, journal)
    for line in undone:
        say(f"error: {line}")
    return int(bool(undone))


def _conclude(
    options: argparse.Namespace, trial: "Trial", trials: "TrialSet", job: "Job", journal: "Journal"
) -> None:
    """Write table, films and page, and say what became of the trial."""
    from actuated_characters.sweep.table import make_records, write_tables
    from actuated_characters.trial.page import make_films, survival_table, write_page
    from actuated_characters.trial.trial_set import FIGURES
    from msgs_config.runtime.extras import is_installed

    records = make_records(job.rows, journal.done, FIGURES)
    write_tables(job.directory, records)
    failures = [n for n in sorted(journal.done) if journal.done[n].outcome.has_failed]
    most = min(max(options.films, 0), len(failures))
    with progress_bar("films", most, "films", transient=True) as bar:
        films = make_films(
            job.directory,
            failures,
            most,
            as_films=is_installed("video"),
            progress=lambda done: bar.update(bar.task_ids[0], completed=done),
        )
    page = write_page(job.directory, trial.controller.name, trials, journal.done, records, films)
    table = survival_table(trials, journal.done)
    name = f"{trial.controller.name}: {trials.name}"
    Console().print(make_table(name, table.columns, table.rows))
    for line in dict.fromkeys(f"error: {d.outcome.error}" for d in journal.done.values()):
        if line != "error: ":
            say(line)
    print(f"the table: {job.directory / 'table.csv'}")
    print(page)
