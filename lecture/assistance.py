"""Root force and torque of the lecture: the walk with less and less of them."""

from collections.abc import Mapping

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.recording_metrics import fall_time
from actuated_characters.render.plots import label
from actuated_characters.render.stills import strip
from lecture.framework.result import Row, StudyResult
from lecture.framework.study import WALK, RunSpec, StudyRunner
from lecture.framework.tracking import (
    joint_errors,
    root_force_share,
)
from msgs_config.character.layout import ROOT
from msgs_config.character.loading import load_character
from msgs_config.character.model import ROOT_TORQUE, Character

TITLE = "the walk by strength of root force and torque"
RUNS = 7

_CHARACTER = "humanoid"
_STRENGTHS = (1.0, 0.3, 0.1, 0.03, 0.01, 0.0)  # factors of root force and torque
_DURATION = 5.0  # s
_SMALLEST_DRAWN = 0.003  # no assistance is drawn here on an axis that has no zero
_PICTURES, _SIZE = 8, (190, 240)


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Walk with each strength of root force and torque, and with a root without commands."""
    character = load_character(_CHARACTER)
    controllers = {f"x {strength:g}": weakened(character, strength) for strength in _STRENGTHS}
    controllers["none"] = {"root_assistance": False}
    runs = {name: _walk(runner, name, given) for name, given in controllers.items()}
    result.rows += [_row(name, run) for name, run in runs.items()]
    first, *_, zero, none = runs.values()
    _draw(result, runs)
    _draw_poses(result, none, first)
    longest = max(runs.values(), key=lambda run: len(run.times))
    curves = {"time_s": longest.times, "reference_m": longest.reference_position[:, 2]}
    for name, run in runs.items():
        curves[f"{name.replace(' ', '')}_m"] = run.position[:, 2]
    result.add_curves("assistance_height", curves)
    fall, same = fall_time(none), np.array_equal(none.position, zero.position)
    result.remarks += [
        f"without assistance it falls at {fall:.3g} s: 28 motors cannot hold 34 degrees of "
        "freedom on a path that was not planned for them (underactuation)"
        if fall is not None
        else "without assistance it does not fall",
        "root gains of zero and a root that may not be commanded: "
        f"{'the same states' if same else 'other states'}",
    ]


def weakened(character: Character, strength: float) -> dict[str, object]:
    """Gains of the root with a share of the stiffness, and the same damping ratio.

    The ratio is `kd / (2 sqrt(kp m))`: damping goes with the root of the stiffness.
    """
    given: dict[str, object] = {}
    for name in (ROOT, ROOT_TORQUE):
        gains = character.gains[name]
        given[f"gains.{name}.p"] = strength * gains.stiffness
        given[f"gains.{name}.d"] = strength**0.5 * gains.damping
    return given


def _walk(runner: StudyRunner, name: str, controller: dict[str, object]) -> Recording:
    label = name.replace(" ", "")
    case = RunSpec(label, _CHARACTER, _DURATION, WALK, controller=controller)
    return runner.run(case).recording


def _row(name: str, run: Recording) -> Row:
    fall = fall_time(run)
    until = len(run.effort) if fall is None else int(np.searchsorted(run.times, fall))
    desired = run.reference_position[:until]
    off = run.position[:until, :3] - desired[:, :3]
    return {
        "root stiffness": name,
        "falls at (s)": fall,
        "mean joint error until then (rad)": float(joint_errors(run, desired).mean()),
        "mean root error until then (m)": float(np.linalg.norm(off, axis=1).mean()),
        "root force / weight until then": root_force_share(run, until),
    }


def _draw(result: StudyResult, runs: Mapping[str, Recording]) -> None:
    title = "the walk needs a force that no motor gives"
    panels = result.add_panels(result.name, 2, 2, (12.0, 7.5), title=title)
    falls, errors, forces, heights = panels
    strengths = [max(strength, _SMALLEST_DRAWN) for strength in _STRENGTHS]
    columns = {name: result.column(name)[:-1] for name in result.columns}
    times = columns["falls at (s)"]
    for time, place in zip(times, strengths, strict=True):
        falls.plot(place, time or _DURATION, "^" if time is None else "o", color="tab:blue")
    falls.plot(strengths, [time or _DURATION for time in times], color="tab:blue")
    falls.plot([], [], "^", color="tab:blue", label=f"does not fall within {_DURATION:g} s")
    label(falls, "strength of assistance", "time of the fall (s)")
    joint, root = columns["mean joint error until then (rad)"], "mean root error until then (m)"
    errors.plot(strengths, joint, "o-", label="joints (rad)")
    errors.plot(strengths, columns[root], "s-", label="root (m)")
    label(errors, "strength of assistance", "mean error until the fall")
    shares = columns["root force / weight until then"]
    forces.plot(strengths, shares, "o-", color="tab:green")
    label(forces, "strength of assistance", "root force / weight until the fall", legend=None)
    for panel in (falls, errors, forces):
        panel.set_xscale("log")
        panel.set_xticks(strengths, [f"{strength:g}" for strength in _STRENGTHS])
        panel.set_xticks([], minor=True)
        panel.set_ylim(bottom=0.0)
    *assisted, _ = runs.items()
    for name, run in assisted:
        heights.plot(run.times, run.position[:, 2], label=name)
    full = assisted[0][1]
    heights.plot(full.times, full.reference_position[:, 2], "k--", label="reference")
    label(heights, "time (s)", "root height (m)", legend="center right")
    heights.set_xlim(right=1.3 * _DURATION)  # leaves room for the legend


def _draw_poses(result: StudyResult, none: Recording, full: Recording) -> None:
    """The fall without assistance, and the same times with all of it."""
    end = min(1.5 * (fall_time(none) or _DURATION), float(none.times[-2]))
    times = np.linspace(0.0, end, _PICTURES).tolist()
    pictures = {
        f"{named}; the reference in green": strip(run, times, ghost=True, size=_SIZE)
        for named, run in (("without assistance", none), ("with root force and torque", full))
    }
    result.add_pictures("assistance_poses", pictures)
