"""How a camera follows a root: its path along the ground, made smooth."""

import numpy as np

from msgs_config.arrays import FloatArray

_PASSES = 3  # times that means are taken of means: nearly a Gaussian, and no corner


def smoothed(path: FloatArray, reach: int) -> FloatArray:
    """The path's (t, k) low frequencies, without delay: means over rows on both sides, repeated.

    Beyond its ends the path is continued as it came, turned by half about the end: so a straight
    and even one, or one that rests, stays what it is.

    Args:
        path: The path.
        reach: How many rows before and after one count for it, at the most.
    """
    half = min(reach // _PASSES, (len(path) - 1) // _PASSES)
    if half < 1:
        return path
    pad = _PASSES * half
    before = 2.0 * path[0] - path[pad:0:-1]
    after = 2.0 * path[-1] - path[-2 : -pad - 2 : -1]
    line = np.concatenate((before, path, after)) - path[0]  # small numbers: sums stay exact
    for _ in range(_PASSES):
        sums = np.concatenate((np.zeros((1, path.shape[1])), np.cumsum(line, axis=0)))
        line = (sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1)
    result: FloatArray = line + path[0]
    return result
