"""How long ticks take by the wall clock."""

import time
from array import array

import numpy as np

_KEPT = 1 << 14


class TickTimes:
    """Durations of the last ticks."""

    def __init__(self) -> None:
        self._durations = array("d")  # s; a ring once it is full
        self._count = 0
        self._last: float | None = None

    def tick(self) -> None:
        """Say that a tick is over."""
        now = time.perf_counter()
        if self._last is not None:
            duration = now - self._last
            if len(self._durations) < _KEPT:
                self._durations.append(duration)
            else:
                self._durations[self._count % _KEPT] = duration
            self._count += 1
        self._last = now

    def resume(self) -> None:
        """Say that the next tick begins now, after a pause that counts as none."""
        self._last = None

    def summary(self) -> dict[str, float]:
        """Ticks a second, and percentiles of a tick's duration in microseconds."""
        if not self._durations:
            return {}
        durations = np.array(self._durations)
        p50, p99 = 1e6 * np.percentile(durations, (50, 99))
        return {
            "ticks_per_s": round(1.0 / float(durations.mean()), 1),
            "tick_us_p50": round(float(p50), 1),
            "tick_us_p99": round(float(p99), 1),
        }
