"""The command `actuated_characters study`: the lecture's figures by runs of the real nodes."""

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from actuated_characters.studies.catalogue import NAMES, load_study
from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.studies.framework.result import Cell, StudyResult
    from actuated_characters.studies.framework.study import Study

_ALL = "all"


def add_study(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    study = commands.add_parser(
        "study",
        help="work out the lecture's figures",
        description=(
            "Work out one of the lecture's topics by runs of the real nodes in lockstep: pictures "
            "(PNG, SVG), a table (CSV, and printed). docs/lecture.md says what each shows."
        ),
        epilog="example: actuated_characters study lift",
    )
    study.set_defaults(command=_study)
    study.add_argument(
        "name", choices=(*NAMES, _ALL), metavar="NAME", help=", ".join(NAMES) + ", or all"
    )
    study.add_argument(
        "--output", type=Path, default=Path("studies"), metavar="DIR", help="(%(default)s)/NAME"
    )
    study.add_argument("--overwrite", action="store_true", help="replace what is in DIR/NAME")
    study.add_argument("--keep-runs", action="store_true", help="keep the bags in DIR/NAME/runs")


def _study(options: argparse.Namespace) -> None:
    from actuated_characters.runs.ros_domain import own_domain

    names = NAMES if options.name == _ALL else (options.name,)
    directories = {name: options.output.absolute() / name for name in names}
    for directory in directories.values():
        if directory.exists() and any(directory.iterdir()) and not options.overwrite:
            raise ConfigurationError(
                f"{directory} is not empty; --overwrite replaces what is there"
            )
    with own_domain() as domain:  # one for all runs
        os.environ.setdefault("ROS_DOMAIN_ID", str(domain))
        for name, directory in directories.items():
            _run_study(load_study(name), directory, keep_runs=options.keep_runs)


def _run_study(study: "Study", directory: Path, *, keep_runs: bool) -> None:
    from actuated_characters.studies.framework.runner import TopicRunner

    console = Console()
    done: dict[str, float] = {}
    with _progress_bar() as bar:
        task = bar.add_task(study.name, total=float(study.runs))

        def report(label: str, share: float) -> None:
            done[label] = share
            total = max(float(study.runs), float(len(done)))
            bar.update(
                task,
                description=f"{study.name}: {label}",
                completed=sum(done.values()),
                total=total,
            )

        runner = TopicRunner(directory, keep_runs=keep_runs, report=report)
        result = study.run(runner)
        bar.update(task, description=study.name, completed=bar.tasks[task].total)
    files = result.write(directory)
    console.print(_table(study.title, result))
    for note in result.notes:
        console.print(note)
    console.print(f"in {directory}: {', '.join(file.name for file in files)}")


def _table(title: str, result: "StudyResult") -> Table:
    table = Table(title=title, title_justify="left")
    for column in result.columns:
        table.add_column(column, overflow="fold")
    for row in result.rows:
        table.add_row(*(_shown(cell) for cell in row.values()))
    return table


def _shown(cell: "Cell") -> str:
    if cell is None:
        return "-"
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)


def _progress_bar() -> Progress:
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
    )
