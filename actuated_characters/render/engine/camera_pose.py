"""Where a camera stands and what it sees: a pinhole camera, and how to place it. No engine."""

from dataclasses import dataclass, replace
from math import atan, ceil, cos, floor, sin, tan
from typing import NamedTuple

import numpy as np

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.model import Vector

_MARGIN = 0.05  # of the outline's extent, that stays free around it


class Box(NamedTuple):
    """A part of a picture, in pixels from its upper left corner; empty where an end is a begin."""

    top: int
    bottom: int
    left: int
    right: int

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.right - self.left, self.bottom - self.top

    @property
    def rows(self) -> slice:
        """The picture's rows."""
        return slice(self.top, self.bottom)

    @property
    def columns(self) -> slice:
        """The picture's columns."""
        return slice(self.left, self.right)

    def within(self, whole: "Box") -> tuple[slice, slice]:
        """Its rows and columns in an array that has those of a part that contains it."""
        return (
            slice(self.top - whole.top, self.bottom - whole.top),
            slice(self.left - whole.left, self.right - whole.left),
        )

    def times(self, factor: int) -> "Box":
        """The same part of a picture with so many times as many pixels along each edge."""
        return Box(*(factor * edge for edge in self))

    def __bool__(self) -> bool:
        return self.right > self.left and self.bottom > self.top


@dataclass(frozen=True)
class CameraPose:
    """A pinhole camera that looks at a point, its picture upright in the z-up world.

    At yaw and pitch 0 it looks along +y, so that +x leads to the right. A yaw turns it about z, to
    the side where +x is; a pitch lifts it.
    """

    target: Vector = (0.0, 0.0, 0.0)  # m, world: what is in the middle of the picture
    distance: float = 3.0  # m, of the camera from the target
    yaw: float = 0.45  # rad
    pitch: float = 0.2  # rad, above the horizon, less than pi/2
    field_of_view: float = 0.5  # rad, from the picture's upper edge to its lower one

    def axes(self) -> FloatArray:
        """Unit vectors (3, 3) in the world, by row: right, up, and from target to camera."""
        c, s = cos(self.yaw), sin(self.yaw)
        level, lift = cos(self.pitch), sin(self.pitch)
        return np.array([(c, s, 0.0), (-s * lift, c * lift, level), (s * level, -c * level, lift)])

    def eye(self) -> FloatArray:
        """Where the camera is (3,), m, world."""
        position: FloatArray = np.array(self.target) + self.distance * self.axes()[2]
        return position

    def points(self, pixels: IntArray, depth: FloatArray, size: tuple[int, int]) -> FloatArray:
        """What is seen at pixels (2, m): (3, m) in m, world.

        Rows and columns of a picture of this width and height; how far away it is along the
        camera's axis (m,), in m.
        """
        width, height = size
        metres = 2.0 * tan(0.5 * self.field_of_view) / height * depth  # a pixel is as large there
        across = metres * (pixels[1] + 0.5 - 0.5 * width)
        upwards = metres * (0.5 * height - 0.5 - pixels[0])
        in_axes = np.array((across, upwards, -depth))
        points: FloatArray = self.eye()[:, np.newaxis] + self.axes().T @ in_axes
        return points

    def pixels(self, points: FloatArray, size: tuple[int, int]) -> IntArray:
        """Row and column (2, m), maybe outside, at which points (3, m) are seen; m, world."""
        width, height = size
        across, upwards, back = self.axes() @ (points - self.eye()[:, np.newaxis])
        scale = -0.5 * height / tan(0.5 * self.field_of_view) / back
        rows, columns = 0.5 * height - scale * upwards, 0.5 * width + scale * across
        return np.floor((rows, columns)).astype(np.intp)

    def box(self, points: FloatArray, radii: FloatArray, size: tuple[int, int]) -> Box:
        """The part of a picture in which spheres are seen, with half a pixel around them.

        It is all of it where one is at the camera.

        Args:
            points: Centres (m, 3) in m, world.
            radii: Radii (m,) in m.
            size: Width and height of the picture.
        """
        width, height = size
        across, upwards, back = self.axes() @ (points - self.eye()).T
        nearest, farthest = -back - radii, -back + radii
        if not len(points):
            return Box(0, 0, 0, 0)
        if nearest.min() <= 0.0:
            return Box(0, height, 0, width)
        scale = 0.5 * height / tan(0.5 * self.field_of_view)
        left, right = _reach(across, radii, nearest, farthest)
        low, high = _reach(upwards, radii, nearest, farthest)
        return Box(
            min(max(floor(0.5 * height - scale * high - 0.5), 0), height),
            min(max(ceil(0.5 * height - scale * low + 0.5), 0), height),
            min(max(floor(0.5 * width + scale * left - 0.5), 0), width),
            min(max(ceil(0.5 * width + scale * right + 0.5), 0), width),
        )

    def moved(self, x: float, y: float) -> "CameraPose":
        """The same view of a place that is so many m further on in the world."""
        here_x, here_y, here_z = self.target
        return replace(self, target=(here_x + x, here_y + y, here_z))


def framing(points: FloatArray, radii: FloatArray, aspect: float, like: CameraPose) -> CameraPose:
    """The nearest view in which spheres lie in the middle of the picture, whole, with a margin.

    A sphere at (x, y, z) of the camera's axes, seen from the distance d, is clear of the picture's
    edge at half an angle a of view if `(d - z) sin a - |x| cos a >= r`.

    Args:
        points: Centres (m, 3) in m, world.
        radii: Radii (m,) in m.
        aspect: Width of the picture over its height.
        like: Has the directions and the angle.
    """
    axes = like.axes()
    in_axes = points @ axes.T
    lowest, highest = _box(in_axes, radii)
    margin = _MARGIN * float((highest - lowest).max())
    middle = 0.5 * (lowest + highest)
    half_height = 0.5 * like.field_of_view
    half_width = atan(aspect * tan(half_height))
    across, along = np.abs(in_axes - middle)[:, :2], (in_axes - middle)[:, 2]
    needed = [
        along + (across[:, side] * cos(half) + radii + margin) / sin(half)
        for side, half in enumerate((half_width, half_height))
    ]
    x, y, z = (middle @ axes).tolist()
    return replace(like, target=(x, y, z), distance=float(np.max(needed)))


def extents(points: FloatArray, radii: FloatArray, like: CameraPose) -> FloatArray:
    """How much (3,) of a view's axes spheres take up, m: across, upwards, towards the camera."""
    lowest, highest = _box(points @ like.axes().T, radii)
    extent: FloatArray = highest - lowest
    return extent


def natural_aspect(points: FloatArray, radii: FloatArray, like: CameraPose) -> float:
    """Width over height of what spheres fill of a picture, with its margin, seen from far away."""
    extent = extents(points, radii, like)
    width, height = (extent[:2] + 2.0 * _MARGIN * extent.max()).tolist()
    return float(width / height)


def _reach(
    middle: FloatArray, radii: FloatArray, nearest: FloatArray, farthest: FloatArray
) -> tuple[float, float]:
    """Between which slopes spheres lie that reach from one depth to another."""
    low, high = middle - radii, middle + radii
    return (
        float(np.minimum(low / nearest, low / farthest).min()),
        float(np.maximum(high / nearest, high / farthest).max()),
    )


def _box(points: FloatArray, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The lowest and the highest coordinates (3,) of spheres."""
    reach = radii[:, np.newaxis]
    return (points - reach).min(axis=0), (points + reach).max(axis=0)
