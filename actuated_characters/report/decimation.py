"""Series of any length as few enough points to draw, their extremes among them."""

import numpy as np

from msgs_config.arrays import FloatArray, IntArray


def decimated(
    times: FloatArray, values: FloatArray, most: int = 1000
) -> tuple[FloatArray, FloatArray]:
    """Times (m,) and values (m, k) that draw the same line as those of (t,) and (t, k).

    Of each of at most `most` spans of equally many rows there stay the smallest and the largest
    value of each column, both at the span's begin. NaN is drawn only where a span has nothing
    else. What is short enough stays as it is.
    """
    if len(times) <= 2 * most:
        return times, values
    starts = span_starts(len(times), most)
    low, high = np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)
    both = np.stack((low, high), axis=1).reshape(-1, *values.shape[1:])
    return np.repeat(times[starts], 2), both


def span_starts(length: int, most: int) -> IntArray:
    """First rows of at most `most` spans that so many rows are divided into."""
    count = max(min(length, most), 1)
    return np.arange(count, dtype=np.intp) * length // count


def span_maxima(values: FloatArray, most: int) -> FloatArray:
    """The largest value (m, k) of each column in each of at most `most` spans of rows (t, k)."""
    maxima: FloatArray = np.fmax.reduceat(values, span_starts(len(values), most))
    return maxima
