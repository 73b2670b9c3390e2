"""Where a camera stands at first, so that a page shows points beside its panel, and large."""

from typing import NamedTuple

import numpy as np

from msgs_config.arrays import FloatArray

EYE, LOOK_AT = (2.6, -2.6, 1.5), (0.0, 0.0, 0.8)
"""Of the camera until a character is there, m, from the point on the ground below."""

FIELD_OF_VIEW = np.radians(45.0)  # from the upper edge to the lower one

_HALF = np.tan(0.5 * FIELD_OF_VIEW)
# As far from the middle of a view as what is seen may reach, in its half heights; on a page of 1440
# by 900 pixels it is so beside the panel, which is at the right.
_UP, _LEFT, _RIGHT = 0.66 * _HALF, 1.45 * _HALF, 0.8 * _HALF


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
    # each point (x, y) is seen at (x - beside, y) / (distance - z)
    by_width = (np.max(x + _RIGHT * z) - np.min(x - _LEFT * z)) / (_RIGHT + _LEFT)
    distance = float(max(by_width, np.max(z + np.abs(y) / _UP)))
    least = np.max(x - _RIGHT * (distance - z))
    most = np.min(x + _LEFT * (distance - z))
    middle[0] += min(max(0.0, least), most)
    look_at = middle @ axes
    return Framing(distance, look_at + distance * near, look_at)
