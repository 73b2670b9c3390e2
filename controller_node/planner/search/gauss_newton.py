"""Gauss-Newton steps whose derivatives come from samples.

With x (d,) what is looked for, r(x) (m,) the residuals to be made small and p |x|^2 what large x
cost, a step solves `(J' J + p + lambda) dx = -(J' r + p x)`. J is not known. Two estimates of it
come from samples around x:

- the ensemble's: with E (s, d) the samples' distances from x and Y (s, m) those of their residuals
  from r, both over sqrt(s), J' is E' Y^-1 in the space that the samples span. (Evensen 2009, "Data
  Assimilation: The Ensemble Kalman Filter"; Chen and Oliver 2013, "Levenberg-Marquardt forms of the
  iterative ensemble smoother");
- sensitivities A (d, m) that are remembered from plan to plan and corrected by each one's samples:
  the least change of A that explains them, by ridge regression.
"""

import math

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.compiled import linear
from msgs_config.geometry import fixed_order

_RIDGE = 20.0  # ridge, in the samples' variance, of a correction of known sensitivities
_FIRST_RIDGE = 1e-6  # ridge of the first sensitivities, for each entry of x


def ensemble_steps(
    distances: FloatArray,
    changes: FloatArray,
    residuals: FloatArray,
    dampings: tuple[float, ...],
) -> list[FloatArray]:
    """The steps (d,) of an ensemble, one for each lambda.

    Args:
        distances: Of the samples (s, d) from where the steps begin.
        changes: Of the samples' residuals (s, m), with those of large x among them.
        residuals: Where the steps begin (m,), likewise.
        dampings: lambda.
    """
    root = math.sqrt(len(distances))
    scaled, across = changes / root, _transposed(distances) / root
    slopes = linear.times(scaled, residuals)[:, np.newaxis]
    products = linear.gram(scaled)
    return [
        -linear.times(across, linear.solve(products, damping, slopes)[:, 0].copy())
        for damping in dampings
    ]


def corrected_sensitivities(
    known: FloatArray | None, distances: FloatArray, changes: FloatArray
) -> FloatArray:
    """Sensitivities (d, m) after samples: distances (s, d) and their residuals' changes (s, m).

    Without known ones they are those of the samples alone.
    """
    moved = distances - fixed_order.mean(distances, axis=0)
    new = changes - fixed_order.mean(changes, axis=0)
    ridge = _FIRST_RIDGE * distances.shape[1]
    if known is not None:
        new -= linear.product(moved, known)
        ridge = _RIDGE
    shares = linear.solve(linear.gram(moved), ridge, new)
    correction = linear.product(_transposed(moved), shares)
    return correction if known is None else known + correction


def sensitivity_steps(
    sensitivities: FloatArray,
    residuals: FloatArray,
    place: FloatArray,
    penalty: float,
    dampings: tuple[float, ...],
) -> list[FloatArray]:
    """The steps (d,) of sensitivities (d, m), one for each lambda.

    Args:
        sensitivities: A.
        residuals: Where the steps begin (m,).
        place: x (d,) there.
        penalty: p, what large x cost.
        dampings: lambda.
    """
    slopes = (linear.times(sensitivities, residuals) + penalty * place)[:, np.newaxis]
    products = linear.gram(sensitivities)
    return [-linear.solve(products, penalty + damping, slopes)[:, 0] for damping in dampings]


def _transposed(matrix: FloatArray) -> FloatArray:
    return np.ascontiguousarray(matrix.T)
