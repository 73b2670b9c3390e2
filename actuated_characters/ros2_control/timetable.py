"""When a controller manager updates, by its own time and by the simulator's ticks. No ROS."""

from dataclasses import dataclass

from msgs_config.errors import ConfigurationError
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND


@dataclass(frozen=True)
class UpdatePeriod:
    """The period of updates: whole ticks, and whole ns, as a controller manager counts it.

    It wakes up when its clock has moved on by its period in ns, cut to whole ones. With a rate that
    does not divide a second the clock would fall behind that, and an update would never come.
    """

    rate_hz: int  # of the simulator's ticks
    update_rate_hz: int

    def __post_init__(self) -> None:
        if NANOSECONDS_PER_SECOND % self.update_rate_hz:
            raise ConfigurationError(
                f"parameter 'update_rate' is {self.update_rate_hz} Hz; its period must be whole "
                "nanoseconds, as of 100, 125, 200, 250, 500 or 1000 Hz"
            )
        if self.rate_hz % self.update_rate_hz:
            raise ConfigurationError(
                f"parameter 'update_rate' is {self.update_rate_hz} Hz; it must divide 'rate', "
                f"which is {self.rate_hz} Hz"
            )

    @property
    def ns(self) -> int:
        """Its length in ns."""
        return NANOSECONDS_PER_SECOND // self.update_rate_hz

    @property
    def seconds(self) -> float:
        """Its length in s."""
        return 1.0 / self.update_rate_hz

    @property
    def ticks(self) -> int:
        """Its length in ticks of the simulator."""
        return self.rate_hz // self.update_rate_hz

    def whole_ns(self, seconds: float) -> int:
        """A time in s as ns; raises ConfigurationError unless it is a number of periods."""
        updates = round(seconds * self.update_rate_hz)
        if abs(updates - seconds * self.update_rate_hz) > 1e-6:
            raise ConfigurationError(
                f"parameter 'start_time' is {seconds:g} s; it must be a multiple of the period of "
                f"{self.update_rate_hz} Hz"
            )
        return updates * self.ns


class Timetable:
    """Which tick is an update, and what a controller manager's clock says then.

    Its clock does not go back: another episode, or simulator, begins one period later.
    """

    def __init__(self, period: UpdatePeriod) -> None:
        self.period = period
        self.now_ns = 0  # what the clock said last
        self._first_tick = self._first_ns = 0  # from which updates are counted

    def stand(self) -> None:
        """Go on by a period while the world stands."""
        self.now_ns += self.period.ns

    def begin(self, tick: int) -> None:
        """Let the clock's next update be that of a tick, and count from there."""
        self._first_tick, self._first_ns = tick, self.now_ns + self.period.ns

    def is_update(self, tick: int) -> bool:
        """Go on to a tick; whether it is an update, whose time is `now_ns` then."""
        updates = (tick - self._first_tick) // self.period.ticks
        time_ns = self._first_ns + updates * self.period.ns
        if time_ns <= self.now_ns:
            return False
        self.now_ns = time_ns
        return True

    def share(self, tick: int) -> float:
        """The share of the update's period that is over at a tick, 0 to 1."""
        return ((tick - self._first_tick) % self.period.ticks) / self.period.ticks
