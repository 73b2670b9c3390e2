"""Where a camera stands at first, so that a page shows points beside its panel, and large."""

from typing import NamedTuple

import numpy as np

from msgs_config.arrays import FloatArray

EYE, LOOK_AT = (2.6, -2.6, 1.5), (0.0, 0.0, 0.8)
"""Of the camera until a character is there, m, from the point on the ground below."""

RIGHT: FloatArray = np.array((0.5**0.5, 0.5**0.5, 0.0))  # of a view from there
FIELD_OF_VIEW = np.radians(45.0)  # from the upper edge to the lower one

_HALF = np.tan(0.5 * FIELD_OF_VIEW)
# As far from the middle of a view as what is seen may reach, in its half heights; on a page of 1440
# by 900 pixels it is so beside the panel, which is at the right.
_UP, _LEFT, _RIGHT = 0.7 * _HALF, 1.45 * _HALF, 0.8 * _HALF


class Framing(NamedTuple):
    """A view in the direction of the first one."""

    distance: float  # m, of the eye from what is seen
    eye: FloatArray  # (3,) m, world
    look_at: FloatArray  # (3,) m, world: beside the middle of what is seen, if that is wide


def frame_points(corners: FloatArray) -> Framing:
    """The nearest view that has all points (k, 3), m, world."""
    near = np.subtract(EYE, LOOK_AT)
    near /= np.linalg.norm(near)
    right = np.cross((0.0, 0.0, 1.0), near)
    right /= np.linalg.norm(right)
    axes = np.stack((right, np.cross(near, right), near))
    places = corners @ axes.T
    middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
    x, y, z = (places - middle).T
    distance = max(_distance(x, z, _LEFT, _RIGHT), _distance(y, z, _UP, _UP))
    middle[0] += _shift(x, z, distance, _LEFT, _RIGHT)
    middle[1] += _shift(y, z, distance, _UP, _UP)
    look_at = middle @ axes
    return Framing(distance, look_at + distance * near, look_at)


def _distance(x: FloatArray, z: FloatArray, low: float, high: float) -> float:
    """The least from which a view has points (k,) between -low and high, wherever it looks.

    Of a view that looks at s from a distance d, a point (x, z), z nearer, is at (x - s) / (d - z).
    """
    return float(np.max(x + high * z) - np.min(x - low * z)) / (low + high)


def _shift(x: FloatArray, z: FloatArray, distance: float, low: float, high: float) -> float:
    """Where such a view looks: at the middle, as far as that has all."""
    least = float(np.max(x - high * (distance - z)))
    return min(max(0.0, least), float(np.min(x + low * (distance - z))))
