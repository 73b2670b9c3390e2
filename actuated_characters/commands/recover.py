"""The command `actuated_characters recover`: a complete bag of what a killed recorder left."""

import argparse
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn
from rich.table import Table

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.bags.recovery import Recovered

_NS_PER_S = 10**9


def add_recover(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    recover = commands.add_parser(
        "recover",
        help="make a bag complete that its recorder could not close",
        description=(
            "Make a complete bag (MCAP) of all that reached the disk before a recorder was killed, "
            "the disk was full, or a copy broke off: at most the last second of a run is missing. "
            "The new bag takes the old one's place, which is kept beside it as BAG.damaged. In a "
            "run's directory the figures that it lacks are made. A complete bag is not touched."
        ),
        epilog="example: actuated_characters recover runs/demo",
    )
    recover.set_defaults(command=_recover)
    recover.add_argument(
        "bag", type=Path, metavar="BAG", help="a run's directory, or the directory of a bag"
    )


def _recover(options: argparse.Namespace) -> None:
    from actuated_characters.bags.recovery import recover

    with _progress_bar() as bar:
        task = bar.add_task("")

        def report(what: str, fraction: float | None) -> None:
            bar.update(task, description=what, completed=fraction or 0.0, total=1.0)

        recovered = recover(options.bag, report)
    _tell(recovered)


def _tell(recovered: "Recovered") -> None:
    console = Console()
    contents, bag = recovered.contents, recovered.bag
    if recovered.damaged is None:
        print(f"{bag} is complete ({contents.counts.total()} messages): nothing to recover")
    else:
        console.print(_table(recovered))
        last = datetime.fromtimestamp(contents.last_log_time_ns / _NS_PER_S, UTC)
        print(f"{bag}: {contents.counts.total()} messages, the last one of {last:%F %T.%f} UTC")
        for lost in contents.lost:
            print(f"unreadable: {lost}")
        print(f"the damaged bag: {recovered.damaged}")
    for directory in recovered.measured:
        print(f"figures: {directory}")
    for directory in recovered.kept:
        print(f"figures: {directory}, as they were: of the whole run, the bag is a part of it")
    if recovered.unmeasured:
        print(f"no figures: {recovered.unmeasured}")


def _table(recovered: "Recovered") -> Table:
    table = Table(title="recovered", title_justify="left")
    table.add_column("topic", overflow="fold")
    table.add_column("messages", justify="right")
    for topic, count in sorted(recovered.contents.counts.items()):
        table.add_row(escape(topic), str(count))
    return table


def _progress_bar() -> Progress:
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        console=Console(stderr=True),
    )
