"""Limits of efforts, prepared for the many efforts that are far below them."""

import math

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout

_MAX_RATIO = math.sqrt(3.0)  # largest length of a vector of three entries over its largest entry
_EPSILON = 1e-9


class EffortLimits:
    """Limits `values` (b,) of the length of each physical vector of a layout, N m or N."""

    def __init__(self, layout: JointLayout, values: FloatArray) -> None:
        """Prepare limits (b,), which must not change any more."""
        self.values = values
        self._layout = layout
        # (n,) sizes: where no entry is larger, no vector is too long.
        self._harmless = np.repeat(values, layout.vector_lengths) * ((1 - _EPSILON) / _MAX_RATIO)

    def clipped(self, effort: FloatArray) -> FloatArray:
        """The effort (n,) as `JointLayout.clipped` has it; the same object if it is within."""
        if not np.count_nonzero(np.abs(effort) > self._harmless):
            return effort
        return self._layout.clipped(effort, self.values)
