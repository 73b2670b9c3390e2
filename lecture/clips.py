"""Every motion clip of the humanoid, tracked with root assistance: errors, falls, real time."""

from collections.abc import Mapping

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.render.plots import label
from actuated_characters.render.stills import strip
from lecture.framework.result import Row, StudyResult
from lecture.framework.study import RunResult, RunSpec, StudyRunner
from lecture.framework.tracking import (
    joint_errors,
    root_force_share,
)
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.character.lowest_points import lowest_heights
from msgs_config.character.model import Character
from msgs_config.clips.reading import available_clips, read_clip

TITLE = "every clip with root assistance, 10 s each"
RUNS = 15

_CHARACTER = "humanoid"
_DURATION = 10.0  # s
_BOUNDS = {"walk": 0.08, "punch": 0.25}  # rad, bounds of the mean joint error
_BOUND = 0.12  # rad, bound of the mean joint error of the other clips
_TOUCH = 0.01  # m above the ground, below which a link of the capture is on it
_EACH = 4  # every fourth state is looked at for what is on the ground
_PICTURED_SECONDS = {
    "walk": 1.3,
    "backflip": 1.75,
    "cartwheel": 2.72,
    "punch": 2.2,
}  # s from the start
_PICTURES, _SIZE = 8, (190, 240)


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Track each clip for the same time, and compare its error with the bound."""
    character = load_character(_CHARACTER)
    outcomes = {clip: _track(runner, clip) for clip in available_clips(character)}
    result.rows += [_row(character, clip, outcome) for clip, outcome in outcomes.items()]
    _draw(result)
    _draw_poses(result, {clip: outcome.recording for clip, outcome in outcomes.items()})
    times = max((outcome.recording.times for outcome in outcomes.values()), key=len)
    curves = {
        f"{c}_rad": joint_errors(outcome.recording).mean(axis=1) for c, outcome in outcomes.items()
    }
    result.add_curves("clips_errors", {"time_s": times[:-1], **curves})
    errors, bounds = np.array(
        [result.column("mean joint error (rad)"), result.column("bound (rad)")]
    )
    worst = int(np.argmax(errors / bounds))
    falls, down = _named(result, "fell") or "none", _named(result, "down in the capture") or "none"
    result.remarks += [
        f"nearest to its bound: {list(outcomes)[worst]}, {errors[worst]:.3f} of "
        f"{bounds[worst]:g} rad",
        f"falls: {falls}; in the capture itself on the ground with more than the feet: {down}",
    ]


def _named(result: StudyResult, column: str) -> str:
    """The clips that have a yes in a column."""
    return ", ".join(row["clip"] for row in result.rows if row[column])


def clearances(character: Character, positions: FloatArray) -> Mapping[str, FloatArray]:
    """Height (t,) in m above z = 0 of each link's lowest point, at positions (t, n)."""
    model, still = DynamicsModel(character), np.zeros(character.layout.size)
    heights = np.empty((len(positions), len(character.links)))
    for row, position in enumerate(positions):
        model.update(position, still)
        heights[row] = lowest_heights(character, model)
    touching = np.isfinite(heights[0])  # other links have nothing to touch the ground with
    return {link.name: heights[:, k] for k, link in enumerate(character.links) if touching[k]}


def _track(runner: StudyRunner, clip: str) -> RunResult:
    return runner.run(RunSpec(clip, _CHARACTER, _DURATION, {"reference": "clip", "clip": clip}))


def _row(character: Character, clip: str, outcome: RunResult) -> Row:
    """A row of the table."""
    recording = outcome.recording
    errors = joint_errors(recording)
    feet, captured = set(character.feet), recording.reference_position[:-1:_EACH]
    return {
        "clip": clip,
        "loops": read_clip(character, clip).wraps,
        "mean joint error (rad)": float(errors.mean()),
        "bound (rad)": _BOUNDS.get(clip, _BOUND),
        "largest joint error (rad)": float(errors.max()),
        "mean root error (m)": outcome.measured("root_error_mean_m"),
        "root force / weight": root_force_share(recording),
        "fell": bool(outcome.summary["fell"] or outcome.diverged),
        "down in the capture": _is_down(character, captured, feet),
        "share saturated": outcome.measured("saturated_fraction"),
        "real-time factor": outcome.measured("real_time_factor"),
    }


def _is_down(character: Character, positions: FloatArray, besides: set[str]) -> bool:
    """True if links other than `besides` touch the ground in any of positions (t, n)."""
    heights = clearances(character, positions)
    return any(heights[name].min() < _TOUCH for name in heights.keys() - besides)


def _draw(result: StudyResult) -> None:
    clips, errors = result.column("clip"), result.column("mean joint error (rad)")
    means, others = result.add_panels(result.name, 2, 1, (11.0, 7.5), same_x=True)
    places = np.arange(len(clips))
    means.bar(places, errors, 0.7, color="tab:blue", label="mean over joints and time")
    marks = means.hlines(result.column("bound (rad)"), places - 0.45, places + 0.45, label="bound")
    marks.set(color="tab:red", linewidth=2.0)
    falls = _named(result, "fell") or "no clip"
    label(means, "", "joint error (rad)", f"tracked with root force and torque: {falls} falls")
    roots = [error or 0.0 for error in result.column("mean root error (m)")]
    others.bar(places - 0.2, roots, 0.4, color="tab:orange", label="mean root error (m)")
    twin, shares = others.twinx(), result.column("root force / weight")
    twin.bar(places + 0.2, shares, 0.4, color="tab:green", label="root force / weight")
    twin.set_ylabel("root force / weight")
    twin.legend(loc="upper right", fontsize="small")
    for panel in (others, twin):
        panel.margins(y=0.2)  # leaves room for the legends
    label(others, "", "root error (m)", legend="upper left")
    others.set_xticks(places, clips, rotation=30, ha="right")


def _draw_poses(result: StudyResult, recordings: Mapping[str, Recording]) -> None:
    """Poses of some clips over one cycle, the capture as a ghost."""
    pictures = {}
    for clip, recording in recordings.items():
        if clip not in _PICTURED_SECONDS:
            continue
        end = float(recording.times[-2])  # the last state has no ghost
        last = min(_PICTURED_SECONDS[clip], end)
        times = np.linspace(0.0, last, _PICTURES).tolist()
        picture = strip(recording, times, ghost=True, size=_SIZE)
        pictures[f"{clip}; the capture in green"] = picture
    result.add_pictures("clips_poses", pictures)
