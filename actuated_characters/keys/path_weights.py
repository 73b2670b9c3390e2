"""The smooth path through keys of plain numbers, and how much each key counts in it."""

import numpy as np

from controller_node.references.curve import QUINTIC
from msgs_config.arrays import FloatArray
from msgs_config.geometry import fixed_order


def path_values(keys: FloatArray, states: FloatArray, times: FloatArray) -> FloatArray:
    """Values (m, n) at m times of the path through keys that have states (p, 3, n).

    The path is that of `controller_node.references.curve.smooth_knots` with these rates, which is
    linear in the states.

    Args:
        keys: Times (p,) of two keys or more, rising, in s.
        states: Of each key the value, of any unit, its rate a second, and the rate of that.
        times: Times (m,) in s, from the first key to the last.
    """
    values, rates, accelerations = states[:, 0], states[:, 1], states[:, 2]
    durations = np.diff(keys)
    segments = np.searchsorted(keys, times, side="right").clip(1, len(durations)) - 1
    lasts = durations[segments]
    u = ((times - keys[segments]) / lasts).clip(0.0, 1.0)
    shares = fixed_order.powers(u, len(QUINTIC) + 1)[:, 1:] @ QUINTIC  # of the end, and of rates
    factors = np.array((np.ones_like(lasts), lasts, lasts, lasts * lasts, lasts * lasts))
    end, first_rate, last_rate, first_second_rate, last_second_rate = (shares.T * factors)[
        ..., np.newaxis
    ]
    path: FloatArray = (
        (1.0 - end) * values[segments]
        + end * values[segments + 1]
        + first_rate * rates[segments]
        + last_rate * rates[segments + 1]
        + first_second_rate * accelerations[segments]
        + last_second_rate * accelerations[segments + 1]
    )
    return path


def path_weights(keys: FloatArray, times: FloatArray) -> FloatArray:
    """Weights (m, 3 p) of the states of p keys, in turn, in the path at m times in s."""
    size = 3 * len(keys)
    return path_values(keys, np.eye(size).reshape(-1, 3, size), times)
