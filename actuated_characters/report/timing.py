"""Wall times of the states of a recording: missing ticks, pauses and lateness. Knows no ROS."""

from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND

_PAUSE_FACTOR = 10.0  # in usual times between two states: a pause is longer ...
_LEAST_PAUSE = 0.1  # s: ... and longer than this
_MIN_REPETITIONS = 8  # a state that takes long so often is usual ...
_SHARE = 0.01  # ... if it has this share of all, as with a planner every few states
_LONGEST_BACKLOG = 0.1  # s that the simulator catches up with; beyond it its schedule starts over


@dataclass(frozen=True)
class StateTimes:
    """The states of one stream, each once, in order."""

    ticks: IntArray  # (m,) numbers of the states' ticks
    published_ns: IntArray  # (m,) wall time
    repeated: int  # messages whose state had come before

    @property
    def missing(self) -> list[tuple[int, int]]:
        """First and last tick of each gap."""
        gaps = np.flatnonzero(np.diff(self.ticks) > 1)
        return [(int(self.ticks[row]) + 1, int(self.ticks[row + 1]) - 1) for row in gaps]

    @property
    def missing_count(self) -> int:
        """Number of ticks between the first and the last that have no state."""
        return int(self.ticks[-1] - self.ticks[0]) + 1 - len(self.ticks) if len(self.ticks) else 0


def state_times(stamps_ns: IntArray, published_ns: IntArray, rate_hz: int) -> StateTimes:
    """The states among messages with these stamps (m,) and wall times (m,), in the order received.

    A state that is published again has an old stamp, and counts once, as does any message with a
    stamp before one that came already.
    """
    ticks = -(-stamps_ns * rate_hz // NANOSECONDS_PER_SECOND)
    highest = np.maximum.accumulate(ticks)
    is_new: BoolArray = np.ones(len(ticks), dtype=np.bool_)
    is_new[1:] = ticks[1:] > highest[:-1]
    return StateTimes(ticks[is_new], published_ns[is_new], int((~is_new).sum()))


def wall_steps(published_ns: IntArray) -> FloatArray:
    """Wall time (m - 1,) from each of m states to the next, s."""
    steps: FloatArray = np.diff(published_ns) / NANOSECONDS_PER_SECOND
    return steps


def pauses(published_ns: IntArray) -> IntArray:
    """Rows of the states after which the next one took far longer than usual."""
    steps = wall_steps(published_ns)
    if not len(steps):
        return np.zeros(0, dtype=np.intp)
    longest = max(_LEAST_PAUSE, _PAUSE_FACTOR * float(np.median(steps)))
    long = steps[steps > longest]
    if len(long) >= max(_MIN_REPETITIONS, _SHARE * len(steps)):
        longest = _PAUSE_FACTOR * float(np.median(long))
    return np.flatnonzero(steps > longest)


def lateness(published_ns: IntArray, period: float) -> FloatArray:
    """Lateness (m,) of each state by the schedule of a paced run, s; negative for an early one.

    The schedule is the simulator's: a period in s of wall time from state to state, which catches
    up after a short delay, and restarts at the first state, after a long delay and after a pause.
    """
    after_pauses = set((pauses(published_ns) + 1).tolist())
    times = ((published_ns - published_ns[:1]) / NANOSECONDS_PER_SECOND).tolist()
    late = np.zeros(len(times))
    due = 0.0
    for row, time in enumerate(times):
        if row in after_pauses:
            due = time
        late[row] = time - due
        if late[row] > max(_LONGEST_BACKLOG, period):
            due = time
        due += period
    return late
