"""Rotations as matrices, apart from the product's own quaternions."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def matrices(q: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of quaternions xyzw (..., 4)."""
    x, y, z, w = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def about(axis: int, angle: float | Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of turns about an axis by angles in rad."""
    angle = np.asarray(angle, dtype=float)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn = np.zeros((*angle.shape, 3, 3))
    turn[..., axis, axis] = 1.0
    turn[..., i, i] = turn[..., j, j] = np.cos(angle)
    turn[..., j, i], turn[..., i, j] = np.sin(angle), -np.sin(angle)
    return turn


def half_way(a: Floats, b: Floats, share: float) -> Floats:
    """Rotations (f, 3, 3) a share of the way from a to b."""
    between = np.swapaxes(a, -1, -2) @ b
    angle = np.arccos(np.clip((np.trace(between, axis1=-2, axis2=-1) - 1.0) / 2.0, -1.0, 1.0))
    skew = between - np.swapaxes(between, -1, -2)
    axis = np.stack((skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]), axis=-1)
    axis /= np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-12)
    k = np.zeros_like(between)
    k[..., 2, 1], k[..., 0, 2], k[..., 1, 0] = axis[..., 0], axis[..., 1], axis[..., 2]
    k -= np.swapaxes(k, -1, -2)
    part = (share * angle)[..., None, None]
    return a @ (np.eye(3) + np.sin(part) * k + (1.0 - np.cos(part)) * (k @ k))


def euler(turns: Floats, order: str) -> Floats:
    """Angles (f, 3) in rad whose turns about the axes of an order are the given ones."""
    i, j, k = ("XYZ".index(axis) for axis in order)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    b = np.arcsin(np.clip(sign * turns[:, i, k], -1.0, 1.0))
    a = np.arctan2(-sign * turns[:, j, k], turns[:, k, k])
    c = np.arctan2(-sign * turns[:, i, j], turns[:, i, i])
    return np.stack((a, b, c), axis=-1)
