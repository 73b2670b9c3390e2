"""What became of what a planner foresaw: the path of the centre of mass, and the plans' costs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from experiment.bags.plans import PlanArrays
from experiment.bags.recording import Recording
from experiment.report.charts import Marks
from experiment.report.decimation import span_starts
from experiment.studies.plots import label, make_panels
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.dynamics import DynamicsModel

_SIZE = (11.0, 5.6)  # inches
_POINTS = 2000  # of the path of the centre of mass
_DRAWN = 120  # plans whose foreseen path is drawn
_AXES = ("forward, x (m)", "sideways, y (m)", "height, z (m)")
_FORESEEN: dict[str, Any] = {"color": "tab:orange", "linewidth": 0.7, "alpha": 0.7}


@dataclass(frozen=True)
class Foresight:
    """How far the centre of mass came to be from where plans had foreseen it."""

    ahead: FloatArray  # (c,) s
    errors: FloatArray  # (p, c) m, NaN where the recording or an episode ends before


def foresight(recording: Recording) -> Foresight:
    """What was foreseen against what came, over all plans, which others replaced soon."""
    plans = recording.plans
    ahead = min((plan.times for plan in plans), key=len)
    rows = [_rows(recording, plan) for plan in plans]
    wanted: IntArray = np.unique(np.concatenate(rows))
    centres = dict(zip(wanted.tolist(), _centres(recording, wanted), strict=True))
    errors = np.full((len(plans), len(ahead)), np.nan)
    for line, plan, its in zip(errors, plans, rows, strict=True):
        for check, row in enumerate(its[: len(ahead)].tolist()):
            line[check] = np.linalg.norm(plan.centres[check] - centres[row])
    return Foresight(ahead, errors)


def plan_chart(recording: Recording, marks: Marks) -> Figure:
    """The path of the centre of mass with what was foreseen, and what the plans cost."""
    times, plans = recording.times, recording.plans
    figure, panels = make_panels(2, 2, _SIZE, same_x=True)
    rows = span_starts(len(times), _POINTS)
    path = _centres(recording, rows)
    drawn = plans[:: -(-len(plans) // _DRAWN)]
    for axis, (panel, name) in enumerate(zip(panels, _AXES, strict=False)):
        marks.draw(panel)
        for number, plan in enumerate(drawn):
            at = _start(recording, plan) + plan.times
            named = "" if number else "foreseen"
            panel.plot(at, plan.centres[:, axis], label=named or "_", **_FORESEEN)
        panel.plot(times[rows], path[:, axis], color="black", linewidth=1.0, label="centre of mass")
        label(panel, "", name, legend="best" if axis == 0 else None)
    cost = panels[-1]
    marks.draw(cost)
    starts = [_start(recording, plan) for plan in plans]
    for name, values in (
        ("plan", [plan.costs.sum() for plan in plans]),
        ("best alternative", [plan.alternatives.sum() for plan in plans]),
    ):
        cost.plot(starts, values, linewidth=0.9, label=name)
    cost.set_yscale("log")
    label(cost, "", "cost")
    for panel in panels[-2:]:
        panel.set_xlabel("simulation time (s)")
        panel.set_xlim(float(times[0]), float(times[-1]))
    marks.legend(figure)
    return figure


def _start(recording: Recording, plan: PlanArrays) -> float:
    """When a plan was made, s since the first state."""
    return float((plan.stamp_ns - recording.stamps_ns[0]) / 1e9)


def _rows(recording: Recording, plan: PlanArrays) -> IntArray:
    """Rows of the states at a plan's checks, as far as its episode goes."""
    first = int(np.searchsorted(recording.stamps_ns, plan.stamp_ns))
    period = float(recording.times[-1]) / max(len(recording.times) - 1, 1)
    rows: IntArray = first + np.round(plan.times / period).astype(np.intp)
    later = recording.episode_rows[recording.episode_rows > first]
    end = int(later[0]) if len(later) else len(recording.times)
    return rows[rows < end]


def _centres(recording: Recording, rows: Sequence[int] | IntArray) -> FloatArray:
    """The centre of mass (r, 3) in the states of some rows, m, world."""
    model, nothing = DynamicsModel(recording.character), np.zeros(recording.layout.size)
    found = np.empty((len(rows), 3))
    for each, row in zip(found, rows, strict=True):
        model.update(recording.position[row], nothing)
        each[:] = model.centre_of_mass()
    return found
