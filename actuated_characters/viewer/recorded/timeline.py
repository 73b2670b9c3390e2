"""The time line of a recording: which state is shown, and which is the next one."""

import numpy as np

from msgs_config.arrays import FloatArray

_EQUAL_TIMES = 1e-9  # s: two times are as good as equal


class Playback:
    """A position among the states of a recording, which plays at a speed, or stands."""

    def __init__(self, times: FloatArray) -> None:
        """Begin at the first of the times (t,), s, which rise."""
        self.times = times
        self.speed = 1.0
        self.plays = False
        self.loops = False
        self._time = float(times[0])

    @property
    def row(self) -> int:
        """The last state that is not after the present time."""
        return row_at(self.times, self._time)

    @property
    def time(self) -> float:
        """The time of that state, s."""
        return float(self.times[self.row])

    @property
    def end(self) -> float:
        """The time of the last state, s."""
        return float(self.times[-1])

    def seek(self, time: float) -> None:
        """Go to a time, or to the nearest end."""
        self._time = min(max(time, float(self.times[0])), self.end)

    def seek_nearest(self, time: float) -> None:
        """Go to the state nearest to a time, where a hand has pointed; of two to the later one."""
        self.seek(time)
        before = self.row
        after = min(before + 1, len(self.times) - 1)
        if self.times[after] - self._time <= self._time - self.times[before]:
            before = after
        self._time = float(self.times[before])

    def step(self, ticks: int) -> None:
        """Stand, so many states ahead, or back if it is negative."""
        self.plays = False
        row = min(max(self.row + ticks, 0), len(self.times) - 1)
        self._time = float(self.times[row])

    def play(self) -> None:
        """Play on; from the start if it is at its end."""
        if self.row == len(self.times) - 1:
            self._time = float(self.times[0])
        self.plays = True

    def play_from(self, time: float) -> None:
        """Play on from a time, s, also if nothing comes after it."""
        self.seek(time)
        self.plays = True

    def advance(self, seconds: float) -> None:
        """Play for a wall time in s: at the end it stands, or begins again."""
        if not self.plays:
            return
        start, time = float(self.times[0]), self._time + self.speed * seconds
        if time <= self.end:
            self._time = time
        elif self.loops and self.end > start:
            self._time = start + (time - start) % (self.end - start)
        else:
            self._time, self.plays = self.end, False


def row_at(times: FloatArray, time: float) -> int:
    """The row of the last of rising times (t,), s, that is not after a time; at least the first."""
    return max(int(np.searchsorted(times, time + _EQUAL_TIMES, side="right")) - 1, 0)


def frame_times(start: float, end: float, step: float) -> list[float]:
    """Times of frames, s, from a start to an end, both included, a step apart."""
    count = int((end - start) / step + _EQUAL_TIMES) + 1
    return [start + number * step for number in range(count)]
