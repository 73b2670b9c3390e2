"""Identifies how a motion's deviations go on from window to window, from runs with random offsets.

About the motion the deviations at a window's end are nearly linear in those at its beginning and
in the offset that is held in between; each window of a cycle has a model of its own. Ridge
regression also says how uncertain the model is, and how much remains that it does not explain.

Source: Bishop 2006, "Pattern Recognition and Machine Learning", section 3.3 (Bayesian linear
regression).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.errors import RunError

_RIDGE = 3.0  # against numbers that spread by about 1
_LEAST_SPREAD = 1e-6


@dataclass(frozen=True)
class Transitions:
    """Windows that were simulated, a row each."""

    phases: IntArray  # (t,) which window of a cycle
    before: FloatArray  # (t, f) deviations at its beginning
    offsets: FloatArray  # (t, m) held in it, rad
    after: FloatArray  # (t, f) deviations at its end

    @classmethod
    def joined(cls, parts: Sequence["Transitions"]) -> "Transitions":
        """All of them, in order."""
        return cls(
            np.concatenate([part.phases for part in parts]),
            np.vstack([part.before for part in parts]),
            np.vstack([part.offsets for part in parts]),
            np.vstack([part.after for part in parts]),
        )

    def __len__(self) -> int:
        return len(self.phases)

    def last(self, count: int) -> "Transitions":
        """The last so many of them."""
        return Transitions(
            self.phases[-count:], self.before[-count:], self.offsets[-count:], self.after[-count:]
        )


@dataclass(frozen=True)
class WindowModel:
    """`s' = matrix (s, u, 1)`, in units of the spreads of s and of u's largest values."""

    matrix: FloatArray  # (f, f + m + 1)
    covariance: FloatArray  # (f + m + 1, f + m + 1) of a row of the matrix, a unit of residual
    residual: FloatArray  # (f, f) covariance of what the model does not explain


@dataclass(frozen=True)
class CycleModel:
    """The models of a cycle's windows, and their units."""

    windows: tuple[WindowModel, ...]
    spreads: FloatArray  # (f,) of the deviations
    largest: FloatArray  # (m,) of the offsets, rad


def identified(transitions: Transitions, largest: FloatArray, windows: int) -> CycleModel:
    """The models of a cycle of so many windows; `largest` (m,) are the offsets' units in rad.

    Raises:
        RunError: there is not a single transition.
    """
    if not len(transitions):
        raise RunError("nothing can be fitted: each run falls in its first two windows")
    spreads = transitions.before.std(axis=0) + _LEAST_SPREAD
    models = []
    for phase in range(windows):
        rows = transitions.phases == phase
        before = transitions.before[rows] / spreads
        offsets = transitions.offsets[rows] / largest
        inputs = np.hstack((before, offsets, np.ones((len(before), 1))))
        models.append(_regression(inputs, transitions.after[rows] / spreads))
    return CycleModel(tuple(models), spreads, largest)


def _regression(inputs: FloatArray, outputs: FloatArray) -> WindowModel:
    """Ridge regression of outputs (t, f) on inputs (t, i), the last of which is 1."""
    ridge = np.full(inputs.shape[1], _RIDGE)
    ridge[-1] = 1e-3  # the constant is not shrunk
    precision = inputs.T @ inputs + np.diag(ridge)
    covariance: FloatArray = np.asarray(np.linalg.inv(precision), dtype=np.float64)
    matrix = (covariance @ (inputs.T @ outputs)).T
    errors = outputs - inputs @ matrix.T
    known = float(np.trace(covariance @ (inputs.T @ inputs)))  # parameters that the data settle
    freedom = max(len(inputs) - known, 0.2 * len(inputs))
    known_a_little = np.eye(errors.shape[1])  # what was never seen is in doubt by a whole spread
    residual: FloatArray = (errors.T @ errors + known_a_little) / (freedom + 1.0)
    return WindowModel(matrix, covariance, residual)
