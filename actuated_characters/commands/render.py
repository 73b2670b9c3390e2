"""The command `actuated_characters render`: pictures and films of a recorded run."""

import argparse
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from actuated_characters.commands.common.progress import progress_bar
from msgs_config.errors import ConfigurationError

if TYPE_CHECKING:  # they take a second to import
    from actuated_characters.bags.recording import Recording
    from actuated_characters.render.engine.render_scene import Size

_COUNT = 8
_MOST = 10_000  # pictures
_FPS = 30
_MOVIE = ".mp4"
_GHOSTS = ("beside", "over", "none")


def add_render(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to those of `actuated_characters`."""
    render = commands.add_parser(
        "render",
        help="draw pictures or a film of a recorded run",
        description="Draw a recorded run as pictures side by side, in one PNG file; or, with "
        "--video or an --output that ends in .mp4, as a film.",
        epilog="examples: actuated_characters render runs/demo --times 0,0.5,1 --ghost over; "
        "actuated_characters render runs/demo --video --speed 0.25 --from 1 --to 3",
    )
    render.set_defaults(command=_render)
    render.add_argument("run", type=Path, metavar="RUN", help="a run's directory, or a bag")
    render.add_argument("--video", action="store_true", help="a film (RUN/video.mp4)")
    render.add_argument(
        "--output", type=Path, metavar="FILE", help="where to write it (RUN/strip.png)"
    )
    render.add_argument(
        "--character", metavar="NAME", help="draw this one alone of several, such as left"
    )
    render.add_argument(
        "--ghost",
        choices=_GHOSTS,
        help="where to draw the reference: beside the character (films only; their default), "
        "over it, where it really is, or not at all (the strip's default)",
    )
    render.add_argument("--reference", action="store_true", help="the same as --ghost over")
    render.add_argument(
        "--size", metavar="WxH", help="pixels of a picture (strip: as suits; film: 960x540)"
    )
    _add_strip(render.add_argument_group("strip"))
    _add_film(render.add_argument_group("film"))


def _add_strip(group: "argparse._ArgumentGroup") -> None:
    group.add_argument("--times", metavar="S,S,...", help="when, in s since the run's first state")
    group.add_argument(
        "--count",
        type=int,
        metavar="N",
        help=f"so many pictures, evenly from the first state to the last ({_COUNT})",
    )
    group.add_argument("--columns", type=int, metavar="N", help="pictures in a row (all, up to 8)")


def _add_film(group: "argparse._ArgumentGroup") -> None:
    group.add_argument("--fps", type=int, metavar="N", help=f"pictures a second ({_FPS})")
    group.add_argument(
        "--speed", type=float, metavar="X", help="simulated seconds a second; 0.25 is slow (1)"
    )
    group.add_argument("--from", type=float, metavar="S", dest="start", help="begin there (0)")
    group.add_argument("--to", type=float, metavar="S", dest="end", help="end there (the last)")
    group.add_argument(
        "--contacts", action="store_true", help="mark the links that touch something"
    )
    group.add_argument(
        "--workers", type=int, metavar="N", help="processes that draw (as many as cores)"
    )


_STRIP_OPTIONS = ("times", "count", "columns")
_FILM_OPTIONS = ("fps", "speed", "start", "end", "contacts", "workers")
_FLAGS = {"start": "from", "end": "to"}


def _render(options: argparse.Namespace) -> None:
    is_film = options.video or (
        options.output is not None and options.output.suffix.lower() == _MOVIE
    )
    _check(options, is_film)
    if is_film:
        _render_film(options)
    else:
        _render_strip(options)


def _check(options: argparse.Namespace, is_film: bool) -> None:
    """What is of the other kind is a mistake, rather than without effect."""
    for name in _STRIP_OPTIONS if is_film else _FILM_OPTIONS:
        if getattr(options, name) not in (None, False):
            kind = "a strip's, and this is a film" if is_film else "a film's; add --video"
            raise ConfigurationError(f"--{_FLAGS.get(name, name)} is {kind}")
    if options.times is not None and options.count is not None:
        raise ConfigurationError("--times and --count: give one of the two")
    if options.reference and options.ghost not in (None, "over"):
        raise ConfigurationError(f"--reference is --ghost over; --ghost is {options.ghost}")


def _render_strip(options: argparse.Namespace) -> None:
    count = _COUNT if options.count is None else options.count
    if count > _MOST:
        raise ConfigurationError(f"--count is {count}; it must be {_MOST} or less")
    if options.ghost == "beside":
        raise ConfigurationError("--ghost beside is a film's; a strip has it over, or none")
    times = count if options.times is None else _times(options.times)
    size = None if options.size is None else _size(options.size)
    from actuated_characters.render.stills import save_png, strip
    from actuated_characters.runs.run_directory import STRIP

    output = options.output or _place(options.run) / STRIP
    recordings = _read(options)
    _check_output(output, ".png")
    count = times if isinstance(times, int) else len(times)
    with progress_bar(recordings[0].character.name, count, "pictures") as bar:
        picture = strip(
            recordings,
            times,
            columns=options.columns,
            ghost=options.reference or options.ghost == "over",
            size=size,
            progress=lambda done: bar.update(bar.task_ids[0], completed=done),
        )
    save_png(picture, output)
    print(output)


def _render_film(options: argparse.Namespace) -> None:
    size = None if options.size is None else _size(options.size)
    ghost = "over" if options.reference else options.ghost
    from actuated_characters.render.movie import MOVIE_SIZE, GhostPlace, Movie, MovieSettings
    from actuated_characters.render.video import check_video
    from actuated_characters.runs.run_directory import VIDEO

    output = options.output or _place(options.run) / VIDEO
    _check_output(output, _MOVIE)
    settings = MovieSettings(
        fps=_FPS if options.fps is None else options.fps,
        speed=1.0 if options.speed is None else options.speed,
        start=options.start or 0.0,
        end=options.end,
        size=size or MOVIE_SIZE,
        ghost=None if ghost is None else GhostPlace(ghost),
        contacts=options.contacts,
        workers=options.workers,
    )
    check_video(settings.size, settings.fps)
    movie = Movie(_read(options), settings)
    with progress_bar(output.name, len(movie), "pictures") as bar:
        movie.save(output, lambda done: bar.update(bar.task_ids[0], completed=done))
    print(output)


def _place(run: Path) -> Path:
    """Where pictures of it go: a bag may be a file, too."""
    return run if run.is_dir() else run.parent


def _read(options: argparse.Namespace) -> "tuple[Recording, ...]":
    """The characters to be drawn."""
    from actuated_characters.bags.recording import read_recording, read_recordings

    if options.character is None:
        return read_recordings(options.run)
    return (read_recording(options.run, options.character),)


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


def _check_output(output: Path, suffix: str) -> None:
    """What would be a pity to find out after all the work."""
    if output.suffix.lower() != suffix:
        raise ConfigurationError(f"--output {output}: it must be a {suffix} file")
    if output.is_dir() or not output.absolute().parent.is_dir():
        reason = "it is a directory" if output.is_dir() else "its directory does not exist"
        raise ConfigurationError(f"--output {output}: {reason}")
    if not os.access(output if output.exists() else output.absolute().parent, os.W_OK):
        raise ConfigurationError(f"--output {output}: no permission to write there")
