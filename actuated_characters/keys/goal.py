"""What a path through keys is to follow, and the part of it that a few neighbouring keys move."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from actuated_characters.keys.path_weights import path_values, path_weights
from msgs_config.arrays import BoolArray, FloatArray, IntArray

_REACH = 1  # key on each side that a part of the path between keys depends on


@dataclass(frozen=True)
class Keys:
    """Keys at rising times: unrolled coordinates in tolerances, their rates, and those of these."""

    times: FloatArray  # (p,) s
    states: FloatArray  # (p, 3, n)

    def __getitem__(self, rows: slice) -> "Keys":
        """Some of the keys, in order."""
        return Keys(self.times[rows], self.states[rows])

    def without(self, index: int) -> "Keys":
        """All keys but one."""
        return Keys(np.delete(self.times, index), np.delete(self.states, index, axis=0))

    def inserted(self, time: float, state: FloatArray) -> "Keys":
        """The keys with one more at a time in s, whose state is (3, n)."""
        row = int(np.searchsorted(self.times, time))
        return Keys(np.insert(self.times, row, time), np.insert(self.states, row, state, axis=0))


@dataclass(frozen=True)
class Loop:
    """How a motion goes on from its end."""

    period: float  # s
    lap: FloatArray  # (n,) by which the unrolled coordinates grow in a period


@dataclass(frozen=True)
class Goal:
    """A motion in unrolled coordinates, each in its tolerance: a path must be within length 1.

    Of a loop there are the periods before and after as well, so that each part of the path lies
    within the samples.
    """

    times: FloatArray  # (m,) s
    values: FloatArray  # (m, n)
    starts: IntArray  # (b,) first entry of each physical vector
    bounds: tuple[FloatArray, FloatArray]  # (n,) each, of keys' values
    spacing: float  # s, the least time between two keys
    loop: Loop | None = None

    def lengths(self, entries: FloatArray) -> FloatArray:
        """Length (..., b) of each physical vector of differences (..., n), in tolerances."""
        lengths: FloatArray = np.sqrt(np.add.reduceat(entries * entries, self.starts, axis=-1))
        return lengths

    def states(self, times: FloatArray) -> FloatArray:
        """The motion (p, 3, n) at times (p,) in s, its rates, and those of these."""
        rates = np.gradient(self.values, self.times, axis=0)
        second_rates = np.gradient(rates, self.times, axis=0)
        columns = np.concatenate((self.values, rates, second_rates), axis=1).T
        found = np.array([np.interp(times, self.times, column) for column in columns]).T
        return found.reshape(len(times), 3, -1)

    def looped(self, loop: Loop) -> "Goal":
        """That of a loop, of the samples of one period."""
        laps = range(-1, 2)
        return replace(
            self,
            times=np.concatenate([self.times[:-1] + k * loop.period for k in laps]),
            values=np.concatenate([self.values[:-1] + k * loop.lap for k in laps]),
            loop=loop,
        )


def path_of(goal: Goal, keys: Keys, times: FloatArray) -> FloatArray:
    """Values (m, n) of the path through all keys at times (m,) in s."""
    if goal.loop is None:
        return path_values(keys.times, keys.states, times)
    count = len(keys.times)
    places = np.arange(-_REACH, count + _REACH)
    laps = places // count
    states = keys.states[places % count]
    states[:, 0] += laps[:, np.newaxis] * goal.loop.lap
    return path_values(keys.times[places % count] + laps * goal.loop.period, states, times)


@dataclass(frozen=True)
class Window:
    """Keys of which some are free, and the samples that these move.

    Keys of a loop may stand in it once more, a period earlier or later.
    """

    keys: IntArray  # (u,) which of the keys
    free: BoolArray  # (u,) whose state is free
    movable: BoolArray  # (u,) whose time is free, too
    times: FloatArray  # (u,) s
    states: FloatArray  # (u, 3, n)
    copies: IntArray  # (e,) which key of the window stands at each place, in the order of time
    laps: FloatArray  # (e, 1) how many periods later
    rows: slice  # of the samples of the goal


def open_window(goal: Goal, keys: Keys, chosen: Sequence[int]) -> Window:
    """The window in which some keys, side by side, are free.

    Args:
        goal: Whose samples are looked at.
        keys: All keys.
        chosen: The first and the last of the free keys; of a loop they may be beyond its ends.
    """
    count, (first, last) = len(keys.times), chosen
    if goal.loop is None:
        first, last = max(first, 0), min(last, count - 1)
        places = np.arange(max(first - _REACH, 0), min(last + _REACH, count - 1) + 1)
    else:
        if last - first + 1 + 2 * _REACH > count:  # all are free
            first, last = 0, count - 1
        places = np.arange(first - _REACH, last + _REACH + 1)
    window_keys, copies = np.unique(places % count, return_inverse=True)
    chosen_keys = np.arange(first, last + 1) % count
    free = np.isin(window_keys, chosen_keys)
    is_end = (window_keys == 0) | ((window_keys == count - 1) & (goal.loop is None))
    window = Window(
        window_keys,
        free,
        free & ~is_end,
        keys.times[window_keys],
        keys.states[window_keys],
        copies,
        (places // count).astype(float)[:, np.newaxis],
        slice(0, 0),
    )
    times = placed_times(goal, window, window.times)
    begin, end = times[0], times[-1]
    if goal.loop is not None and free.all():
        begin, end = 0.0, goal.loop.period
    rows = np.searchsorted(goal.times, [begin, end], side="left")
    return replace(window, rows=slice(int(rows[0]), int(rows[1]) + 1))


def placed_times(goal: Goal, window: Window, times: FloatArray) -> FloatArray:
    """Times (e,) in s of the places of a window whose keys are at times (u,)."""
    placed = times[window.copies]
    return placed if goal.loop is None else placed + window.laps[:, 0] * goal.loop.period


def window_weights(goal: Goal, window: Window, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weights (r, 3 u) of a window's keys at times (u,), and what is added to the path, (r, n)."""
    samples = goal.times[window.rows]
    placed = path_weights(placed_times(goal, window, times), samples)
    if goal.loop is None:
        return placed, np.zeros((len(samples), len(goal.bounds[0])))
    fold = (window.copies[:, np.newaxis] == np.arange(len(window.keys))).astype(float)
    return placed @ np.kron(fold, np.eye(3)), placed[:, ::3] @ (window.laps * goal.loop.lap)


def window_path(goal: Goal, window: Window, times: FloatArray, states: FloatArray) -> FloatArray:
    """Values (r, n) of the path through a window's keys at times (u,) with states (u, 3, n)."""
    placed = states[window.copies]
    if goal.loop is not None:
        placed[:, 0] += window.laps * goal.loop.lap
    return path_values(placed_times(goal, window, times), placed, goal.times[window.rows])
