"""The command `actuated_characters recover`: a complete bag of what a killed recorder left."""

import argparse
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.settings import Commands, add_command
from actuated_characters.commands.common.tables import make_table
from msgs_config.errors import RecordingError
from msgs_config.file_kinds import refuse_other_kind

if TYPE_CHECKING:  # it takes a second to import
    from actuated_characters.recorder.recovery import Recovered

_NS_PER_S = 10**9


def add_recover(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    recover = add_command(
        commands,
        _recover,
        "recover",
        "make a bag complete that its recorder could not close",
        "Make a complete bag (MCAP) of all that reached the disk before a recorder was killed, the "
        "disk was full, or a copy broke off: at most the last second of a run is missing. The new "
        "bag takes the old one's place, which is kept beside it as BAG.damaged. In a run's "
        "directory the figures that it lacks are made. A complete bag is not touched.",
        ["recover runs/demo"],
    )
    recover.add_argument(
        "bag", type=Path, metavar="BAG", help="a run's directory, or the directory of a bag"
    )


def _recover(options: argparse.Namespace) -> None:
    from actuated_characters.recorder.recovery import recover

    refuse_other_kind(options.bag, "a run or the directory of a bag", (), RecordingError)
    with progress_bar("", 1.0) as bar:

        def report(what: str, fraction: float | None) -> None:
            bar.update(bar.task_ids[0], description=what, completed=fraction or 0.0)

        recovered = recover(options.bag, report)
    _tell(recovered)


def _tell(recovered: "Recovered") -> None:
    contents, bag = recovered.contents, recovered.bag
    if recovered.damaged is None:
        print(f"{bag} is complete ({contents.counts.total()} messages): nothing to recover")
    else:
        counts = sorted(contents.counts.items())
        Console().print(make_table("recovered", ("topic", "messages"), counts))
        last = datetime.fromtimestamp(contents.last_log_time_ns / _NS_PER_S, UTC)
        print(f"{bag}: {contents.counts.total()} messages, the last one of {last:%F %T.%f} UTC")
        for part in contents.unreadable:
            print(f"unreadable: {part}")
        print(f"the damaged bag: {recovered.damaged}")
    for directory in recovered.measured:
        print(f"figures: {directory}")
    for directory in recovered.unchanged:
        print(f"figures: {directory}, as they were: of the whole run, the bag is a part of it")
    if recovered.unmeasured:
        print(f"no figures: {recovered.unmeasured}")
