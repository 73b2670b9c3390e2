"""The command `actuated_characters render`: pictures and movies of a recorded run."""

import argparse
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from actuated_characters.commands.common.progress import progress_bar
from actuated_characters.commands.common.settings import add_robot, print_remarks, robot_source
from actuated_characters.commands.common.skin_options import add_skin, given_skin
from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # they take a second to import
    from actuated_characters.bags.recording import Recording
    from actuated_characters.render.engine.camera_pose import Size

_COUNT = 8
_MAX_PICTURES = 10_000
_FPS = 30
_MOVIES = (".mp4", ".webp")  # those of `write_film`
_GHOSTS = ("beside", "over", "none")
_STRIP_OPTIONS = ("times", "count", "columns")
_MOVIE_OPTIONS = ("fps", "speed", "contacts", "workers")


def add_render(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    render = commands.add_parser(
        "render",
        help="draw pictures or a movie of a recorded run",
        description="Draw a recorded run as pictures side by side, in one PNG file; with --video "
        "or an --output that ends in .mp4 or .webp (for pages), as a movie. Arrows are pushes.",
        epilog="examples: actuated_characters render runs/demo --times 0,0.5,1 --ghost over; "
        "actuated_characters render runs/demo --video --speed 0.25 --from 1 --to 3; "
        "actuated_characters render runs/demo --output demo.webp --to 2 --fps 20 --size 480x270; "
        "actuated_characters render runs/demo --skin body.glb; "
        "actuated_characters render runs/demo --topic description_joint_states",
    )
    render.set_defaults(command=_render)
    add = render.add_argument
    add("run", type=Path, metavar="RUN", help="a run's directory, or a bag")
    add("--video", action="store_true", help="a movie (RUN/video.mp4)")
    add("--output", type=Path, metavar="FILE", help="where to write it (RUN/strip.png)")
    add_robot(render, "draw this one alone of several, such as left")
    add("--from", type=float, metavar="S", dest="start", help="begin there, s (0)")
    add("--to", type=float, metavar="S", dest="end", help="end there, s (the last state)")
    add(
        "--ghost",
        choices=_GHOSTS,
        help="where to draw the reference: beside the character (movies only; their default), "
        "over it, where it really is, or not at all (the strip's default)",
    )
    add("--reference", action="store_true", help="the same as --ghost over")
    add("--shapes", action="store_true", help="the shapes themselves, not the skin around them")
    add_skin(render)
    add("--size", metavar="WxH", help="pixels of a picture (strip: as suits; movie: 960x540)")
    add = render.add_argument_group("strip").add_argument
    add("--times", metavar="S,S,...", help="when, in s since the run's first state")
    add(
        "--count",
        type=int,
        metavar="N",
        help=f"so many pictures, evenly from first to last, or where a push acts ({_COUNT})",
    )
    add("--columns", type=int, metavar="N", help="pictures in a row (all, up to 8)")
    add = render.add_argument_group("movie").add_argument
    add("--fps", type=int, metavar="N", help=f"pictures a second ({_FPS})")
    add("--speed", type=float, metavar="X", help="simulated seconds a second; 0.25 is slow (1)")
    add("--contacts", action="store_true", help="mark the links that touch something")
    add("--workers", type=int, metavar="N", help="processes that draw (as many as cores)")


def _render(options: argparse.Namespace) -> None:
    is_movie = options.video or (
        options.output is not None and options.output.suffix.lower() in _MOVIES
    )
    _check(options, is_movie)
    if is_movie:
        _render_movie(options)
    else:
        _render_strip(options)


def _check(options: argparse.Namespace, is_movie: bool) -> None:
    """Reject an option of the other kind, which would be without effect, and contradictions."""
    for name in _STRIP_OPTIONS if is_movie else _MOVIE_OPTIONS:
        if getattr(options, name) not in (None, False):
            kind = "a strip's, and this is a movie" if is_movie else "a movie's; add --video"
            raise ConfigurationError(f"--{name} is {kind}")
    part = {"--count": options.count, "--from": options.start, "--to": options.end}
    for name, value in part.items():
        if options.times is not None and value is not None:
            raise ConfigurationError(f"--times and {name}: give one of the two")
    if options.reference and options.ghost not in (None, "over"):
        raise ConfigurationError(f"--reference is --ghost over; --ghost is {options.ghost}")
    if options.ghost == "beside" and not is_movie:
        raise ConfigurationError("--ghost beside is a movie's; a strip has it over, or none")


def _render_strip(options: argparse.Namespace) -> None:
    times = _COUNT if options.count is None else options.count
    if times > _MAX_PICTURES:
        raise ConfigurationError(f"--count is {times}; it must be {_MAX_PICTURES} or less")
    if options.times is not None:
        times = _times(options.times)
    size = None if options.size is None else _size(options.size)
    from actuated_characters.recorder.run_directory import STRIP
    from actuated_characters.render.stills import save_png, strip

    skin = given_skin(options)
    recordings = _read(options)
    output = _output(options, STRIP, (Path(STRIP).suffix,))
    count = times if isinstance(times, int) else len(times)
    with progress_bar(recordings[0].character.name, count, "pictures") as bar:
        picture = strip(
            recordings,
            times,
            start=options.start or 0.0,
            end=options.end,
            columns=options.columns,
            ghost=options.reference or options.ghost == "over",
            size=size,
            skinned=not options.shapes,
            skin=skin,
            progress=lambda done: bar.update(bar.task_ids[0], completed=done),
        )
    save_png(picture, output)
    print(output)


def _render_movie(options: argparse.Namespace) -> None:
    size = None if options.size is None else _size(options.size)
    ghost = "over" if options.reference else options.ghost
    from actuated_characters.recorder.run_directory import VIDEO
    from actuated_characters.render.films import check_film
    from actuated_characters.render.movie import MOVIE_SIZE, GhostPlace, Movie, MovieSettings

    settings = MovieSettings(
        fps=_FPS if options.fps is None else options.fps,
        speed=1.0 if options.speed is None else options.speed,
        start=options.start or 0.0,
        end=options.end,
        size=size or MOVIE_SIZE,
        ghost=None if ghost is None else GhostPlace(ghost),
        contacts=options.contacts,
        skinned=not options.shapes,
        skin=given_skin(options),
        workers=options.workers,
    )
    output = _output(options, VIDEO, _MOVIES)
    check_film(output, 0, settings.size, settings.fps)
    recordings = _read(options)
    movie = Movie(recordings, settings)
    with progress_bar(output.name, len(movie), "pictures") as bar:
        movie.save(output, lambda done: bar.update(bar.task_ids[0], completed=done))
    print(output)


def _read(options: argparse.Namespace) -> "tuple[Recording, ...]":
    """The characters to be drawn."""
    from actuated_characters.bags.robots.reading import read_any

    recordings = read_any(options.run, robot_source(options))
    print_remarks(recordings)
    return recordings


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


def _output(options: argparse.Namespace, name: str, suffixes: Sequence[str]) -> Path:
    """The file to write, by default beside a run's bag; checked before all the work."""
    folder = options.run if options.run.is_dir() else options.run.parent  # a bag may be a file
    output: Path = options.output or folder / name
    if output.suffix.lower() not in suffixes:
        raise ConfigurationError(f"--output {output}: it must be a {' or '.join(suffixes)} file")
    if output.is_dir() or not output.absolute().parent.is_dir():
        reason = "it is a directory" if output.is_dir() else "its directory does not exist"
        raise ConfigurationError(f"--output {output}: {reason}")
    if not os.access(output if output.exists() else output.absolute().parent, os.W_OK):
        raise ConfigurationError(f"--output {output}: no permission to write there")
    return output
