"""Which of the moments of a series are nearest to others."""

import numpy as np

from msgs_config.arrays import FloatArray, IntArray

_EQUAL_DISTANCES = 1e-9  # s: two distances are as good as equal


def nearest_rows(times: FloatArray, wanted: FloatArray) -> IntArray:
    """The states (p,) nearest to these times (p,) in s, of two that are as near the earlier one.

    `times` are those of the states (t + 1,), in order.
    """
    after = np.searchsorted(times, wanted - _EQUAL_DISTANCES).clip(1, max(len(times) - 1, 1))
    if len(times) == 1:
        return np.zeros_like(after)
    before = after - 1
    nearer = wanted - times[before] <= times[after] - wanted + _EQUAL_DISTANCES
    rows: IntArray = np.where(nearer, before, after)
    return rows
