"""Layers of a picture, one over the other, and the shadow on the ground. No engine.

Layers are drawn with several samples along each edge of a pixel, of which the picture has the
mean; what the samples leave free shows what is below.
"""

from typing import NamedTuple

import numpy as np

from actuated_characters.render.engine import ground
from actuated_characters.render.engine.camera_pose import Box, CameraPose
from actuated_characters.render.engine.ground import Samples
from msgs_config.arrays import BoolArray


class Drawing(NamedTuple):
    """A part of a picture as it is drawn, one sample a pixel."""

    color: Samples  # (h, w, 3): red, green, blue, 0 to 255
    depth: Samples  # (h, w): distance from the camera along its axis, m; infinite: nothing
    is_link: BoolArray  # (h, w): whether it is a link's


class Layer(NamedTuple):
    """Samples that are laid over a part of a picture."""

    paint: Samples  # (h, w, 3): colours, 0 to 255, times the share that they cover
    clear: Samples  # (h, w): the share of what is below that shines through


def solid(drawing: Drawing, ground_depth: Samples, view: CameraPose) -> Layer:
    """What was drawn, wherever it is nearer than the ground in its row (h,), m."""
    seen = drawing.depth < ground_depth[:, np.newaxis]
    paint = np.where(seen[:, :, np.newaxis], drawing.color, np.float32(0.0))
    share = ground.haze(drawing.depth / np.float32(view.distance))
    if share.max(initial=0.0, where=seen) > 0.0:
        paint += (seen * share)[:, :, np.newaxis] * (ground.BACKGROUND - paint)
    return Layer(paint, (~seen).astype(np.float32))


def transparent(drawing: Drawing, before: Samples, opacity: float, behind: float = 0.0) -> Layer:
    """What was drawn, blended in.

    Args:
        drawing: What was drawn.
        before: How near (h, w) what hides it is, m.
        opacity: Where nothing hides it.
        behind: Its opacity elsewhere.
    """
    seen, hidden = drawing.depth < before, np.isfinite(drawing.depth)
    share = np.where(seen, opacity, behind * hidden).astype(np.float32)
    return Layer(share[:, :, np.newaxis] * drawing.color, 1.0 - share)


def nearest(drawing: Drawing, drawn: Box, ground_depth: Samples, box: Box) -> Samples:
    """The nearest (h, w) of what was drawn in one part of a picture, and of the ground, in another.

    `ground_depth` (h, 1) is that of the rows of `box`, m.
    """
    width, height = box.size
    depth = np.broadcast_to(ground_depth, (height, width)).copy()
    both = Box(
        max(drawn.top, box.top),
        min(drawn.bottom, box.bottom),
        max(drawn.left, box.left),
        min(drawn.right, box.right),
    )
    if both:
        there = both.within(box)
        own = drawing.depth[both.within(drawn)]
        depth[there] = np.minimum(depth[there], own)
    return depth


def lay(picture: Samples, box: Box, layer: Layer, samples: int) -> None:
    """Lay a layer over a part of a picture (h, w, 3), in place."""
    clear = shrunk(layer.clear, samples)[:, :, np.newaxis]
    below = picture[box.rows, box.columns]
    picture[box.rows, box.columns] = shrunk(layer.paint, samples) + clear * below


def shrunk(fine: Samples, samples: int) -> Samples:
    """The mean (h, w, ...) of each square of so many samples an edge."""
    if samples == 1:
        return fine
    total = fine[::samples, ::samples].copy()
    for number in range(1, samples**2):
        row, column = divmod(number, samples)
        total += fine[row::samples, column::samples]
    mean: Samples = total * np.float32(1.0 / samples**2)
    return mean


def shadow_box(light: CameraPose, view: CameraPose, size: tuple[int, int]) -> Box:
    """The part of a view's picture where what is seen from the light can darken the ground."""
    edges = np.array((0.0, 1.0))
    x, y = ground.places(light, (1, 1), edges, edges)
    corners = np.column_stack((x.ravel(), y.ravel(), np.zeros(4)))
    return view.box(corners, np.zeros(4), size)


def shadow(
    dark: BoolArray, light: CameraPose, view: CameraPose, size: tuple[int, int], box: Box
) -> Samples:
    """Where (h, w) in a part of a view's picture the ground has no light: 1, elsewhere 0.

    Args:
        dark: What is seen from the light of all that casts a shadow.
        light: From where.
        view: Where the ground is looked at from.
        size: Width and height of the whole picture.
        box: The part.
    """
    rows = np.arange(box.top + 0.5, box.bottom)
    columns = np.arange(box.left + 0.5, box.right)
    x, y = ground.places(view, size, rows, columns)
    height, width = dark.shape
    there = np.isfinite(x) & np.isfinite(y)
    points = np.stack([np.where(there, axis, 0.0).ravel() for axis in (x, y, np.zeros_like(x))])
    row, column = light.pixels(points, (width, height)).reshape(2, *x.shape)
    there &= (row >= 0) & (row < height) & (column >= 0) & (column < width)
    shadow: Samples = (there & dark[row * there, column * there]).astype(np.float32)
    return shadow
