"""Parts of meshes that are flat, or tiny, made thick enough to have a hull."""

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.geometry import fixed_order

_FLAT = 1e-4  # m; what is thinner has no hull that MuJoCo can be trusted to find
_THICKNESS = 2e-3  # m, that of Bullet's margins on both sides of what is flat


def is_flat(points: FloatArray) -> bool:
    """Whether the points (m, 3) of a convex part, in m, are thinner than 0.1 mm anywhere."""
    return _thin_direction(points) is not None


def with_thickness(points: FloatArray) -> FloatArray:
    """The points (m, 3) of a convex part, in m; of one that is flat, a plate of 2 mm.

    Of one that is thin in two directions it is a rod, of one that is in all a cube.
    """
    while (normal := _thin_direction(points)) is not None:
        half = 0.5 * _THICKNESS * normal
        points = np.concatenate((points - half, points + half))
    return points


def _thin_direction(points: FloatArray) -> FloatArray | None:
    """A unit vector (3,) along which the points (m, 3) are all but one; None if there is none."""
    offsets = points - points[0]
    along, length = _longest(offsets)
    if length < _FLAT:
        return np.array((1.0, 0.0, 0.0))
    across, width = _longest(offsets - along * fixed_order.dot(offsets, along)[:, np.newaxis])
    if width < _FLAT:
        axis = np.zeros(3)
        axis[int(np.abs(along).argmin())] = 1.0
        normal = fixed_order.cross(along, axis)
        return normal / fixed_order.norm(normal)
    normal = fixed_order.cross(along, across)
    heights = fixed_order.dot(offsets, normal)
    return normal if heights.max() - heights.min() < _FLAT else None


def _longest(vectors: FloatArray) -> tuple[FloatArray, float]:
    """The direction (3,) and the length of the longest of vectors (m, 3); of zeros, zero."""
    lengths = fixed_order.norm(vectors)
    longest = int(lengths.argmax())
    length = float(lengths[longest])
    return vectors[longest] / (length or 1.0), length
