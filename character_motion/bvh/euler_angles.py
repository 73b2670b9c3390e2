"""Euler angles of turns over time that go on from frame to frame, also through gimbal lock.

A turn `R = R_i(a) R_j(b) R_k(c)` about three different axes has two triples of angles within a full
circle, (a, b, c) and (a + pi, pi - b, c + pi). Where b is a quarter turn only the sum or the
difference of a and c matters: gimbal lock (Diebel 2006, "Representing Attitude", section 5).
"""

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations

# Below this cos b the angle a is free; to hold it then errs by less than that, rad.
_GIMBAL_LOCK_COSINE = 1e-5
_FULL = 2.0 * np.pi


def euler_angles(turns_xyzw: FloatArray, order: str) -> FloatArray:
    """Angles (f, ..., 3) in rad of turns (f, ..., 4), without jumps from frame to frame.

    In every frame they are those of all that give the turn which are nearest to the frame's before;
    so they may leave a full circle. The second one begins within a quarter turn.

    Args:
        turns_xyzw: Unit quaternions.
        order: Three different axes as `"ZXY"`, for `Rz(a) Rx(b) Ry(c)`.
    """
    axes = rotations.matrix(turns_xyzw)
    i, j, k = ("XYZ".index(axis) for axis in order)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    cosine = np.hypot(axes[..., j, k], axes[..., k, k])
    first = np.arctan2(-sign * axes[..., j, k], axes[..., k, k])
    result = np.empty((*cosine.shape, 3))
    before = np.zeros((*cosine.shape[1:], 3))
    for frame, matrix in enumerate(axes):
        a = np.where(cosine[frame] < _GIMBAL_LOCK_COSINE, before[..., 0], first[frame])
        # R_j(b) R_k(c), which is what remains of the turn when a is taken off it
        sine_a, cosine_a = np.sin(a), np.cos(a)
        across = cosine_a * matrix[..., j, i] + sign * sine_a * matrix[..., k, i]
        along = cosine_a * matrix[..., j, j] + sign * sine_a * matrix[..., k, j]
        level = cosine_a * matrix[..., k, k] - sign * sine_a * matrix[..., j, k]
        b = np.arctan2(sign * matrix[..., i, k], level)
        c = np.arctan2(sign * across, along)
        angles = np.stack((a, b, c), axis=-1)
        other = np.stack((a + np.pi, np.pi - b, c + np.pi), axis=-1)
        result[frame] = before = _nearest(before, angles, other) if frame else angles
    return result


def _nearest(before: FloatArray, *triples: FloatArray) -> FloatArray:
    """Of angles (..., 3) in rad, with full turns added, those nearest to the ones before."""
    near = [each + _FULL * np.round((before - each) / _FULL) for each in triples]
    distances = [np.abs(each - before).sum(axis=-1, keepdims=True) for each in near]
    nearest: FloatArray = np.where(distances[1] < distances[0], near[1], near[0])
    return nearest
