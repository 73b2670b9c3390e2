"""Matches what several topics say of one tick, and measures it. No ROS in here."""

from collections import deque

from experiment.metrics import Measurement, Tick
from msgs_config.stamped import StampedReference, StampedState
from msgs_config.tick_clock import TickClock

_LONGEST_WAIT = 1000  # ticks that a reference may come after its state


class TickAssembler:
    """Puts states and references together by their stamps, in the order of the states.

    A tick is over when the next state has come, which says what effort was applied, and when its
    reference has come. A repeated state counts once.
    """

    def __init__(self, measurement: Measurement, rate_hz: int) -> None:
        self._measurement = measurement
        self._clock = TickClock(rate_hz)
        self._states: deque[StampedState] = deque()
        self._references: dict[int, StampedReference] = {}
        self._last_tick: int | None = None
        self.missing_ticks = 0

    @property
    def last_tick(self) -> int:
        """Number of the last tick whose state came; 0 before the first."""
        return self._last_tick or 0

    def add_state(self, state: StampedState) -> None:
        """Take a state as it came. Raises ClockError if its stamp is no tick."""
        tick = self._clock.tick(state.stamp_ns)
        if self._last_tick is not None:
            if tick <= self._last_tick:
                return
            self.missing_ticks += tick - self._last_tick - 1
        self._last_tick = tick
        self._measurement.add_state(state)
        self._states.append(state)
        self._assemble(patience=_LONGEST_WAIT)

    def add_reference(self, reference: StampedReference) -> None:
        """Take a reference as it came; a repeated one replaces itself."""
        if self._states and reference.stamp_ns < self._states[0].stamp_ns:
            return
        self._references[reference.stamp_ns] = reference
        self._assemble(patience=_LONGEST_WAIT)

    def finish(self) -> None:
        """Measure the ticks whose reference has not come and will not any more."""
        self._assemble(patience=0)

    def _assemble(self, patience: int) -> None:
        while len(self._states) > 1:
            state, following = self._states[0], self._states[1]
            reference = self._references.pop(state.stamp_ns, None)
            if reference is None and len(self._states) <= patience:
                return
            self._states.popleft()
            if following.effort is not None:
                self._measurement.add_tick(Tick(state, following, reference))
