"""Single pictures and their views, for tests of what is seen."""

from typing import Any

import numpy as np

from actuated_characters.render.engine.camera_pose import CameraPose, Size, framing
from actuated_characters.render.engine.renderer import FrameSpec, Picture, Renderer
from msgs_config.arrays import BoolArray, FloatArray, IntArray


def view_of(camera: Renderer, positions: FloatArray, size: Size) -> CameraPose:
    """The nearest view of a position (n,), or of the first of several (p, n), that fits all."""
    rows = np.atleast_2d(positions)
    seen = camera.posed.outline(rows, camera.posed.ways(rows))
    return framing(seen, size[0] / size[1], CameraPose())


def followed(
    camera: Renderer, view: CameraPose, start: FloatArray, position: FloatArray
) -> CameraPose:
    """The view of a position (n,) that is what another is of a start (n,)."""
    return view.moved(*camera.posed.ways(np.stack((start, position)))[1].tolist())


def take_picture(
    camera: Renderer,
    position: FloatArray,
    *,
    view: CameraPose | None = None,
    size: Size,
    **others: Any,
) -> Picture:
    """A picture (h, w, 3) at a position (n,), by default from where all of it is seen."""
    view = view or view_of(camera, position, size)
    return camera.picture(FrameSpec(position, view, **others), size)


def is_green(seen: Picture, by: int) -> BoolArray:
    """Where a picture is as green as only a ghost makes it."""
    red, green, blue = np.moveaxis(seen.astype(int), -1, 0)
    greener: BoolArray = green - np.maximum(red, blue) > by
    return greener


def pixels_of(view: CameraPose, points: FloatArray, size: Size) -> IntArray:
    """Row and column (2, m), maybe outside, at which points (3, m) are seen; m, world."""
    width, height = size
    across, upwards, back = view.axes() @ (points - view.eye()[:, np.newaxis])
    metres = -view.pixel(height) * back
    return np.floor((0.5 * height - upwards / metres, 0.5 * width + across / metres)).astype(int)


def points_at(view: CameraPose, pixels: IntArray, depth: FloatArray, size: Size) -> FloatArray:
    """What is seen at rows and columns (2, m) so far away (m,) along the axis: (3, m), m, world."""
    width, height = size
    metres = view.pixel(height) * depth
    in_axes = ((pixels[1] + 0.5 - 0.5 * width) * metres, (0.5 * height - 0.5 - pixels[0]) * metres)
    points: FloatArray = view.eye()[:, np.newaxis] + view.axes().T @ np.array((*in_axes, -depth))
    return points
