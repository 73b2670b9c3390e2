"""What became of what a planner foresaw: the path of the centre of mass, and the plans' costs."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from actuated_characters.bags.plans import PlanArrays
from actuated_characters.bags.recording import Recording
from actuated_characters.report.charts import Marks, broken, span_time, strided
from actuated_characters.studies.framework.plots import label, make_panels
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.dynamics import DynamicsModel

_SIZE = (11.0, 5.6)  # inches
_DRAWN = 120  # plans whose foreseen path is drawn
_AXES = ("forward, x (m)", "sideways, y (m)", "height, z (m)")
_FORESEEN: dict[str, Any] = {"color": "tab:orange", "linewidth": 0.7, "alpha": 0.7}


def foresight(recording: Recording) -> dict[float, FloatArray]:
    """How far the centre of mass came to be from where plans had foreseen it.

    By the time ahead in s: errors in m of all plans, most of which others replaced before.
    """
    rows = [_rows(recording, plan) for plan in recording.plans]
    wanted: IntArray = np.unique(np.concatenate(rows))
    centres = dict(zip(wanted.tolist(), _centres(recording, wanted), strict=True))
    errors: dict[int, list[float]] = {}
    for plan, its in zip(recording.plans, rows, strict=True):
        first = _first_row(recording, plan)
        for centre, row in zip(plan.centres, its.tolist(), strict=False):
            errors.setdefault(row - first, []).append(float(np.linalg.norm(centre - centres[row])))
    return {ticks / _rate(recording): np.array(errors[ticks]) for ticks in sorted(errors)}


def plan_chart(recording: Recording, marks: Marks) -> Figure:
    """The path of the centre of mass with what was foreseen, and what the plans cost."""
    times, plans = recording.times, recording.plans
    figure, panels = make_panels(2, 2, _SIZE, same_x=True)
    rows, breaks = strided(len(times), recording.episode_rows[1:]), recording.episode_rows[1:]
    path = _centres(recording, rows)
    at, path = broken(times[rows], path, np.searchsorted(rows, breaks))
    drawn = plans[:: -(-len(plans) // _DRAWN)]
    for axis, (panel, name) in enumerate(zip(panels, _AXES, strict=False)):
        marks.draw(panel)
        for number, plan in enumerate(drawn):
            its = _rows(recording, plan)
            named = "_" if number else "foreseen"
            panel.plot(times[its], plan.centres[: len(its), axis], label=named, **_FORESEEN)
        panel.plot(at, path[:, axis], color="black", linewidth=1.0, label="centre of mass")
        label(panel, "", name, legend="best" if axis == 0 else None)
    cost = panels[-1]
    marks.draw(cost)
    starts = [times[_first_row(recording, plan)] for plan in plans]
    for name, values in (
        ("plan", [plan.costs.sum() for plan in plans]),
        ("best alternative", [plan.alternatives.sum() for plan in plans]),
    ):
        cost.plot(starts, values, linewidth=0.9, label=name)
    cost.set_yscale("log")
    label(cost, "", "cost")
    for panel in panels[-2:]:
        panel.set_xlabel("simulation time (s)")
    span_time(panels, times)
    return marks.explained(figure)


def _rate(recording: Recording) -> int:
    return int(recording.parameters["rate"])


def _first_row(recording: Recording, plan: PlanArrays) -> int:
    """Row of the state that a plan was made in."""
    return int(np.searchsorted(recording.stamps_ns, plan.stamp_ns))


def _rows(recording: Recording, plan: PlanArrays) -> IntArray:
    """Rows of the states at a plan's checks, as far as its episode goes."""
    first, count = _first_row(recording, plan), len(recording.times)
    later = recording.episode_rows[recording.episode_rows > first]
    end = int(later[0]) if len(later) else count
    ticks = np.minimum(np.round(plan.times * _rate(recording)), count)
    rows: IntArray = first + ticks.astype(np.intp)
    return rows[rows < end]


def _centres(recording: Recording, rows: IntArray) -> FloatArray:
    """The centre of mass (r, 3) in the states of some rows, m, world."""
    model = DynamicsModel(recording.character)
    centres = [model.centre_of_mass_at(recording.position[row]) for row in rows]
    return np.array(centres).reshape(-1, 3)
