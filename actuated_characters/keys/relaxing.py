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
from msgs_config.arrays import FloatArray, IntArray

_FIRST_ROUNDS, _ROUNDS = 6, 4  # of reweighting, of states that are new and of known ones
_STEPS, _MAX_FAILURES = 30, 6  # of times, and how many may bring nothing
_DAMPING, _LEAST_DAMPING = 0.3, 1e-3  # of a step of times, as shares of the curvature
_LESS, _MORE = 0.4, 3.0  # factors on it after a step that was good, or was not
_EMPHASIS = 3  # the power of a vector's largest error by which it counts for the times
_FLOOR, _RIDGE = 1e-3, 1e-8  # least factor on a weight, and what keeps a matrix regular, relative
_ENOUGH = 0.98  # of an aim, at which it is met
_NUDGE = 1e-7  # s, by which a time is moved to see what changes


@dataclass(frozen=True)
class _Fit:
    """States of the keys for some times, and what is left of the motion."""

    times: FloatArray  # (u,) s
    states: FloatArray  # (u, 2, n)
    weights: FloatArray  # (r, 2 f) of the free values and rates in the path
    path: FloatArray  # (r, n)
    left: FloatArray  # (r, n) what the path lacks, in tolerances
    importance: FloatArray  # (r, b) of each vector of each sample
    worst: FloatArray  # (b,) the largest error of each vector, in tolerances

    @property
    def error(self) -> float:
        """The largest error, in tolerances."""
        return float(self.worst.max())


def relax(
    goal: Goal,
    keys: Keys,
    chosen: tuple[int, int],
    *,
    left_out: int | None = None,
    moves: bool = True,
    aim: float = 1.0,
) -> tuple[float, Keys]:
    """The largest error of the path about some keys, in tolerances, and the keys with less of it.

    Args:
        goal: The motion to follow.
        keys: All keys.
        chosen: The first and the last of the keys that are free, side by side.
        left_out: A key that is taken as if it were not there; the keys still have it.
        moves: Whether their times are free, too, and not their values and rates alone.
        aim: The error, in tolerances, at which it is good enough.
    """
    window = open_window(goal, keys, chosen, left_out)
    best = _fitted(goal, window, window.times, None, aim)
    damping, failures = _DAMPING, 0
    for _ in range(_STEPS if moves and window.movable.any() else 0):
        if best.error <= _ENOUGH * aim or failures > _MAX_FAILURES:
            break
        times = best.times.copy()
        times[window.movable] += _step_of_times(goal, window, best, damping)
        tried = _fitted(goal, window, times, best, aim)
        if tried.error < best.error - 1e-6:
            best, damping = tried, max(_LESS * damping, _LEAST_DAMPING)
        else:
            damping, failures = _MORE * damping, failures + 1
    all_times, all_states = keys.times.copy(), keys.states.copy()
    all_times[window.keys], all_states[window.keys] = best.times, best.states
    return best.error, Keys(all_times, all_states)


def _fitted(goal: Goal, window: Window, times: FloatArray, before: _Fit | None, aim: float) -> _Fit:
    """The states at some times, by least squares whose weights follow the error (Lawson 1961)."""
    weights, added = window_weights(goal, window, times)
    is_free, entries = np.repeat(window.free, 2), len(goal.bounds[0])
    free, held = weights[:, is_free], window.states[~window.free].reshape(-1, entries)
    wanted = goal.values[window.rows] - added - weights[:, ~is_free] @ held
    count = len(goal.starts)
    importance = np.ones((len(wanted), count)) if before is None else before.importance
    lower, upper = goal.bounds
    values: FloatArray | None = None
    left = wanted
    worst = np.full(count, np.inf)
    vector_of = _vector_of(goal)
    for _ in range(_FIRST_ROUNDS if before is None else _ROUNDS):
        matrices, weighted = _normal_equations(free, importance[:, vector_of])
        right = (weighted @ wanted.T[:, :, np.newaxis])[..., 0]
        found = np.asarray(np.linalg.solve(matrices, right[..., np.newaxis])[..., 0].T)
        found[::2] = np.clip(found[::2], lower, upper)
        rest = wanted - free @ found
        lengths = goal.lengths(rest)
        largest = lengths.max(axis=0)
        better = largest < worst
        columns = better[vector_of]
        values = np.where(columns, found, found if values is None else values)
        left = np.where(columns, rest, left)
        worst = np.where(better, largest, worst)
        if worst.max() <= _ENOUGH * aim:
            break
        importance = importance * (lengths / np.maximum(largest, _RIDGE) + _FLOOR)
        importance /= importance.max(axis=0)
    assert values is not None
    states = window.states.copy()
    states[window.free] = values.reshape(-1, 2, entries)
    path = goal.values[window.rows] - left
    return _Fit(times, states, free, path, left, importance, worst)


def _normal_equations(weights: FloatArray, importance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """`A' I A` (n, f, f), and `A' I` (n, f, r), of A (r, f) and importance I (r, n) of entries."""
    weighted = weights.T * importance.T[:, np.newaxis, :]
    matrices = weighted @ weights
    size = weights.shape[1]
    ridge = _RIDGE * np.trace(matrices, axis1=1, axis2=2) / size
    return matrices + ridge[:, np.newaxis, np.newaxis] * np.eye(size), weighted


def _step_of_times(goal: Goal, window: Window, fit: _Fit, damping: float) -> FloatArray:
    """By how many s to move each key that may move, by Gauss-Newton with the states projected out.

    Source: Golub and Pereyra 1973, "variable projection".
    """
    room_back, room_on = _free_room(goal, window, fit.times)
    changes = [
        (window_path(goal, window, times, fit.states) - fit.path) / _NUDGE
        for times in fit.times + _NUDGE * np.eye(len(fit.times))[window.movable]
    ]
    emphasis = (fit.worst / fit.error) ** (2 * _EMPHASIS)
    importance = (fit.importance * emphasis + 1e-12)[:, _vector_of(goal)]
    free = fit.weights
    matrices, weighted = _normal_equations(free, importance)
    columns = np.stack((*changes, fit.left), axis=-1).swapaxes(0, 1)  # (n, r, moves + 1)
    projected = columns - free @ np.linalg.solve(matrices, weighted @ columns)
    flat = (projected * np.sqrt(importance.T)[..., np.newaxis]).reshape(-1, len(changes) + 1)
    products = flat.T @ flat
    curvature, slope = products[:-1, :-1], products[:-1, -1]
    damped = curvature + np.diag(damping * np.diag(curvature) + 1e-12)
    step: FloatArray = np.clip(np.linalg.solve(damped, slope), -room_back, room_on)
    return step


def _free_room(goal: Goal, window: Window, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How far (k,) each movable key may go back and on so that all keep their distance, in s."""
    placed = placed_times(goal, window, times)
    room = np.maximum(0.45 * (np.diff(placed) - goal.spacing), 0.0)
    back, on = np.pad(room, (1, 0)), np.pad(room, (0, 1))
    _, firsts = np.unique(window.copies, return_index=True)
    _, from_the_end = np.unique(window.copies[::-1], return_index=True)
    lasts = len(placed) - 1 - from_the_end
    return back[lasts][window.movable], on[firsts][window.movable]


def _vector_of(goal: Goal) -> IntArray:
    """The physical vector (n,) of each entry."""
    lengths = np.diff(goal.starts, append=len(goal.bounds[0]))
    return np.repeat(np.arange(len(goal.starts)), lengths)
