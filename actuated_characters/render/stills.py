"""Pictures of a recorded run, or of any poses: single ones and strips of several."""

from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.image import imsave

from actuated_characters.bags.recording import Recording
from actuated_characters.render.captions import captioned
from actuated_characters.render.engine.render_scene import Size
from actuated_characters.render.engine.renderer import Picture, Renderer
from actuated_characters.render.scene import make_scene, nearest_rows
from actuated_characters.whole_files import write_whole
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, RecordingError
from sim_node.physics.world import WorldSettings

SMALLEST, LARGEST = 16, 4096  # pixels along an edge of a picture

_MOST_PIXELS = 2**26  # of a strip
_TILE_HEIGHT = 400  # pixels, where nothing else is said
_NARROWEST, _WIDEST = 0.5, 1.6  # width over height, where nothing else is said
_COLUMNS = 8  # at the most, where nothing else is said
_GAP = 3  # pixels between pictures
_WHITE = 255

Progress = Callable[[int], None]
"""Is told the number of pictures so far."""


def strip(
    recording: Recording | Sequence[Recording],
    times: Sequence[float] | int = 8,
    *,
    columns: int | None = None,
    ghost: bool = False,
    labels: bool = True,
    size: Size | None = None,
    progress: Progress | None = None,
) -> Picture:
    """Pictures of a run side by side, all of one scale; each follows the root along the ground.

    Args:
        recording: The run, or those of several characters of one world.
        times: When, s since the first state; or how many pictures, evenly from first to last.
        columns: Pictures in a row.
        ghost: Draw the reference, too, transparent, wherever there is one.
        labels: Write the time above each picture.
        size: Width and height of each picture in pixels.
        progress: Is called after each picture.

    Raises:
        ConfigurationError: the recording does not reach to a time, or a size is not sensible.
        RecordingError: a ghost is asked for, and there is no reference; or the recordings are of
            several worlds.
    """
    scene = make_scene([recording] if isinstance(recording, Recording) else recording)
    rows = _rows(scene.times, times)
    if ghost and not scene.has_reference:
        raise RecordingError("the recording has no reference to draw")
    return pose_strip(
        scene.characters,
        scene.position[rows],
        [f"{time:.2f} s" for time in scene.times[rows]] if labels else None,
        ghosts=scene.reference[rows] if ghost else None,
        balls=[scene.balls(row) for row in rows.tolist()],
        columns=columns,
        size=size,
        world=WorldSettings(ground=scene.ground, terrain=scene.terrain),
        progress=progress,
    )


def pose_strip(
    character: Character | Sequence[Character],
    positions: FloatArray,
    captions: Sequence[str] | None = None,
    *,
    ghosts: FloatArray | None = None,
    balls: Sequence[FloatArray] | None = None,
    columns: int | None = None,
    size: Size | None = None,
    world: WorldSettings | None = None,
    progress: Progress | None = None,
) -> Picture:
    """Pictures (h, w, 3) of a character side by side, all of one scale.

    Args:
        character: The character, or several; then positions are theirs one after the other.
        positions: Where it is in each picture (p, n), message form.
        captions: What stands above each picture (p,).
        ghosts: Where its transparent copy is in each picture (p, n); NaN draws none.
        balls: Centres and radii (m, 4) of the balls in each picture (p,), m in the world.
        columns: Pictures in a row; by default all, up to 8.
        size: Width and height of each picture in pixels; by default as suits the poses.
        world: Says what there is besides; by default the plane z = 0.
        progress: Is called after each picture.

    Raises:
        ConfigurationError: there are no positions, or a size is not sensible.
        CharacterError: a file of the character cannot be used.
    """
    positions = np.atleast_2d(positions)
    count = len(positions)
    if not count or (columns is not None and columns < 1):
        raise ConfigurationError(f"{count} pictures in rows of {columns}; both must be 1 or more")
    if captions is not None and len(captions) != count:
        raise ConfigurationError(f"{len(captions)} captions for {count} pictures")
    world = world or WorldSettings()
    with Renderer(character, ground=world.ground, terrain=world.terrain) as camera:
        no_ghosts = np.full_like(positions, np.nan)
        ghosts = no_ghosts if ghosts is None else np.atleast_2d(ghosts)
        is_known = np.isfinite(ghosts)
        has_ghost: BoolArray = np.logical_or.reduce(is_known, axis=1)
        seen = np.concatenate((positions, ghosts[np.logical_and.reduce(is_known, axis=1)]))
        size = _natural_size(camera, seen) if size is None else size
        check_size(size, count)
        view = camera.view(seen, size=size)
        tiles = []
        for row, position in enumerate(positions):
            picture = camera.picture(
                position,
                ghost=ghosts[row] if has_ghost[row] else None,
                balls=np.zeros((0, 4)) if balls is None else balls[row],
                view=camera.followed(view, positions[0], position),
                size=size,
            )
            tiles.append(picture if captions is None else captioned(picture, captions[row]))
            if progress is not None:
                progress(row + 1)
    return _side_by_side(tiles, columns or min(count, _COLUMNS))


def save_png(picture: Picture, path: Path) -> None:
    """Write a picture (h, w, 3) as a PNG file, whole or not at all.

    Raises:
        RecordingError: the file cannot be written.
    """
    content = BytesIO()
    imsave(content, picture, format="png")
    write_whole(path, content.getvalue())


def _rows(known: FloatArray, times: Sequence[float] | int) -> IntArray:
    """The states (p,) that are nearest to times in s, or evenly from the first to the last."""
    end = float(known[-1])
    if isinstance(times, int):
        if times < 1:
            raise ConfigurationError(f"{times} pictures; it must be 1 or more")
        wanted = np.linspace(0.0, end, times)
    else:
        wanted = np.array(times, dtype=float)
    for time in wanted.tolist():
        if not 0.0 <= time <= end:
            raise ConfigurationError(f"time {time:g} s is not in the recording: 0 to {end:g} s")
    return nearest_rows(known, wanted)


def _natural_size(camera: Renderer, positions: FloatArray) -> Size:
    aspect = min(max(camera.aspect(positions), _NARROWEST), _WIDEST)
    return round(aspect * _TILE_HEIGHT), _TILE_HEIGHT


def check_size(size: Size, count: int) -> None:
    """Check the size of so many pictures; raises ConfigurationError if it is not sensible."""
    width, height = size
    if not all(SMALLEST <= edge <= LARGEST for edge in size):
        raise ConfigurationError(
            f"size {width}x{height} is not sensible; "
            f"it must be {SMALLEST}x{SMALLEST} to {LARGEST}x{LARGEST} pixels"
        )
    if count * width * height > _MOST_PIXELS:
        raise ConfigurationError(
            f"{count} pictures of {width}x{height} have more than {_MOST_PIXELS >> 20} million "
            "pixels in all; take fewer or smaller ones"
        )


def _side_by_side(tiles: Sequence[Picture], columns: int) -> Picture:
    """Pictures of one size in rows, white between them and where there is none."""
    height, width, _ = tiles[0].shape
    columns = min(columns, len(tiles))
    rows = -(-len(tiles) // columns)
    shape = (rows * (height + _GAP) - _GAP, columns * (width + _GAP) - _GAP, 3)
    whole = np.full(shape, _WHITE, dtype=np.uint8)
    for number, tile in enumerate(tiles):
        row, column = divmod(number, columns)
        top, left = row * (height + _GAP), column * (width + _GAP)
        whole[top : top + height, left : left + width] = tile
    return whole
