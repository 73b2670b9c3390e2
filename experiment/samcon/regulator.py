"""The window feedback of a motion whose model is in doubt: a regulator of its whole cycle.

Deviations cost their squares, and the model of each window is linear, but known from samples only.
What is not known about it adds to what is to be expected, so that an offset whose effect is in
doubt is used less. More doubt than there is, `caution`, keeps the character where the model was
seen to hold. With much of it the recursion no longer settles: what is expected grows from cycle to
cycle, and the gains are those with which it grows least, whatever deviations and offsets cost.

Sources: Bittanti, Colaneri and De Nicolao 1991, "The Periodic Riccati Equation"; De Koning 1982,
"Infinite Horizon Optimal Control of Linear Discrete Time Systems with Stochastic Parameters" (with
models in doubt; when it settles).
"""

import numpy as np

from controller_node.window_gains import WindowGains
from experiment.samcon.identification import CycleModel, WindowModel
from msgs_config.arrays import FloatArray

CAUTION = 300.0
"""Found by trying, with the walk: of 18 pushed runs of 10 s none held to the end with 5, 10 with
150, 15 with 300 and 12 with 10,000."""

_DIGITS = 5  # of gains
_CYCLES = 12  # backwards; the gains have long settled


def regulator(
    model: CycleModel, dofs: tuple[str, ...], *, caution: float = CAUTION, offset_cost: float = 1.0
) -> WindowGains:
    """The feedback of least cost for degrees of freedom (m,), whose offsets the model has.

    A deviation of one spread costs 1, a largest offset `offset_cost`; `caution` is the factor of
    the model's doubt.
    """
    moved, width = len(model.largest), len(model.spreads)
    value, slope, unit = np.eye(width), np.zeros(width), 1.0
    count = len(model.windows)
    gains = np.zeros((count, moved, width))
    constants = np.zeros((count, moved))
    for step in range(_CYCLES * count):
        phase = -1 - step % count
        doubt = caution * np.trace(value @ model.windows[phase].residual)
        gain, constant, value, slope = _stage(
            model.windows[phase], value, slope, doubt, unit * offset_cost
        )
        value = value + unit * np.eye(width)
        scale = 1.0 / float(np.trace(value))  # it may grow without an end
        value, slope, unit = value * scale, slope * scale, unit * scale
        gains[phase] = model.largest[:, np.newaxis] * gain / model.spreads
        constants[phase] = model.largest * constant
    return WindowGains(dofs, model.largest, rounded(constants), rounded(gains))


def _stage(
    window: WindowModel,
    value: FloatArray,
    slope: FloatArray,
    doubt: float,
    offset_cost: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """One step back: gain, constant, and the value `s V s + 2 v s` of the window's first state."""
    width = len(slope)
    known = window.matrix.T @ value @ window.matrix
    quadratic = known + doubt * window.covariance
    linear = window.matrix.T @ slope
    before, moved = slice(0, width), slice(width, -1)
    curvature = quadratic[moved, moved]
    curvature = curvature + offset_cost * np.eye(len(curvature))
    cross = quadratic[moved, before]
    gain = -_solved(curvature, cross)
    constant = -_solved(curvature, quadratic[moved, -1] + linear[moved])
    first = quadratic[before, before] + cross.T @ gain
    sloped = quadratic[before, -1] + linear[before] + cross.T @ constant
    return gain, constant, 0.5 * (first + first.T), sloped


def _solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)


def rounded(numbers: FloatArray) -> FloatArray:
    """Numbers with the digits that a file of them needs."""
    values = [float(f"{number:.{_DIGITS}g}") for number in numbers.ravel().tolist()]
    return np.array(values).reshape(numbers.shape)
