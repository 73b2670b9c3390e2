"""How long ticks take by the wall clock."""

import time

from msgs_config.runtime.durations import Durations


class TickTimes:
    """Durations of the last ticks."""

    def __init__(self) -> None:
        self._durations = Durations()
        self._last: float | None = None

    def tick(self) -> None:
        """Say that a tick is over."""
        now = time.perf_counter()
        if self._last is not None:
            self._durations.add(now - self._last)
        self._last = now

    def resume(self) -> None:
        """Say that the next tick begins now, after a pause that counts as none."""
        self._last = None

    def summary(self) -> dict[str, float]:
        """Ticks a second, and percentiles of a tick's duration in microseconds."""
        mean = self._durations.mean()
        if mean is None:
            return {}
        per_second = {"ticks_per_s": round(1.0 / mean, 1)}
        return per_second | self._durations.percentiles_us("tick", (50, 99))
