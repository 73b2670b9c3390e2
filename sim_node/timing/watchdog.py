"""Events that are due while the simulator waits, by the wall clock."""

import math
from dataclasses import dataclass
from enum import Enum


class WatchdogEvent(Enum):
    """What a long wait calls for."""

    REPUBLISH = "republish"  # a late subscriber may have missed the state
    EXPLAIN = "explain"  # a user should read what is missing
    TIMEOUT = "timeout"  # the wait has been too long


@dataclass
class Watchdog:
    """Times in s of wall time, counted from `restart`; a timeout of 0 never comes."""

    republish_period: float = math.inf
    timeout: float = 0.0
    explain_after: float = 2.0
    _republish_at: float = math.inf
    _explain_at: float = math.inf
    _timeout_at: float = math.inf

    def restart(self, now: float) -> None:
        """A new state was published."""
        self._republish_at = now + self.republish_period
        self._explain_at = now + self.explain_after
        self._timeout_at = now + self.timeout if self.timeout > 0.0 else math.inf

    def due(self, now: float) -> list[WatchdogEvent]:
        """What has become due since it was last asked, each explanation and timeout once."""
        events = []
        if now >= self._republish_at:
            events.append(WatchdogEvent.REPUBLISH)
            self._republish_at = now + self.republish_period
        if now >= self._explain_at:
            events.append(WatchdogEvent.EXPLAIN)
            self._explain_at = math.inf
        if now >= self._timeout_at:
            events.append(WatchdogEvent.TIMEOUT)
            self._timeout_at = math.inf
        return events
