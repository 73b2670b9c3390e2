"""Positions and velocities in message form, of those that MuJoCo has."""

from typing import NamedTuple

import numpy as np
from numba import types

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.compiled.decorator import compiled
from msgs_config.compiled.rotations import quaternion, rotation_vector

_NUMBERS = types.Array(types.float64, 1, "C")
_PLACES = types.Array(types.intp, 1, "C")
_BOTH = types.Array(types.float64, 2, "C")


class Places(NamedTuple):
    """Where MuJoCo's positions are in those of the message form."""

    quaternions: IntArray  # (k,) where each begins in MuJoCo's
    vectors: IntArray  # (k,) where their rotation vectors begin
    numbers: IntArray  # (m,) the other numbers in MuJoCo's
    entries: IntArray  # (m,) where they are


@compiled
def write_motion(
    both: FloatArray, position: FloatArray, velocity: FloatArray, places: Places
) -> None:
    """Write position and velocity (2, n), of MuJoCo's position (q,) and velocity (n,).

    Rotation vectors are in rad.
    """
    for k in range(len(places.quaternions)):
        start = places.vectors[k]
        x, y, z = rotation_vector(quaternion(position, places.quaternions[k]))
        both[0, start], both[0, start + 1], both[0, start + 2] = x, y, z
    for k in range(len(places.numbers)):
        both[0, places.entries[k]] = position[places.numbers[k]]
    both[1, :] = velocity


@compiled.of(_BOTH(_NUMBERS, _NUMBERS, _PLACES, _PLACES, _PLACES, _PLACES))
def read_motion(
    position: FloatArray,
    velocity: FloatArray,
    quaternions: IntArray,
    vectors: IntArray,
    numbers: IntArray,
    entries: IntArray,
) -> FloatArray:
    """Position and velocity (2, n): see `write_motion`; the last four are those of `Places`."""
    both = np.empty((2, len(velocity)))
    write_motion(both, position, velocity, Places(quaternions, vectors, numbers, entries))
    return both
