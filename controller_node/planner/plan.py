"""A plan, and what of it the next one begins with."""

from dataclasses import dataclass

import numpy as np

from controller_node.planner.outlook import Outlook
from controller_node.planner.settings import PlannerSettings
from controller_node.references.offsets import Offsets
from msgs_config.arrays import FloatArray

_SENSITIVITY_DECAY = 0.7  # factor on sensitivities from plan to plan


@dataclass(frozen=True)
class Plan:
    """Offsets over a horizon, and what was learned while they were found."""

    seen: int  # tick of the state that it was sought from, since the episode began
    tick: int  # the first tick in which it acts
    offsets: Offsets
    sensitivities: FloatArray | None  # (k (n - 6), checks f) of features to offsets
    areas: FloatArray  # (k,) ticks of the horizon that each knot counts for
    outlook: Outlook

    def left(self, tick: int, count: int) -> FloatArray:
        """What is left of the offsets at a tick, at so many knots (k, n - 6); zero beyond."""
        known = self.offsets
        left = np.zeros((count, known.rows.shape[1]))
        rows = np.arange(count) + (tick // known.knot_ticks - known.first_knot)
        there = rows < len(known.rows)
        left[there] = known.rows[np.maximum(rows[there], 0)]
        return left

    def faded(self, tick: int, areas: FloatArray, settings: PlannerSettings) -> FloatArray | None:
        """The sensitivities at the knots and checks of a plan that acts from a tick on.

        A knot's go with its part in the horizon, `areas` (k,). A new knot's are zero, a new check
        has the last one's.
        """
        if self.sensitivities is None:
            return None
        width = self.offsets.rows.shape[1]
        known = self.sensitivities.reshape(len(self.areas), width, settings.checks, -1)
        passed = (tick - self.tick) // settings.period
        checks = np.minimum(np.arange(settings.checks) + passed, settings.checks - 1)
        faded = np.zeros((len(areas), *known.shape[1:]))
        for knot, area in enumerate(areas):
            before = knot + tick // settings.knots - self.offsets.first_knot
            if before < len(known) and self.areas[before] > 0.0:
                share = _SENSITIVITY_DECAY * min(1.0, area / self.areas[before])
                faded[knot] = share * known[before][:, checks]
        return faded.reshape(len(areas) * width, -1)


def areas_of(tick: int, count: int, settings: PlannerSettings) -> FloatArray:
    """For how many ticks of a horizon from a tick on each knot (k,) counts, by its weight."""
    since_knot = tick % settings.knots
    ticks = (since_knot + np.arange(settings.horizon)) / settings.knots
    from_knots = np.abs(ticks - np.arange(count)[:, np.newaxis])
    return np.array([float(np.add.accumulate(row)[-1]) for row in np.maximum(1.0 - from_knots, 0)])
