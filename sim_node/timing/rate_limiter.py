"""When ticks are due by the wall clock, how late they begin, and how long they take."""

import math

from msgs_config.runtime.durations import Durations

_LONGEST_BACKLOG = 0.1  # s of lateness that are made up for; beyond it the schedule starts over
_TOLERATED_SHARE = 0.01  # share of deadlines that may be missed without a warning


class RateLimiter:
    """A schedule of ticks in s of wall time; a period of 0 makes every tick due at once."""

    def __init__(self, period: float) -> None:
        self.period = period
        self.missed = 0  # ticks that began after the next one was due
        self._scheduled = 0  # ticks that were due by the wall clock
        self._warned_of = (0, 0)  # `missed` and `_scheduled` when `take_warning` judged last
        self._due_at = -math.inf
        self._last: float | None = None  # when the last tick began
        self._lateness = Durations()
        self._durations = Durations()

    def restart(self, now: float) -> None:
        """Begin the schedule: the next tick is due a period from now; time before is left out."""
        self._due_at = now + self.period
        self._last = None

    def change(self, period: float, now: float) -> None:
        """Go on with another period."""
        self.period = period
        self.restart(now)

    def wait(self, now: float) -> float:
        """Time until the next tick is due, s; 0 if it is."""
        return max(self._due_at - now, 0.0) if self.period > 0.0 else 0.0

    def tick(self, now: float) -> None:
        """Note that a tick begins."""
        if self._last is not None:
            self._durations.add(now - self._last)
        self._last = now
        if self.period == 0.0:
            return
        late = now - self._due_at
        self._scheduled += 1
        self.missed += late > self.period
        self._lateness.add(late)
        self._due_at += self.period
        if late > max(_LONGEST_BACKLOG, self.period):
            self._due_at = now + self.period

    def take_warning(self) -> str | None:
        """A sentence if more than 1 % of the deadlines since the last judgement were missed.

        Fewer than a hundred are not judged: one of them would be more than 1 %.
        """
        missed, ticks = self.missed - self._warned_of[0], self._scheduled - self._warned_of[1]
        if ticks * _TOLERATED_SHARE < 1.0:
            return None
        self._warned_of = self.missed, self._scheduled
        if missed <= _TOLERATED_SHARE * ticks:
            return None
        return (
            f"{missed} of the last {ticks} deadlines missed; rate or real_time_factor is too high"
        )

    def summary(self) -> dict[str, float | int]:
        """Ticks a second, missed deadlines, and percentiles of durations and lateness in µs."""
        mean = self._durations.mean()
        rate = {} if mean is None else {"ticks_per_s": round(1.0 / mean, 1)}
        late = self._lateness.percentiles_us("late", (50, 99, 99.9))
        missed = {"missed_deadlines": self.missed} if late else {}
        return rate | self._durations.percentiles_us("tick", (50, 99)) | missed | late
