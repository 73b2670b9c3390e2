"""The command `actuated_characters study`: the lecture's figures by runs of the real nodes."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.settings import Commands, add_command
from actuated_characters.commands.common.tables import make_table, show
from lecture.framework.catalogue import NAMES, load_study
from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # it takes a second to import
    from lecture.framework.study import Study

_ALL = "all"


def add_study(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    study = add_command(
        commands,
        _study,
        "study",
        "work out the lecture's figures",
        "Work out one of the lecture's topics by runs of the real nodes in lockstep: pictures "
        "(PNG, SVG), a table (CSV, and printed). docs/lecture.md explains what each shows.",
        ["study lift"],
    )
    study.add_argument(
        "name", choices=(*NAMES, _ALL), metavar="NAME", help=", ".join(NAMES) + ", or all"
    )
    study.add_argument(
        "--output", type=Path, default=Path("studies"), metavar="DIR", help="(%(default)s)/NAME"
    )
    study.add_argument("--overwrite", action="store_true", help="replace what is in DIR/NAME")
    study.add_argument(
        "--fine", action="store_true", help="more runs where they make a finer figure (athletics)"
    )
    study.add_argument("--keep-runs", action="store_true", help="keep the bags in DIR/NAME/runs")


def _study(options: argparse.Namespace) -> None:
    names = NAMES if options.name == _ALL else (options.name,)
    directories = {name: options.output.absolute() / name for name in names}
    for directory in directories.values():
        if directory.exists() and any(directory.iterdir()) and not options.overwrite:
            raise ConfigurationError(
                f"{directory} is not empty; --overwrite replaces what is there"
            )
    for number, (name, directory) in enumerate(directories.items(), start=1):
        label = f"{name} ({number} of {len(names)})" if len(names) > 1 else name
        _run_study(load_study(name), label, directory, options)


def _run_study(study: "Study", label: str, directory: Path, options: argparse.Namespace) -> None:
    """Run a study with its progress on standard error, write and print its results."""
    from lecture.framework.runner import Runner

    console, done = Console(), dict[str, float]()
    with progress_bar(label, float(study.runs), "runs") as bar:
        task = bar.task_ids[0]

        def report(run: str, share: float) -> None:
            if run not in done and not bar.console.is_terminal:  # no bar is drawn there
                bar.console.print(f"{label}: run {len(done) + 1} of {study.runs}, {run}")
            done[run] = share
            total = max(float(study.runs), float(len(done)))
            bar.update(task, completed=sum(done.values()), total=total, state=run)

        runner = Runner(directory, keep_runs=options.keep_runs, report=report, fine=options.fine)
        result = study.run(runner)
        bar.update(task, completed=bar.tasks[task].total, state="")
    files = result.write(directory)
    rows = [[show(cell) for cell in row.values()] for row in result.rows]
    console.print(make_table(study.title, result.columns, rows, right=False))
    for remark in result.remarks:
        console.print(remark)
    console.print(f"in {directory}: {', '.join(file.name for file in files)}")
