"""The smooth path through keys of plain numbers, and how much each key counts in it."""

import numpy as np

from controller_node.references.curve import QUINTIC
from msgs_config.arrays import FloatArray
from msgs_config.geometry import fixed_order


def path_values(keys: FloatArray, values: FloatArray, times: FloatArray) -> FloatArray:
    """Values (m, n) at m times of the path through keys that have values (p, n).

    The path is that of `controller_node.references.keyframes.curve_through`, which is linear in the
    values at its keys: at rest at both ends, elsewhere as the parabola through three keys moves.

    Args:
        keys: Times (p,) of two keys or more, rising, in s.
        values: Of each key, of any unit.
        times: Times (m,) in s, from the first key to the last.
    """
    durations = keys[1:] - keys[:-1]
    slopes = (values[1:] - values[:-1]) / durations[:, np.newaxis]
    before, after = durations[:-1, np.newaxis], durations[1:, np.newaxis]
    velocities, accelerations = np.zeros((2, *values.shape))  # at rest at both ends
    velocities[1:-1] = (slopes[:-1] * after + slopes[1:] * before) / (before + after)
    accelerations[1:-1] = 2.0 * (slopes[1:] - slopes[:-1]) / (before + after)
    segments = np.searchsorted(keys, times, side="right").clip(1, len(durations)) - 1
    lasts = durations[segments]
    u = ((times - keys[segments]) / lasts).clip(0.0, 1.0)
    shares = fixed_order.powers(u, len(QUINTIC) + 1)[:, 1:] @ QUINTIC  # of the end, and of rates
    factors = np.array((np.ones_like(lasts), lasts, lasts, lasts * lasts, lasts * lasts))
    end, first_velocity, last_velocity, first_rate, last_rate = (shares.T * factors)[
        ..., np.newaxis
    ]
    path: FloatArray = (
        (1.0 - end) * values[segments]
        + end * values[segments + 1]
        + first_velocity * velocities[segments]
        + last_velocity * velocities[segments + 1]
        + first_rate * accelerations[segments]
        + last_rate * accelerations[segments + 1]
    )
    return path


def path_weights(keys: FloatArray, times: FloatArray) -> FloatArray:
    """Weights (m, p) of the values at p keys in the path's values at m times in s."""
    return path_values(keys, np.eye(len(keys)), times)
