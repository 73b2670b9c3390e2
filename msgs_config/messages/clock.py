"""Simulation time as an integer count of ticks; no float is ever accumulated."""

from dataclasses import dataclass

from msgs_config.errors import ClockError, ConfigurationError

NANOSECONDS_PER_SECOND = 10**9
FIRST_TICK = 1


@dataclass(frozen=True)
class TickClock:
    """Ticks at a whole number of Hz; tick k is stamped `(k 10^9) // rate` ns.

    Ticks start at 1, because a zero stamp means "unset" in ROS.
    """

    rate_hz: int

    def __post_init__(self) -> None:
        if not 1 <= self.rate_hz <= 100_000:
            raise ConfigurationError(f"rate is {self.rate_hz} Hz; it must be 1 to 100000")

    @property
    def period_s(self) -> float:
        """Length of a tick in s."""
        return 1.0 / self.rate_hz

    def stamp_ns(self, tick: int) -> int:
        """Stamp of a tick in ns since the start of simulation time."""
        return tick * NANOSECONDS_PER_SECOND // self.rate_hz

    def tick(self, stamp_ns: int) -> int:
        """The tick that a stamp in ns belongs to.

        Raises:
            ClockError: the stamp is none of this clock's; the sender runs at another rate.
        """
        rate = self.rate_hz  # written out: asked for several times a tick
        tick = -(-stamp_ns * rate // NANOSECONDS_PER_SECOND)
        if tick * NANOSECONDS_PER_SECOND // rate != stamp_ns:
            raise ClockError(
                f"stamp {stamp_ns} ns is no tick at {self.rate_hz} Hz; "
                "simulator and controller must have the same parameter 'rate'"
            )
        return tick

    def time_after(self, ticks: int) -> float:
        """Time in s of a number of ticks after the first one, as its stamps count it."""
        since_ns = self.stamp_ns(FIRST_TICK + ticks) - self.stamp_ns(FIRST_TICK)
        return since_ns / NANOSECONDS_PER_SECOND

    def first_tick_from(self, stamp_ns: int) -> int:
        """The first tick whose stamp is a time in ns or later."""
        return -(-stamp_ns * self.rate_hz // NANOSECONDS_PER_SECOND)
