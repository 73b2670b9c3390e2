"""Puts the messages of one tick together, and measures it. Knows no ROS."""

from collections import deque

from actuated_characters.metrics.run_metrics import Measurement, Tick
from msgs_config.errors import ClockError
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedReference, StampedState

_LONGEST_WAIT = 1000  # ticks that a reference may come after its state
MOST_AHEAD = 10_000  # ticks that it may come before its state; a publisher keeps half as many
_MOST_WAITING = _LONGEST_WAIT + MOST_AHEAD  # references that wait for their ticks


class TickAssembler:
    """Puts states and references together by their stamps, in the order of the states.

    A tick is over when its reference has come, and the next state, which has the effort that was
    applied. A repeated state counts once. References wait for the states that they belong to: one
    of no tick, of a tick too far ahead or of one whose state never came is dropped.
    """

    def __init__(self, measurement: Measurement, rate_hz: int) -> None:
        self._measurement = measurement
        self._clock = TickClock(rate_hz)
        self._states: deque[StampedState] = deque()
        self._references: dict[int, StampedReference] = {}
        self._last_tick: int | None = None
        self.missing_ticks = 0
        self.dropped_references = 0

    @property
    def last_tick(self) -> int:
        """Number of the last tick whose state came; 0 before the first."""
        return self._last_tick or 0

    def add_state(self, state: StampedState) -> bool:
        """Take a state as it came; whether it is a new one.

        Raises:
            ClockError: its stamp is no tick.
        """
        tick = self._clock.tick(state.stamp_ns)
        if self._last_tick is not None:
            if tick <= self._last_tick:
                return False
            self.missing_ticks += tick - self._last_tick - 1
        else:
            self._drop_outside(tick, tick + MOST_AHEAD)
        self._last_tick = tick
        self._measurement.add_state(state)
        self._states.append(state)
        self._assemble(longest_wait=_LONGEST_WAIT)
        return True

    def add_reference(self, reference: StampedReference) -> None:
        """Take a reference as it came; a repeated one replaces itself."""
        if self._states and reference.stamp_ns < self._states[0].stamp_ns:
            return
        if self._may_wait(reference.stamp_ns):
            self._references[reference.stamp_ns] = reference
            self._assemble(longest_wait=_LONGEST_WAIT)
        else:
            self.dropped_references += 1

    def finish(self) -> None:
        """Measure the last ticks, whose references have not come, without them."""
        self._assemble(longest_wait=0)

    def _may_wait(self, stamp_ns: int) -> bool:
        try:
            tick = self._clock.tick(stamp_ns)
        except ClockError:
            return False
        is_near = self._last_tick is None or tick <= self._last_tick + MOST_AHEAD
        return is_near and (len(self._references) < _MOST_WAITING or stamp_ns in self._references)

    def _drop_outside(self, first: int, last: int) -> None:
        """Drop the references of ticks before `first` and after `last`."""
        first_ns, last_ns = self._clock.stamp_ns(first), self._clock.stamp_ns(last)
        before = len(self._references)
        self._references = {
            stamp: each for stamp, each in self._references.items() if first_ns <= stamp <= last_ns
        }
        self.dropped_references += before - len(self._references)

    def _assemble(self, longest_wait: int) -> None:
        while len(self._states) > 1:
            state, following = self._states[0], self._states[1]
            reference = self._references.pop(state.stamp_ns, None)
            if reference is None and len(self._states) <= longest_wait:
                return
            self._states.popleft()
            tick = self._clock.tick(following.stamp_ns)
            if self._clock.stamp_ns(tick - 1) != state.stamp_ns:  # ticks between them are missing
                self._drop_outside(tick, self.last_tick + MOST_AHEAD)
            if following.effort is not None:
                self._measurement.add_tick(Tick(state, following, reference))
