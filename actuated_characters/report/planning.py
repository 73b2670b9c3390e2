"""A planner's predictions of the centre of mass against its path, and the plans' costs."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from actuated_characters.bags.plans import PlanArrays
from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.error_measures import centre_path
from actuated_characters.render.plots import label, make_panels
from actuated_characters.report.charts import TIME, Marks, Timeline
from msgs_config.arrays import FloatArray, IntArray

_SIZE = (11.0, 5.6)  # inches
_DRAWN = 120  # plans whose predicted path is drawn
_AXES = ("forward, x (m)", "sideways, y (m)", "height, z (m)")
_FORESEEN: dict[str, Any] = {"color": "tab:orange", "linewidth": 0.7, "alpha": 0.7}


def foresight(recording: Recording) -> dict[float, FloatArray]:
    """Distance of the centre of mass from where plans had predicted it.

    By the time ahead in s: errors in m of all plans, most of which others replaced before.
    """
    rows = [_rows(recording, plan) for plan in recording.plans]
    wanted: IntArray = np.unique(np.concatenate(rows))
    path = centre_path(recording.character, recording.position[wanted])
    errors: dict[int, list[float]] = {}
    for plan, its in zip(recording.plans, rows, strict=True):
        apart = plan.centres[: len(its)] - path[np.searchsorted(wanted, its)]
        ahead = (its - _first_row(recording, plan)).tolist()
        for ticks, error in zip(ahead, np.linalg.norm(apart, axis=1).tolist(), strict=True):
            errors.setdefault(ticks, []).append(error)
    return {ticks / _rate(recording): np.array(errors[ticks]) for ticks in sorted(errors)}


def plan_chart(recording: Recording, marks: Marks) -> Figure:
    """The path of the centre of mass with its predictions, and the plans' costs."""
    times, plans = recording.times, recording.plans
    timeline = Timeline(times, recording.episode_rows[1:], marks)
    figure, panels = make_panels(2, 2, _SIZE, same_x=True)
    rows = timeline.path_rows
    at, path = timeline.path(rows, centre_path(recording.character, recording.position[rows]))
    for axis, (panel, name) in enumerate(zip(panels, _AXES, strict=False)):
        for number, plan in enumerate(plans[:: -(-len(plans) // _DRAWN)]):
            its = _rows(recording, plan)
            named = "_" if number else "predicted"
            panel.plot(times[its], plan.centres[: len(its), axis], label=named, **_FORESEEN)
        panel.plot(at, path[:, axis], color="black", linewidth=1.0, label="centre of mass")
        label(panel, "", name, legend="best" if axis == 0 else None)
    starts = [times[_first_row(recording, plan)] for plan in plans]
    for name, values in (
        ("plan", [plan.costs.sum() for plan in plans]),
        ("best alternative", [plan.alternatives.sum() for plan in plans]),
    ):
        panels[-1].plot(starts, values, linewidth=0.9, label=name)
    panels[-1].set_yscale("log")
    label(panels[-1], "", "cost")
    for panel in panels[-2:]:
        panel.set_xlabel(TIME)
    return timeline.finish(figure, panels)


def _rate(recording: Recording) -> int:
    return int(recording.parameters["rate"])


def _first_row(recording: Recording, plan: PlanArrays) -> int:
    """Row of the state that a plan was made in."""
    return int(np.searchsorted(recording.stamps_ns, plan.stamp_ns))


def _rows(recording: Recording, plan: PlanArrays) -> IntArray:
    """Rows of the states at a plan's checks, up to its episode's end."""
    first, count = _first_row(recording, plan), len(recording.times)
    later = recording.episode_rows[recording.episode_rows > first]
    end = int(later[0]) if len(later) else count
    ticks = np.minimum(np.round(plan.times * _rate(recording)), count)
    rows: IntArray = first + ticks.astype(np.intp)
    return rows[rows < end]
