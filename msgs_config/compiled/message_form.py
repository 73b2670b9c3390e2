"""Positions and velocities in message form, of those that MuJoCo has."""

import numpy as np
from numba import types

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.compiled.decorator import compiled
from msgs_config.compiled.rotations import quaternion, rotation_vector

_NUMBERS = types.Array(types.float64, 1, "C")
_PLACES = types.Array(types.intp, 1, "C")
_BOTH = types.Array(types.float64, 2, "C")


@compiled.of(_BOTH(_NUMBERS, _NUMBERS, _PLACES, _PLACES, _PLACES, _PLACES))
def read_motion(
    position: FloatArray,
    velocity: FloatArray,
    quaternions: IntArray,
    vectors: IntArray,
    numbers: IntArray,
    entries: IntArray,
) -> FloatArray:
    """Position and velocity (2, n), of MuJoCo's position (q,) and velocity (n,).

    Quaternions (k,) begin at these places of the position, and their rotation vectors (k,) at these
    of a position in message form, rad; the other numbers (m,) are at the entries (m,).
    """
    both = np.empty((2, len(velocity)))
    for k in range(len(quaternions)):
        start = vectors[k]
        x, y, z = rotation_vector(quaternion(position, quaternions[k]))
        both[0, start], both[0, start + 1], both[0, start + 2] = x, y, z
    for k in range(len(numbers)):
        both[0, entries[k]] = position[numbers[k]]
    both[1, :] = velocity
    return both
