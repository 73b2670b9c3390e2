"""Pictures of a recorded run, or of any poses: single ones and strips of several."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.image import imsave

from actuated_characters.bags.recording import Recording
from actuated_characters.render.captions import captioned
from actuated_characters.render.drawing import SceneSettings, draw
from actuated_characters.render.engine.camera_pose import (
    CameraPose,
    Size,
    Spheres,
    extents,
    framing,
    natural_aspect,
)
from actuated_characters.render.engine.posed_characters import PosedCharacters
from actuated_characters.render.engine.renderer import FrameSpec, Picture
from actuated_characters.render.pushed_stills import PushedStills, place_stills
from actuated_characters.render.scene import RecordedScene, make_scene, part_of
from actuated_characters.render.skin.given import GivenSkin
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.model import Character
from msgs_config.clips.nearest_rows import nearest_rows
from msgs_config.errors import ConfigurationError, RecordingError
from msgs_config.whole_files import write_whole
from sim_node.physics.settings import WorldSettings

LONGEST_ARROW = 0.4  # share of the extent of the characters
GAP = 3  # pixels between pictures

_MIN_EDGE, _MAX_EDGE = 16, 4096  # pixels along an edge of a picture
_MOST_PIXELS = 2**26  # pixels of a whole strip
_TILE_HEIGHT = 400  # pixels, by default
_MIN_ASPECT, _MAX_ASPECT = 0.5, 1.6  # width over height, by default
_COLUMNS = 8  # most columns, by default
_WHITE = 255


class _Look(NamedTuple):
    """How characters are drawn, as `Renderer` is told."""

    skinned: bool = True
    skin: GivenSkin | None = None
    color_numbers: tuple[int, ...] | None = None


_SKINNED = _Look()

Progress = Callable[[int], None]
"""Called with the number of pictures so far."""


def strip(
    recording: Recording | Sequence[Recording],
    times: Sequence[float] | int = 8,
    *,
    start: float = 0.0,
    end: float | None = None,
    columns: int | None = None,
    ghost: bool = False,
    labels: bool = True,
    size: Size | None = None,
    skinned: bool = True,
    skin: GivenSkin | None = None,
    progress: Progress | None = None,
) -> Picture:
    """Pictures of a run side by side, all of one scale; each follows the root along the ground.

    Arrows are the pushes that act then. Where one acts between two pictures, the nearest one is
    taken in its middle instead; if `times` are given, or there is none, the nearest one shows it,
    and the line above it says when it began.

    Args:
        recording: The run, or those of several characters of one world.
        times: When, s since the first state; or how many pictures, evenly from start to end but
            for those that are moved to a push.
        start: The first picture's time in s, where `times` is a number.
        end: The last one's; None is the last state's.
        columns: Pictures in a row.
        ghost: Draw the reference, too, transparent, wherever there is one.
        labels: Write the time above each picture.
        size: Width and height of each picture in pixels.
        skinned: Draw a smooth skin in place of plain shapes (`Renderer`).
        skin: A mesh from a file as that skin.
        progress: Is called after each picture.

    Raises:
        ConfigurationError: the recording does not reach to a time, or a size is not sensible.
        RecordingError: there is no reference for a ghost; or the recordings are of several worlds.
    """
    scene = make_scene([recording] if isinstance(recording, Recording) else recording)
    rows = _rows(scene, times, start, end)
    if ghost and not scene.has_reference:
        raise RecordingError("the recording has no reference to draw")
    stills = place_stills(rows, scene.push_ticks(), moves=isinstance(times, int))
    captions = _captions(scene.times, stills) if labels else [""] * len(rows)
    frames = scene.frames(stills.rows, captions, ghosts=ghost, pushes=stills.ticks())
    world = WorldSettings(ground=scene.ground, terrain=scene.terrain)
    look = _Look(skinned, skin, scene.color_numbers)
    return _draw_strip(scene.characters, world, frames, columns, size, look, progress)


def _captions(times: FloatArray, stills: PushedStills) -> list[str]:
    """When each still is, and the first of the pushes began that it shows before or after them."""
    return [
        f"{times[row]:.2f} s" + "".join(f", push {times[begin]:.2f} s" for begin, _ in others[:1])
        for row, others in zip(stills.rows.tolist(), stills.others, strict=True)
    ]


def pose_strip(
    character: Character | Sequence[Character],
    positions: FloatArray,
    captions: Sequence[str] | None = None,
    *,
    ghosts: FloatArray | None = None,
    columns: int | None = None,
    size: Size | None = None,
    world: WorldSettings | None = None,
) -> Picture:
    """Pictures (h, w, 3) of a character side by side, all of one scale.

    Args:
        character: The character, or several; then positions are theirs one after the other.
        positions: Where it is in each picture (p, n), message form.
        captions: What stands above each picture (p,).
        ghosts: Where its transparent copy is in each picture (p, n); NaN draws none.
        columns: Pictures in a row; by default all, up to 8.
        size: Width and height of each picture in pixels; by default as suits the poses.
        world: Says what there is besides; by default the plane z = 0.

    Raises:
        ConfigurationError: there are no positions, or a size is not sensible.
        CharacterError: a file of the character cannot be used.
    """
    positions = np.atleast_2d(positions)
    captions = [""] * len(positions) if captions is None else captions
    if len(captions) != len(positions):
        raise ConfigurationError(f"{len(captions)} captions for {len(positions)} pictures")
    transparent = [None] * len(positions) if ghosts is None else np.atleast_2d(ghosts)
    each = zip(positions, transparent, captions, strict=True)
    frames = [
        FrameSpec(position, ghost=ghost, caption=caption) for position, ghost, caption in each
    ]
    characters = (character,) if isinstance(character, Character) else tuple(character)
    return _draw_strip(characters, world or WorldSettings(), frames, columns, size)


def _draw_strip(
    characters: tuple[Character, ...],
    world: WorldSettings,
    frames: Sequence[FrameSpec],
    columns: int | None,
    size: Size | None,
    look: _Look = _SKINNED,
    progress: Progress | None = None,
) -> Picture:
    """The strip of some frames, which have no views yet."""
    count = len(frames)
    if not count or (columns is not None and columns < 1):
        raise ConfigurationError(f"{count} pictures in rows of {columns}; both must be 1 or more")
    size, frames = _with_views(characters, frames, size, look)
    settings = SceneSettings(characters, world.ground, world.terrain, size, captioned, *look)
    tiles: list[Picture] = []
    for picture in draw(settings, frames):
        tiles.append(picture)
        if progress is not None:
            progress(len(tiles))
    return side_by_side(tiles, columns or min(count, _COLUMNS))


def _with_views(
    characters: Sequence[Character], frames: Sequence[FrameSpec], size: Size | None, look: _Look
) -> tuple[Size, list[FrameSpec]]:
    """The pictures' size, by default one that suits the poses, and the frames with their views."""
    posed = PosedCharacters(characters, look.skin if look.skinned else None)
    like = CameraPose()
    positions = np.array([frame.position for frame in frames])
    ghosts = [f.ghost for f in frames if f.ghost is not None and np.isfinite(f.ghost).all()]
    seen = np.concatenate((positions, *(ghost[np.newaxis] for ghost in ghosts)))
    ways = posed.ways(seen)
    outline = posed.outline(seen, ways)
    longest = LONGEST_ARROW * float(extents(outline, like)[:2].max())
    tails = posed.tails(positions, ways[: len(frames)], [f.forces for f in frames], longest)
    outline = Spheres.joined((outline, tails))
    aspect = min(max(natural_aspect(outline, like), _MIN_ASPECT), _MAX_ASPECT)
    size = size or (round(aspect * _TILE_HEIGHT), _TILE_HEIGHT)
    check_size(size, len(frames))
    view = framing(outline, size[0] / size[1], like)
    return size, [
        replace(frame, view=view.moved(*way), arrow_length=longest)
        for frame, way in zip(frames, ways.tolist(), strict=False)
    ]


def save_png(picture: Picture, path: Path) -> None:
    """Write a picture (h, w, 3) as a PNG file, whole or not at all.

    Raises:
        RecordingError: the file cannot be written.
    """
    content = BytesIO()
    imsave(content, picture, format="png")
    write_whole(path, content.getvalue())


def _rows(
    scene: RecordedScene, times: Sequence[float] | int, start: float, end: float | None
) -> IntArray:
    """The states (p,) that are nearest to times in s, or evenly from a start to an end."""
    count = times if isinstance(times, int) else len(times)
    if count < 1:
        raise ConfigurationError(f"{count} pictures; it must be 1 or more")
    if isinstance(times, int):
        return nearest_rows(scene.times, np.linspace(*part_of(scene.times, start, end), times))
    last = float(scene.times[-1])
    for time in times:
        if not 0.0 <= time <= last:
            raise ConfigurationError(f"time {time:g} s is not in the recording: 0 to {last:g} s")
    return nearest_rows(scene.times, np.array(times, dtype=float))


def check_size(size: Size, count: int) -> None:
    """Check the size of so many pictures; raises ConfigurationError if it is not sensible."""
    width, height = size
    if not all(_MIN_EDGE <= edge <= _MAX_EDGE for edge in size):
        raise ConfigurationError(
            f"size {width}x{height} is not sensible; "
            f"it must be {_MIN_EDGE}x{_MIN_EDGE} to {_MAX_EDGE}x{_MAX_EDGE} pixels"
        )
    if count * width * height > _MOST_PIXELS:
        raise ConfigurationError(
            f"{count} pictures of {width}x{height} have more than {_MOST_PIXELS >> 20} million "
            "pixels in all; take fewer or smaller ones"
        )


def side_by_side(tiles: Sequence[Picture], columns: int) -> Picture:
    """Pictures of one size in rows, white between them and where there is none."""
    height, width, _ = tiles[0].shape
    columns = min(columns, len(tiles))
    rows = -(-len(tiles) // columns)
    shape = (rows * (height + GAP) - GAP, columns * (width + GAP) - GAP, 3)
    whole = np.full(shape, _WHITE, dtype=np.uint8)
    for number, tile in enumerate(tiles):
        row, column = divmod(number, columns)
        top, left = row * (height + GAP), column * (width + GAP)
        whole[top : top + height, left : left + width] = tile
    return whole
