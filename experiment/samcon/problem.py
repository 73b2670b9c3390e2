"""What is to be reconstructed: a motion over some time, in windows, under a run's parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from experiment.plan import Plan, make_plan
from experiment.planned_push import PlannedPush, parsed_push
from experiment.samcon.gains_file import digest, read_gains
from experiment.samcon.settings import Settings
from msgs_config.arrays import IntArray
from msgs_config.errors import ConfigurationError
from msgs_config.tick_clock import FIRST_TICK, NANOSECONDS_PER_SECOND, TickClock


@dataclass(frozen=True)
class Problem:
    """A motion and how it is run; small, so that every process can make its own plan of it."""

    character: str
    clip: str
    duration: float  # s
    window: float  # s, about
    simulator: Mapping[str, object] = field(default_factory=dict)
    controller: Mapping[str, object] = field(default_factory=dict)
    feedback: Mapping[str, float] = field(default_factory=dict)  # gains by name
    window_feedback: str = ""  # name or path of its gains; empty: without
    window_digest: str = ""  # of their content, which all processes must have
    feedforward: float = 0.0  # share of the offsets of the motion's inverse dynamics to begin with
    pushes: tuple[str, ...] = ()  # LINK:FX,FY,FZ@S, which the search knows beforehand

    @classmethod
    def of(
        cls,
        character: str,
        clip: str,
        duration: float,
        settings: Settings,
        simulator: Mapping[str, object] | None = None,
        pushes: Sequence[str] = (),
    ) -> "Problem":
        """A motion over a time in s, with what a search's settings say of how it is run."""
        return cls(
            character,
            clip,
            duration,
            settings.window,
            simulator or {},
            settings.gains,
            settings.feedback,
            settings.window_feedback,
            digest(read_gains(settings.window_feedback)) if settings.window_feedback else "",
            settings.feedforward,
            tuple(pushes),
        )

    def planned_pushes(self, plan: Plan) -> tuple[PlannedPush, ...]:
        """The pushes of its plan. Raises ConfigurationError if one is wrong."""
        return tuple(parsed_push(text, plan) for text in self.pushes)

    def windows(self, plan: Plan) -> "Windows":
        """The windows of its plan. Raises ConfigurationError if some would have no tick."""
        rate = plan.simulator.integer("rate")
        windows = Windows(plan.ticks, rate, self.window)
        if len(windows) > plan.ticks:
            raise ConfigurationError(
                f"window is {self.window:.3g} s; it must be a tick or more, {1.0 / rate:.3g} s"
            )
        return windows

    def plan(self, clip: str | None = None) -> Plan:
        """The run, of the motion itself or of another clip; the root is not driven.

        Raises:
            ActuatedCharactersError: a name or value is wrong.
        """
        return make_plan(
            self.character,
            self.duration,
            {"reference": "clip", "clip": clip or self.clip},
            self.simulator,
            {"root_assistance": False, **self.controller},
        )


@dataclass(frozen=True)
class Windows:
    """The windows of a run, each a few ticks long."""

    ticks: int  # of the run
    rate_hz: int
    window: float  # s, about

    @cached_property
    def bounds(self) -> IntArray:
        """Ticks (w + 1,) since the first state at which windows begin and end."""
        count = max(round(self.ticks / (self.window * self.rate_hz)), 1)
        bounds: IntArray = np.arange(count + 1) * self.ticks // count
        return bounds

    def __len__(self) -> int:
        return len(self.bounds) - 1

    @property
    def ends(self) -> tuple[float, ...]:
        """Ends (w,) of the windows in s, exactly as the controller counts time."""
        return tuple(self.time(int(tick)) for tick in self.bounds[1:])

    @cached_property
    def _times(self) -> tuple[tuple[float, ...], ...]:
        starts, ends = self.bounds[:-1].tolist(), self.bounds[1:].tolist()
        return tuple(
            tuple(self.time(tick) for tick in range(start, end + 1))
            for start, end in zip(starts, ends, strict=True)
        )

    def times(self, window: int) -> tuple[float, ...]:
        """The times in s of a window's ticks, of the one at its end too."""
        return self._times[window]

    def time(self, tick: int) -> float:
        """Time in s of a tick since the first state, as the controller counts it."""
        clock = TickClock(self.rate_hz)
        since_ns = clock.stamp_ns(FIRST_TICK + tick) - clock.stamp_ns(FIRST_TICK)
        return since_ns / NANOSECONDS_PER_SECOND


def windows_a_cycle(windows: int, cycles: int) -> int:
    """Windows of each of some equal cycles, of which a window feedback has as many.

    Raises:
        ConfigurationError: they are not equally many.
    """
    if windows % cycles:
        raise ConfigurationError(
            f"{cycles} cycles are {windows} windows; for a window feedback all cycles must have "
            "equally many"
        )
    return windows // cycles
