"""The command `actuated_characters report`: a page about a recorded run."""

import argparse
from pathlib import Path

from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.settings import (
    Commands,
    add_bag,
    add_command,
    add_robot,
    print_remarks,
    robot_source,
)
from msgs_config.errors import ConfigurationError

_STILLS = 8
_MOST_STILLS = 100


def add_report(commands: "Commands[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    report = add_command(
        commands,
        _report,
        "report",
        "say on a page how a recorded run went",
        "Write a page on how a run went: a verdict, the character at moments side by side, the "
        "tracking error of each joint, torques against their limits, contacts, and what happened "
        "(pushes, throws, resets, changed parameters, a fall). It is HTML that needs nothing "
        "beside itself; its pictures are PNG files, too. `view` shows the motion, `info --ticks` "
        "the times.",
        [
            "report runs/demo",
            "report runs/demo --topic description_joint_states --output robot-report",
        ],
    )
    add_bag(report)
    add_robot(report, "report on this one alone of several")
    report.add_argument(
        "--output",
        type=Path,
        metavar="DIR",
        help="where page and pictures go (RUN/report, or BAG-report); an old report is replaced",
    )
    report.add_argument(
        "--stills",
        type=int,
        default=_STILLS,
        metavar="N",
        help="pictures of the character, side by side (%(default)s); 0: none",
    )


def _report(options: argparse.Namespace) -> None:
    if not 0 <= options.stills <= _MOST_STILLS:
        raise ConfigurationError(f"--stills is {options.stills}; it must be 0 to {_MOST_STILLS}")
    from actuated_characters.report.writing import write_report

    with progress_bar("report", 1, "sections", transient=True) as bar:

        def progress(done: int, total: int) -> None:
            bar.update(bar.task_ids[0], completed=done, total=total)

        page = write_report(
            options.bag,
            options.output,
            stills=options.stills,
            progress=progress,
            source=robot_source(options),
            told=print_remarks,
        )
    print(page)
