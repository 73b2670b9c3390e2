"""When the simulator waits for subscribers that are behind."""

import math
from collections.abc import Callable
from dataclasses import dataclass


@dataclass
class FlowControl:
    """Holds the simulation until its subscribers have acknowledged what was published.

    A publisher keeps its last few thousand messages; a subscriber whose process stands still for
    longer than those last loses some. Waiting costs wall time only, so in lockstep it alters
    nothing; in real time it is not `active`. A subscriber that does not acknowledge in time is not
    waited for again until it has.
    """

    # Whether every subscriber has all messages, or gets them within so many seconds.
    acknowledged: Callable[[float], bool]
    log: Callable[[str], None]
    active: bool = True
    every_ticks: int = 1000  # between calls of `acknowledged`; a publisher keeps 5000 messages
    longest: float = 30.0  # s of wall time that subscribers are waited for
    turn: float = 0.02  # s of wall time in one wait, between looks at everything else
    _last_tick: int = 0  # the tick at which subscribers were counted last
    _gives_up_at: float = math.inf
    _has_given_up: bool = False

    def holds(self, tick: int, now: float) -> bool:
        """Whether the tick may not begin yet; `now` in s of wall time."""
        if not self.active or tick - self._last_tick < self.every_ticks:
            return False
        if self.acknowledged(0.0 if self._has_given_up else self.turn):
            self._has_given_up = False
        elif not self._has_given_up:
            self._gives_up_at = min(self._gives_up_at, now + self.longest)
            if now < self._gives_up_at:
                return True
            self._has_given_up = True
            self.log(
                f"a subscriber has not acknowledged the states within {self.longest:g} s; it is "
                "not waited for any more, and may lose some"
            )
        self._last_tick, self._gives_up_at = tick, math.inf
        return False
