"""Elementary functions of arrays, each value by the C library.

numpy has other vector kernels for these functions and chooses among them by what the processor
can do (with AVX-512 it takes others than without), and their last bits differ. A result must not
depend on the processor, so whatever lies between a message and the next state takes its elementary
functions from here. `+ - * /` and `sqrt` are exact by IEEE 754, whichever kernel works them out.

Where a value is outside a function's domain the result is NaN.
"""

import math
from collections.abc import Callable

import numpy as np

from msgs_config.arrays import FloatArray


def sin(angles: FloatArray) -> FloatArray:
    """Sines (...) of angles (...) in rad."""
    return _of_each(math.sin, angles)


def cos(angles: FloatArray) -> FloatArray:
    """Cosines (...) of angles (...) in rad."""
    return _of_each(math.cos, angles)


def tan(angles: FloatArray) -> FloatArray:
    """Tangents (...) of angles (...) in rad."""
    return _of_each(math.tan, angles)


def arccos(cosines: FloatArray) -> FloatArray:
    """Angles (...) in rad, 0 to pi, of cosines (...)."""
    return _of_each(math.acos, cosines)


def arctan2(y: FloatArray, x: FloatArray) -> FloatArray:
    """Angles (...) in rad, -pi to pi, of points x, y, of one shape (...)."""
    return _of_each(math.atan2, y, x)


def _of_each(function: Callable[..., float], *arguments: FloatArray) -> FloatArray:
    """The function's values (...) at arguments of one shape (...)."""
    shape = np.shape(arguments[0])
    rows = [np.ravel(argument).tolist() for argument in arguments]
    try:
        values = np.fromiter(map(function, *rows), float, len(rows[0]))
    except ValueError:  # one is outside the domain, such as the sine of infinity
        values = np.array([_or_nan(function, *row) for row in zip(*rows, strict=True)])
    return values.reshape(shape)


def _or_nan(function: Callable[..., float], *arguments: float) -> float:
    try:
        return function(*arguments)
    except ValueError:
        return math.nan
