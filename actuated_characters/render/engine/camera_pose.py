"""A pinhole camera: where it stands, what it sees, and how to place it."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import atan, ceil, cos, floor, sin, tan
from typing import NamedTuple, TypeAlias

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Vector
from msgs_config.geometry import fixed_order

_MARGIN = 0.05  # share of the extent of what is seen that stays free around it

Size: TypeAlias = tuple[int, int]
"""Width and height of a picture in pixels."""


class Spheres(NamedTuple):
    """Spheres whose hull holds what is to be seen."""

    centres: FloatArray  # (m, 3), m
    radii: FloatArray  # (m,), m

    @classmethod
    def joined(cls, several: Iterable["Spheres"]) -> "Spheres":
        """All spheres of several."""
        centres, radii = zip(*several, strict=True)
        return cls(np.concatenate(centres), np.concatenate(radii))

    def moved(self, offset: FloatArray | Vector) -> "Spheres":
        """The same spheres, moved by an offset (3,) in m."""
        return Spheres(self.centres + offset, self.radii)

    def bounds(self, axes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The lowest and the highest coordinates (3,) along unit vectors (3, 3), by row."""
        along, reach = fixed_order.apply(axes, self.centres), self.radii[:, np.newaxis]
        return (along - reach).min(axis=0), (along + reach).max(axis=0)


class PixelRegion(NamedTuple):
    """A part of a picture, in pixels from its upper left corner; false if it is empty."""

    top: int
    bottom: int
    left: int
    right: int

    @property
    def part(self) -> tuple[slice, slice]:
        """Its rows and columns."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    def times(self, factor: int) -> "PixelRegion":
        """The same part of a picture with so many times as many pixels along each edge."""
        return PixelRegion(*(factor * edge for edge in self))

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

    def pixel(self, height: int) -> float:
        """Edge of a pixel per distance along the camera's axis, in a picture of a height."""
        return 2.0 * tan(0.5 * self.field_of_view) / height

    def box(self, seen: Spheres, size: Size) -> PixelRegion:
        """The part of a picture in which spheres are seen, with half a pixel around them.

        It is all of it where one is at the camera, and empty if there is none.
        """
        width, height = size
        if not len(seen.radii):
            return PixelRegion(0, 0, 0, 0)
        in_axes = fixed_order.apply(self.axes(), seen.centres - self.eye()).T
        nearest, farthest = -in_axes[2] - seen.radii, -in_axes[2] + seen.radii
        if nearest.min() <= 0.0:
            return PixelRegion(0, height, 0, width)
        sides = np.array([in_axes[:2] - seen.radii, in_axes[:2] + seen.radii]) / self.pixel(height)
        reach = np.concatenate((sides / nearest, sides / farthest))  # (4, 2, m), in pixels
        (left, low), (right, high) = reach.min(axis=(0, 2)) - 0.5, reach.max(axis=(0, 2)) + 0.5
        return PixelRegion(
            min(max(floor(0.5 * height - high), 0), height),
            min(max(ceil(0.5 * height - low), 0), height),
            min(max(floor(0.5 * width + left), 0), width),
            min(max(ceil(0.5 * width + right), 0), width),
        )

    def moved(self, x: float, y: float) -> "CameraPose":
        """The same view of a place that is so many m further on in the world."""
        here_x, here_y, here_z = self.target
        return replace(self, target=(here_x + x, here_y + y, here_z))


def framing(seen: Spheres, aspect: float, like: CameraPose) -> CameraPose:
    """The nearest view in which spheres lie in the middle of the picture, whole, with a margin.

    A sphere at (x, y, z) of the camera's axes, seen from the distance d, is clear of the picture's
    edge at half an angle a of view if `(d - z) sin a - |x| cos a >= r`.

    Args:
        seen: The spheres, in the world.
        aspect: Width of the picture over its height.
        like: Has the directions and the angle.
    """
    axes = like.axes()
    lowest, highest = seen.bounds(axes)
    margin = _MARGIN * float((highest - lowest).max())
    middle = 0.5 * (lowest + highest)
    half_height = 0.5 * like.field_of_view
    half_width = atan(aspect * tan(half_height))
    from_middle = fixed_order.apply(axes, seen.centres) - middle
    across, along = np.abs(from_middle)[:, :2], from_middle[:, 2]
    needed = [
        along + (across[:, side] * cos(half) + seen.radii + margin) / sin(half)
        for side, half in enumerate((half_width, half_height))
    ]
    x, y, z = fixed_order.apply(axes.T, middle).tolist()
    return replace(like, target=(x, y, z), distance=float(np.max(needed)))


def extents(seen: Spheres, like: CameraPose) -> FloatArray:
    """How much (3,) of a view's axes spheres take up, m: across, upwards, towards the camera."""
    lowest, highest = seen.bounds(like.axes())
    extent: FloatArray = highest - lowest
    return extent


def natural_aspect(seen: Spheres, like: CameraPose) -> float:
    """Width over height of what spheres fill of a picture, with its margin, seen from far away."""
    extent = extents(seen, like)
    width, height = (extent[:2] + 2.0 * _MARGIN * extent.max()).tolist()
    return float(width / height)
