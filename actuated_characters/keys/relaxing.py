"""States and times of neighbouring keys for which the largest error of the path is least."""

from dataclasses import dataclass

import numpy as np

from actuated_characters.keys.goal import (
    Goal,
    Keys,
    Window,
    open_window,
    placed_times,
    window_path,
    window_weights,
)
from msgs_config.arrays import BoolArray, FloatArray, IntArray

_POWERS = (2, 2, 3, 3, 4, 4, 6, 6, 6, 9, 9, 9, 14, 14, 14, 20, 20, 20, 20, 30, 30, 30, 30, 30)
_POWERS_OF_STATES = (2, 3, 4, 6, 9, 14, 20, 30)  # where times stay
_SHARES = (2.0, 1.0, 0.4, 0.1)  # of Newton's step, the first one that brings something is taken
_DAMPING = 0.03  # of a step of times, as a share of the curvature
_FLOOR, _RIDGE = 1e-6, 1e-4  # least weight of a sample, and what damps a step of states, relative
_SMALLEST = 1e-8  # error that is told from none, in tolerances
_ENOUGH = 0.98  # of an aim, at which it is met
_NUDGE = 1e-7  # s, by which a time is moved to see what changes


@dataclass(frozen=True)
class _Fit:
    """Keys of a window, and what their path lacks of the motion, in tolerances."""

    times: FloatArray  # (u,) s
    states: FloatArray  # (u, 3, n)
    left: FloatArray  # (r, n)
    lengths: FloatArray  # (r, b) of each vector of that

    @property
    def error(self) -> float:
        """The largest error, in tolerances."""
        return float(self.lengths.max())


def relax(
    goal: Goal,
    keys: Keys,
    chosen: tuple[int, int],
    *,
    moves: bool = True,
    aim: float = 1.0,
) -> tuple[float, Keys]:
    """The largest error of the path about some keys, in tolerances, and the keys with less of it.

    The sum of a power of all errors is made less by steps of Newton's method; the power grows, and
    with it what the largest error counts.

    Args:
        goal: The motion to follow.
        keys: All keys.
        chosen: The first and the last of the keys that are free, side by side.
        moves: Whether their times are free, too, and not their states alone.
        aim: The error, in tolerances, at which it is good enough.
    """
    window = open_window(goal, keys, chosen)
    best = fit = _fitted(goal, window, window.times, window.states)
    moves = moves and bool(window.movable.any())
    for round_, power in enumerate(_POWERS if moves else _POWERS_OF_STATES):
        fit = _stepped(goal, window, fit, power, moves=moves and round_ > 0)
        best = min(best, fit, key=lambda each: each.error)
        if best.error <= _ENOUGH * aim:
            break
    all_times, all_states = keys.times.copy(), keys.states.copy()
    all_times[window.keys], all_states[window.keys] = best.times, best.states
    return best.error, Keys(all_times, all_states)


def _fitted(goal: Goal, window: Window, times: FloatArray, states: FloatArray) -> _Fit:
    left = goal.values[window.rows] - window_path(goal, window, times, states)
    return _Fit(times, states, left, goal.lengths(left))


def _stepped(goal: Goal, window: Window, fit: _Fit, power: int, *, moves: bool) -> _Fit:
    """A fit for which the sum of this power of all errors is less, or the same one."""
    movable = window.movable & moves
    step, change = _newton_step(goal, window, fit, power, movable)
    back, on = _free_room(goal, window, fit.times)
    lower, upper = goal.bounds
    most, total = fit.error, _total(fit, fit.error, power)
    for share in _SHARES:
        part = min(share / (power - 1), 1.0)
        times, states = fit.times.copy(), fit.states.copy()
        times[movable] += np.clip(part * step, -back[movable], on[movable])
        states[window.free] += part * change
        states[window.free, 0] = np.clip(states[window.free, 0], lower, upper)
        tried = _fitted(goal, window, times, states)
        if _total(tried, most, power) < total:
            return tried
    return fit


def _total(fit: _Fit, unit: float, power: int) -> float:
    """The sum of a power of all errors in a unit; what is far too large is cut off."""
    return float((np.minimum(fit.lengths / max(unit, _SMALLEST), 1e3) ** power).sum())


def _newton_step(
    goal: Goal, window: Window, fit: _Fit, power: int, movable: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Steps (k,) of movable times and (f, 3, n) of free states, by Gauss-Newton.

    It is that of least squares whose weights are errors to the power less two, which is Newton's
    for that power but for a factor (Karlovitz 1970). The states are projected out of the times'
    (Golub and Pereyra 1973, "variable projection").
    """
    path = goal.values[window.rows] - fit.left
    changes = [
        (window_path(goal, window, times, fit.states) - path) / _NUDGE
        for times in fit.times + _NUDGE * np.eye(len(fit.times))[movable]
    ]
    columns = np.stack((*changes, fit.left), axis=-1).swapaxes(0, 1)  # (n, r, k + 1)
    weights, _ = window_weights(goal, window, fit.times)
    weights = weights[:, np.repeat(window.free, 3)]
    worst, vector_of = np.maximum(fit.lengths.max(axis=0), _SMALLEST), _vector_of(goal)
    importance = (fit.lengths / worst) ** (power - 2) + _FLOOR
    matrices, weighted = _normal_equations(weights, importance[:, vector_of])
    solved = np.linalg.solve(matrices, weighted @ columns)  # (n, 3 f, k + 1)
    step = np.zeros(len(changes))
    if changes:
        emphasis = (worst / worst.max()) ** (power - 2)
        projected = (columns - weights @ solved) * np.sqrt(importance * emphasis)[:, vector_of].T[
            ..., np.newaxis
        ]
        flat = projected.reshape(-1, len(changes) + 1)
        products = flat.T @ flat
        curvature, slope = products[:-1, :-1], products[:-1, -1]
        damping = np.diag(_DAMPING * np.diag(curvature) + 1e-12)
        step = np.linalg.solve(curvature + damping, slope)
    change = (solved[..., -1] - solved[..., :-1] @ step).T
    return step, change.reshape(-1, 3, change.shape[1])


def _normal_equations(weights: FloatArray, importance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """`A' I A` (n, f, f), and `A' I` (n, f, r), of A (r, f) and importance I (r, n) of entries."""
    weighted = weights.T * importance.T[:, np.newaxis, :]
    matrices = weighted @ weights
    diagonals = np.einsum("nff->nf", matrices)
    diagonals += _RIDGE * diagonals + (diagonals == 0.0)  # zero: of no sample, so it stays at zero
    return matrices, weighted


def _free_room(goal: Goal, window: Window, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How far (u,) each key may go back and on so that all keep their distance, in s."""
    placed = placed_times(goal, window, times)
    room = np.maximum(0.45 * (np.diff(placed) - goal.spacing), 0.0)
    back, on = np.pad(room, (1, 0)), np.pad(room, (0, 1))
    _, firsts = np.unique(window.copies, return_index=True)
    _, from_the_end = np.unique(window.copies[::-1], return_index=True)
    lasts = len(placed) - 1 - from_the_end
    return back[lasts], on[firsts]


def _vector_of(goal: Goal) -> IntArray:
    """The physical vector (n,) of each entry."""
    lengths = np.diff(goal.starts, append=len(goal.bounds[0]))
    return np.repeat(np.arange(len(goal.starts)), lengths)
