"""What a browser shows of a recorded run, as a picture or a film."""

from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
import viser
from matplotlib.image import imsave

from actuated_characters.render.engine.camera_pose import Size
from actuated_characters.render.engine.renderer import Picture
from actuated_characters.render.video import write_video
from actuated_characters.viewer.drawing.scene import BACKGROUND
from actuated_characters.viewer.web.server import ViewerServer
from msgs_config.errors import RecordingError
from msgs_config.whole_files import write_whole

FPS = 30  # pictures a second of films

_PATIENCE = 30.0  # s that a browser may take for a picture

ShowRow = Callable[[float], None]
"""Brings the scene to a time, s."""


class CancelledError(Exception):
    """A client wants no film any more."""


def take_picture(client: viser.ClientHandle, size: Size) -> Picture:
    """What a client sees now (h, w, 3), drawn by its browser.

    Raises:
        RecordingError: the browser has gone, or does not respond.
    """
    width, height = size
    server = client._viser_server
    assert isinstance(server, ViewerServer)
    try:
        with server.awaiting_picture(client):
            drawn = client.get_render(height, width, transport_format="png", timeout=_PATIENCE)
    except (RuntimeError, TimeoutError) as error:
        raise RecordingError(f"the browser has sent no picture: {error}") from error
    if drawn.shape != (height, width, 4):
        raise RecordingError(
            f"the browser has sent a picture of shape {drawn.shape}, not {(height, width, 4)}"
        )
    opacity = drawn[..., 3:].astype(np.float64) / 255.0
    mixed = opacity * drawn[..., :3] + (1.0 - opacity) * np.array(BACKGROUND)
    picture: Picture = np.round(mixed).astype(np.uint8)
    return picture


def picture_size(client: viser.ClientHandle) -> Size:
    """Width and height of a client's view in pixels, both even."""
    width, height = client.camera.image_width, client.camera.image_height
    return max(width - width % 2, 2), max(height - height % 2, 2)


def save_picture(client: viser.ClientHandle, path: Path) -> None:
    """Write what a client sees now as PNG. Raises RecordingError: it cannot be had or written."""
    content = BytesIO()
    imsave(content, take_picture(client, picture_size(client)), format="png")
    write_whole(path, content.getvalue())


def save_film(
    client: viser.ClientHandle,
    path: Path,
    times: Sequence[float],
    show: ShowRow,
    progress: Callable[[int], None],
) -> None:
    """Write what a client sees at some times, s, as MP4; `progress` gets the number of frames.

    Raises:
        RecordingError: a picture cannot be had, or the film cannot be written.
        ConfigurationError: PyAV is not installed.
    """
    size = picture_size(client)

    def frames() -> Iterator[Picture]:
        for number, time in enumerate(times):
            progress(number)
            show(time)
            yield take_picture(client, size)

    write_video(path, frames(), size, FPS)


def free_path(directory: Path, stem: str, suffix: str) -> Path:
    """A path in a directory that is not taken: of the stem, or with a number behind it."""
    path, number = directory / f"{stem}{suffix}", 1
    while path.exists():
        number += 1
        path = directory / f"{stem}-{number}{suffix}"
    return path
