"""Writes pictures as a film of the kind that its file's name says: .mp4, or .webp for pages."""

from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

from PIL import Image

from actuated_characters.render.engine.camera_pose import Size
from actuated_characters.render.engine.renderer import Picture
from actuated_characters.render.video import check_video, write_video
from msgs_config.errors import ConfigurationError, RecordingError
from msgs_config.whole_files import replacing

VIDEO, ANIMATION = ".mp4", ".webp"
FILMS = (VIDEO, ANIMATION)

_FASTEST_ANIMATION = 100  # frames a second; browsers show shorter ones for 100 ms
_MOST_BYTES = 1024**3  # of all pictures of an animation, which Pillow takes at once
_QUALITY, _EFFORT = 45, 4  # of 100, of 6: plain surfaces without visible blocks


def write_film(path: Path, pictures: Iterable[Picture], count: int, size: Size, fps: int) -> None:
    """Write `count` pictures (h, w, 3) as a film of constant rate, whole or not at all.

    The same pictures give the same file. An animation is played again and again, and needs nothing
    but an <img> on a page.

    Args:
        path: The file; one that is there is replaced.
        pictures: Its frames.
        count: How many.
        size: Width and height of each of them in pixels.
        fps: Frames a second.

    Raises:
        ConfigurationError, RecordingError: as `check_film`; the file cannot be written.
    """
    check_film(path, count, size, fps)
    if path.suffix.lower() == VIDEO:
        write_video(path, pictures, size, fps)
        return
    first, *others = map(Image.fromarray, pictures)
    ends = [round(1000.0 * number / fps) for number in range(count + 1)]  # ms
    durations = [end - begin for begin, end in pairwise(ends)]
    try:
        with replacing(path) as part:
            first.save(
                part,
                format="WEBP",
                save_all=True,
                append_images=others,
                duration=durations,
                loop=0,
                quality=_QUALITY,
                method=_EFFORT,
            )
    except OSError as error:
        raise RecordingError(f"cannot write film {path}: {error.strerror or error}") from error


def check_film(path: Path, count: int, size: Size, fps: int) -> None:
    """Check what would be a pity to find out after all the work.

    Raises:
        ConfigurationError: the size, the rate or so many pictures cannot be; PyAV, which writes
            .mp4, is not installed.
    """
    if path.suffix.lower() == VIDEO:
        check_video(size, fps)
        return
    if not 1 <= fps <= _FASTEST_ANIMATION:
        raise ConfigurationError(
            f"{fps} frames a second; it must be 1 to {_FASTEST_ANIMATION} in a {ANIMATION}"
        )
    width, height = size
    most = _MOST_BYTES // (width * height * 3)
    if count > most:
        raise ConfigurationError(
            f"{count} pictures of {width}x{height}; a {ANIMATION} may have {most}: "
            f"give --from and --to, a smaller --size or --fps, or write a {VIDEO}"
        )
