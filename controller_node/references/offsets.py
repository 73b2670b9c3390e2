"""Offsets to a reference that are linear between knots: what a plan adds to tracking errors."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from msgs_config.arrays import FloatArray


def knot_before(tick: int, knot_ticks: int) -> tuple[int, float]:
    """The number of the knot before a tick, and how far the tick is to the next one, 0 to 1."""
    knot = tick // knot_ticks
    return knot, (tick - knot * knot_ticks) / knot_ticks


@dataclass(frozen=True)
class Offsets:
    """Offsets of the actuated entries; ticks count from the episode's first state."""

    knot_ticks: int  # ticks from one knot to the next; the first one of all is at tick 0
    first_knot: int
    rows: FloatArray  # (k, n - 6) at the knots, rad or m; a rotation's in the child frame

    def at(self, tick: int) -> FloatArray:
        """The offset (n - 6,) of a tick, linear between the knots."""
        knot, share = knot_before(tick, self.knot_ticks)
        before, after = self.rows[knot - self.first_knot : knot - self.first_knot + 2]
        offset: FloatArray = before + share * (after - before)
        return offset

    def during(self, first: int, ticks: int) -> "Offsets":
        """The part of them for a number of ticks from one on."""
        begin, _ = knot_before(first, self.knot_ticks)
        end, _ = knot_before(first + ticks - 1, self.knot_ticks)
        rows = self.rows[begin - self.first_knot : end + 2 - self.first_knot]
        return Offsets(self.knot_ticks, begin, rows.copy())


@dataclass(frozen=True)
class RecordedPlan:
    """Offsets that acted, one plan after another; ticks count from the first state."""

    rate_hz: int
    ticks: int  # the tick at which the plan is over
    parts: tuple[tuple[int, Offsets], ...]  # each with the tick from which on it acts, rising

    def content(self, dofs: Sequence[str]) -> dict[str, Any]:
        """The plan as a file has it; `dofs` are the names of the actuated entries."""
        return {
            "rate": self.rate_hz,
            "ticks": self.ticks,
            "knot_ticks": self.parts[0][1].knot_ticks,
            "dofs": list(dofs),
            "parts": [
                {"tick": tick, "knot": offsets.first_knot, "offsets": offsets.rows.tolist()}
                for tick, offsets in self.parts
            ],
        }

    def at(self, tick: int) -> FloatArray:
        """The offset (n - 6,) of a tick; zero before it begins and when it is over."""
        number = bisect_right(self.parts, tick, key=lambda part: part[0]) - 1
        if number < 0 or tick >= self.ticks:
            return np.zeros(self.parts[0][1].rows.shape[1])
        return self.parts[number][1].at(tick)
