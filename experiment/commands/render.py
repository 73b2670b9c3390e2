"""The command `actuated_characters render`: pictures of a recorded run."""

import argparse
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # it takes a second to import
    from sim_node.stage import Size

_COUNT = 8
_MOST = 10_000  # pictures


def add_render(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    render = commands.add_parser(
        "render",
        help="draw pictures of a recorded run",
        description="Draw a recorded run as pictures side by side, in one PNG file.",
        epilog="example: actuated_characters render runs/demo --times 0,0.5,1 --reference",
    )
    render.set_defaults(command=_render)
    render.add_argument("run", type=Path, metavar="RUN", help="a run's directory, or a bag")
    when = render.add_mutually_exclusive_group()
    when.add_argument("--times", metavar="S,S,...", help="when, in s since the run's first state")
    when.add_argument(
        "--count",
        type=int,
        default=_COUNT,
        metavar="N",
        help="so many pictures, evenly from the first state to the last (%(default)s)",
    )
    render.add_argument("--columns", type=int, metavar="N", help="pictures in a row (all, up to 8)")
    render.add_argument(
        "--reference", action="store_true", help="draw the reference, too, as a ghost"
    )
    render.add_argument(
        "--size", metavar="WxH", help="pixels of each picture (as suits the character)"
    )
    render.add_argument(
        "--output", type=Path, metavar="FILE.png", help="where to write it (RUN/strip.png)"
    )


def _render(options: argparse.Namespace) -> None:
    if options.count > _MOST:
        raise ConfigurationError(f"--count is {options.count}; it must be {_MOST} or less")
    times = options.count if options.times is None else _times(options.times)
    size = None if options.size is None else _size(options.size)
    from experiment.bags.recording import read_recording
    from experiment.figures import STRIP
    from experiment.render import save_png, strip

    output = options.output or options.run / STRIP
    recording = read_recording(options.run)
    _check_output(output)
    count = times if isinstance(times, int) else len(times)
    with _progress_bar(recording.character.name, count) as bar:
        picture = strip(
            recording,
            times,
            columns=options.columns,
            ghost=options.reference,
            size=size,
            progress=lambda done: bar.update(bar.task_ids[0], completed=done),
        )
    save_png(picture, output)
    print(output)


def _times(text: str) -> list[float]:
    try:
        return [float(piece) for piece in text.split(",")]
    except ValueError as error:
        raise ConfigurationError(
            f"--times {text}: write numbers with commas between them, such as 0,0.5,1"
        ) from error


def _size(text: str) -> "Size":
    match = re.fullmatch(r"([0-9]{1,9})x([0-9]{1,9})", text)
    if match is None:
        raise ConfigurationError(f"--size {text}: write it as WxH in pixels, such as 640x480")
    return int(match[1]), int(match[2])


def _check_output(output: Path) -> None:
    """What would be a pity to find out after all the work."""
    if output.suffix.lower() != ".png":
        raise ConfigurationError(f"--output {output}: it must be a .png file")
    if output.is_dir() or not output.absolute().parent.is_dir():
        reason = "it is a directory" if output.is_dir() else "its directory does not exist"
        raise ConfigurationError(f"--output {output}: {reason}")
    if not os.access(output if output.exists() else output.absolute().parent, os.W_OK):
        raise ConfigurationError(f"--output {output}: no permission to write there")


def _progress_bar(description: str, count: int) -> Progress:
    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("pictures"),
        console=Console(stderr=True),
    )
    bar.add_task(description, total=count)
    return bar
