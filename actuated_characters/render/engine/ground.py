"""The plane z = 0 as a chequerboard: what a view sees of it, by geometry.

It always has one grid, that of the world, so that it shows how far a character has gone. Upright
pictures see one row of pixels of it in one distance along the camera's axis.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from actuated_characters.render.engine.camera_pose import CameraPose, Size
from msgs_config.arrays import FloatArray
from msgs_config.geometry import fixed_order

Samples: TypeAlias = NDArray[np.float32]
"""Colours, 0 to 255, and shares of them; single precision is enough and twice as fast."""

BACKGROUND: Samples = 255.0 * np.array((0.93, 0.95, 0.98), dtype=np.float32)

_HAZE = (1.6, 2.9)  # view distances at which the background's colour begins, and is all
COLORS: Samples = 255.0 * np.array(((0.88, 0.90, 0.92), (0.70, 0.74, 0.79)), dtype=np.float32)
_LEAST_FOOTPRINT = np.float32(1e-4)  # tiles in a pixel at least: what single precision can tell
_TILES_A_VIEW = 6  # tiles along the view's distance, or up to 2.5 times as many


def depths(view: CameraPose, height: int, rows: FloatArray) -> FloatArray:
    """How far away along the camera's axis the ground is (m,), m; infinite above the horizon.

    Args:
        view: Where from.
        height: Of the picture, in pixels.
        rows: Places in the picture (m,), in pixels from its upper edge.
    """
    _, up, back = view.axes()
    falls = float(back[2]) - view.pixel(height) * (0.5 * height - rows) * float(up[2])
    eye = float(view.eye()[2])
    with np.errstate(divide="ignore", invalid="ignore"):
        depth: FloatArray = np.where((falls > 0.0) & (eye > 0.0), eye / falls, np.inf)
    return depth


def places(
    view: CameraPose, size: Size, rows: FloatArray, columns: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """x and y (m, k) in m of the ground at rows (m,) and columns (k,), pixels from the corner.

    Where there is no ground, they are not finite.
    """
    width, height = size
    scale = view.pixel(height)
    depth = depths(view, height, rows)[:, np.newaxis]
    across = scale * (columns - 0.5 * width)
    upwards = scale * (0.5 * height - rows)[:, np.newaxis]
    right, up, back = view.axes()
    eye = view.eye()
    with np.errstate(invalid="ignore"):
        x, y = (
            eye[axis] + depth * (across * right[axis] + upwards * up[axis] - back[axis])
            for axis in (0, 1)
        )
    return x, y


def seen_places(view: CameraPose, size: Size) -> FloatArray:
    """The projective map (3, 3) of a place in the picture (column, row, 1), to one of the ground.

    It gives x and y in m, both times a third number, and that number, which is above 0 where the
    ground is seen; nowhere if the camera is not above it.
    """
    width, height = size
    right, up, back = view.axes()
    x, y, z = view.eye().tolist()
    scale = view.pixel(height)
    corner = 0.5 * scale * (height * up - width * right) - back  # the direction of the first one
    to_x, to_y, to_z = np.column_stack((scale * right, -scale * up, corner))
    if z <= 0.0:
        return np.zeros((3, 3))
    return np.array((z * to_x - x * to_z, z * to_y - y * to_z, -to_z))


def seen_from(light: CameraPose, size: Size) -> FloatArray:
    """The projective map (3, 3) of a place of the ground (x, y, 1), m, to one in a picture.

    It gives column and row, both times a third number, and that number, which is above 0 before
    the camera.
    """
    width, height = size
    axes = light.axes()
    from_eye = -fixed_order.apply(axes, light.eye())
    across, upwards, back = np.column_stack((axes[:, :2], from_eye)) / light.pixel(height)
    depth = -light.pixel(height) * back
    return np.array((0.5 * width * depth + across, 0.5 * height * depth - upwards, depth))


def colors(view: CameraPose, size: Size) -> Samples:
    """What is seen of ground and sky (h, w, 3), 0 to 255, each pixel the mean of what it covers."""
    width, height = size
    rows, columns = np.arange(0.5, height), np.arange(0.5, width)
    picture = np.empty((height, width, 3), dtype=np.float32)
    picture[:] = BACKGROUND
    share = 1.0 - haze(depths(view, height, rows) / view.distance)
    seen = share > 0.0
    if seen.any():
        dark, step = COLORS[1], COLORS[0] - COLORS[1]
        light = _share_of_light(view, size, rows[seen], columns)
        clear = share[seen, np.newaxis].astype(np.float32)
        for channel in range(3):
            own = (dark - BACKGROUND)[channel] + light * step[channel]
            picture[seen, :, channel] += clear * own
    return picture


def haze(distance: FloatArray | Samples) -> Samples:
    """The background's share of the colour at distances, in those of the view."""
    begin, end = _HAZE
    share: Samples = np.clip((distance - begin) / (end - begin), 0.0, 1.0).astype(np.float32)
    return share


def tile_length(distance: float) -> float:
    """Edge of a tile, m, seen from a distance, m: 1, 2 or 5 times a power of ten."""
    length = distance / _TILES_A_VIEW
    power = 10.0 ** np.floor(np.log10(length))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= length))


def _share_of_light(view: CameraPose, size: Size, rows: FloatArray, columns: FloatArray) -> Samples:
    """The share (m, k) of light tiles in what pixels with these centres cover.

    A pixel's footprint is taken as a rectangle along the grid: then the mean of the product of two
    square waves is the product of their means.
    """
    tile = tile_length(view.distance)
    right = view.axes()[0]
    depth = depths(view, size[1], rows)
    middles = places(view, size, rows, columns)
    ends = places(view, size, rows + 0.5, columns)  # nearer than the middles, so always there
    product = np.ones((len(rows), len(columns)), dtype=np.float32)
    for axis in (0, 1):
        middle = (middles[axis] / tile).astype(np.float32)
        along = 2.0 * np.abs((ends[axis] / tile).astype(np.float32) - middle)
        across = view.pixel(size[1]) / tile * abs(float(right[axis])) * depth
        width: Samples = np.maximum(
            along + across[:, np.newaxis].astype(np.float32), _LEAST_FOOTPRINT
        )
        product *= (_triangle_wave(middle + 0.5 * width) - _triangle_wave(middle - 0.5 * width)) / (
            width
        )
    share: Samples = 0.5 + 0.5 * product
    return share


def _triangle_wave(place: Samples) -> Samples:
    """The integral from 0 of the square wave that is 1 from 0 to 1, -1 from 1 to 2, and so on."""
    whole: Samples = np.floor(0.5 * place)
    distance: Samples = np.abs(place - 2.0 * whole - 1.0)
    return 1.0 - distance
