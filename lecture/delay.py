"""Tracking of the walk by the rate of control and the delay of commands."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from actuated_characters.metrics.recording_metrics import fall_time
from actuated_characters.render.plots import label
from actuated_characters.runs.plan import RunPlan, make_plan
from controller_node.parameters import make_controller_settings
from lecture.framework.result import Row, StudyResult
from lecture.framework.study import WALK, RunSpec, StudyRunner
from lecture.framework.tracking import (
    delayed_spectral_radius,
    joint_errors,
)
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.dynamics import DynamicsModel

TITLE = "tracking of the walk by control rate and delay, with root assistance"
RUNS = 16

_CHARACTER = "humanoid"
_RATES = (120, 240, 480, 960)  # control rates, Hz
_DELAYS = (0, 1, 2, 4)  # ticks
_ENGINE_RATE = 960  # Hz; the same for all, so that nothing differs but control
_DURATION = 3.0  # s
_MAX_ERROR, _MIN_ERROR = 0.6, 0.05  # rad, the ends of the map's colours


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Walk with root assistance at each rate, the commands late by each number of ticks."""
    plan = make_plan(_CHARACTER, _DURATION, WALK, {}, {})
    result.rows += [_measure(runner, plan, rate, delay) for rate in _RATES for delay in _DELAYS]
    shape = len(_RATES), len(_DELAYS)
    late = np.reshape(result.column("delay (ms)"), shape)
    errors = np.reshape(result.column("mean joint error (rad)"), shape)
    falls = [time is not None for time in result.column("falls at (s)")]
    failed = np.reshape(np.logical_or(result.column("diverged"), falls), shape)
    lines, grid = result.add_panels(result.name, 1, 2, (13.0, 5.5))
    _draw_lines(lines, late, errors, failed)
    _draw_map(grid, np.where(failed, _MAX_ERROR, errors), [_describe(row) for row in result.rows])
    result.remarks += [
        "stable PD foresees its own period, not a late command: one tick of delay is "
        "harmless from 480 Hz on, two ticks shake the character at any rate",
        "the error of a run that diverged is that until then",
    ]


def _growth_by_theory(plan: RunPlan, rate: int, delay: int) -> float:
    """Growth a tick of small deviations from the rest pose in the air, under the plan's gains.

    `rate` is that of control in Hz, `delay` the ticks by which commands come late.
    """
    character = plan.character
    gains = make_controller_settings(character, plan.controller).gains
    model = DynamicsModel(character)
    model.update(np.array(character.rest_position), np.zeros(character.layout.size))
    return delayed_spectral_radius(
        model.mass_matrix(),
        gains.stiffness,
        gains.damping,
        1.0 / rate,
        delay_ticks=delay,
        substeps=_ENGINE_RATE // rate,
    )


def _measure(runner: StudyRunner, plan: RunPlan, rate: int, delay: int) -> Row:
    substeps = _ENGINE_RATE // rate
    simulator = {"rate": rate, "substeps": substeps, "command_delay_ticks": delay}
    case = RunSpec(f"{rate}Hz_{delay}ticks", _CHARACTER, _DURATION, WALK, simulator)
    outcome = runner.run(case)
    run = outcome.recording
    return {
        "rate (Hz)": rate,
        "delay (ticks)": delay,
        "delay (ms)": 1e3 * delay / rate,
        "mean joint error (rad)": float(joint_errors(run).mean()),
        "ends at (s)": float(run.times[-1]),
        "diverged": bool(outcome.diverged),
        "falls at (s)": fall_time(run),
        "growth a tick by theory": _growth_by_theory(plan, rate, delay),
    }


def _describe(row: Row) -> str:
    """The outcome at one rate and delay, in a few words."""
    text = f"{row['mean joint error (rad)']:.3f}"
    if row["diverged"]:
        text = f"diverges\n{row['ends at (s)']:.2f} s"
    elif row["falls at (s)"] is not None:
        text = f"falls\n{row['falls at (s)']:.2f} s"
    return f"{text}\n(x {row['growth a tick by theory']:.3f})"


def _draw_lines(axes: Axes, late: FloatArray, errors: FloatArray, failed: BoolArray) -> None:
    """Errors over delays in ms, a line a rate; a cross where the walk fails."""
    for rate, times, error, has_failed in zip(_RATES, late, errors, failed, strict=True):
        (line,) = axes.plot(times[~has_failed], error[~has_failed], "o-", label=f"{rate} Hz")
        worst = [_MAX_ERROR] * has_failed.sum()
        (crosses,) = axes.plot(times[has_failed], worst, "x", color=line.get_color())
        crosses.set(markersize=9, markeredgewidth=2)
    axes.plot([], [], "kx", label="diverges or falls")
    axes.set_yscale("log")
    axes.set_yticks([0.05, 0.1, 0.2, 0.4], ["0.05", "0.1", "0.2", "0.4"])
    axes.set_yticks([], minor=True)
    label(axes, "delay of commands (ms)", "mean joint error (rad)", "walk, 3 s, root assistance")


def _draw_map(axes: Axes, errors: FloatArray, texts: Sequence[str]) -> None:
    axes.imshow(np.log(errors), cmap="viridis_r", vmin=np.log(_MIN_ERROR), vmax=np.log(_MAX_ERROR))
    for (row, column), text in zip(np.ndindex(errors.shape), texts, strict=True):
        color = "white" if errors[row, column] > (_MAX_ERROR * _MIN_ERROR) ** 0.5 else "black"
        axes.text(column, row, text, ha="center", va="center", fontsize="small", color=color)
    axes.set_xticks(range(len(_DELAYS)), [str(delay) for delay in _DELAYS])
    axes.set_yticks(range(len(_RATES)), [str(rate) for rate in _RATES])
    title = (
        "mean joint error (rad); in brackets theory: growth of\n"
        "small deviations a tick, above 1 unstable"
    )
    label(axes, "delay of commands (ticks)", "control rate (Hz)", title, legend=None)
    axes.grid(visible=False)
