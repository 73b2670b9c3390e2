"""When ticks are due by the wall clock, and how late they were. No ROS in here."""

import math

from msgs_config.runtime.durations import Durations

_LONGEST_BACKLOG = 0.1  # s that is caught up with; beyond it the schedule starts over


class RateLimiter:
    """A schedule of ticks in s of wall time; a period of 0 makes every tick due at once."""

    def __init__(self, period: float) -> None:
        self.period = period
        self.missed = 0  # ticks that began after the next one was due
        self._due_at = -math.inf
        self._lateness = Durations()

    def restart(self, now: float) -> None:
        """Begin the schedule: the next tick is due a period from now."""
        self._due_at = now + self.period

    def change(self, period: float, now: float) -> None:
        """Go on with another period."""
        self.period = period
        self.restart(now)

    def wait(self, now: float) -> float:
        """How long until the next tick is due, s; 0 if it is."""
        return max(self._due_at - now, 0.0) if self.period > 0.0 else 0.0

    def tick(self, now: float) -> None:
        """Say that a tick begins."""
        if self.period == 0.0:
            return
        late = now - self._due_at
        self.missed += late > self.period
        self._lateness.add(late)
        self._due_at += self.period
        if late > max(_LONGEST_BACKLOG, self.period):
            self.restart(now)

    def summary(self) -> dict[str, float | int]:
        """Missed deadlines, and percentiles of how late ticks began in microseconds."""
        late = self._lateness.percentiles_us("late", (50, 99, 99.9))
        return {"missed_deadlines": self.missed} | late if late else {}
