"""Every motion clip of the humanoid, tracked with root assistance: errors, falls, real time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from actuated_characters.render.engine.visual_shapes import outline
from actuated_characters.render.stills import strip
from actuated_characters.studies.framework.plots import label
from actuated_characters.studies.framework.result import Row, StudyResult
from actuated_characters.studies.framework.study import RunResult, RunSpec, Study, StudyRunner
from actuated_characters.studies.framework.tracking import joint_errors, root_force_share
from controller_node.references.files.clip import available_clips, read_clip
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.geometry import rotations

_CHARACTER = "humanoid"
_DURATION = 10.0  # s
_BOUNDS = {"walk": 0.08, "punch": 0.25}  # rad, of the mean joint error ...
_BOUND = 0.12  # ... and of the other clips
_TOUCH = 0.01  # m above the ground, below which a link of the capture is on it
_EACH = 4  # states from one to the next that is looked at for what is on the ground
_PICTURED = {"walk": 1.3, "backflip": 1.75, "cartwheel": 2.72, "punch": 2.2}  # s from the start
_PICTURES, _SIZE = 8, (190, 240)


@dataclass(frozen=True)
class _Tracked:
    """What a run of one clip gave."""

    clip: str
    loops: bool
    outcome: RunResult
    errors: FloatArray  # (t, j) rad
    captured: tuple[str, ...]  # links, besides the feet, on the ground in the capture itself
    touching: tuple[str, ...]  # links, besides feet and shins, on the ground in the run

    @property
    def bound(self) -> float:
        return _BOUNDS.get(self.clip, _BOUND)

    @property
    def falls(self) -> bool:
        """Below half its height, or on the ground with what should not be there."""
        down = bool(self.touching) and not self.captured
        return bool(self.outcome.summary["fell"]) or down or bool(self.outcome.diverged)


def _fill(runner: StudyRunner, result: StudyResult) -> None:
    """Track each clip for the same time, and compare its error with the bound."""
    character = load_character(_CHARACTER)
    runs = [_track(runner, character, clip) for clip in available_clips(character)]
    result.rows += [_row(run) for run in runs]
    _draw(result, runs)
    _draw_poses(result, runs)
    times = max((run.outcome.recording.times for run in runs), key=len)[:-1]
    curves = {f"{run.clip}_rad": run.errors.mean(axis=1) for run in runs}
    result.add_curves("clips_errors", {"time_s": times, **curves})
    worst = max(runs, key=lambda run: float(run.errors.mean()) / run.bound)
    fallen = ", ".join(run.clip for run in runs if run.falls) or "none"
    down = ", ".join(run.clip for run in runs if run.captured) or "none"
    result.notes += [
        f"nearest to its bound: {worst.clip}, {worst.errors.mean():.3f} of {worst.bound:g} rad",
        f"falls: {fallen}; in the capture itself on the ground with more than the feet: {down}",
    ]


def clearances(character: Character, positions: FloatArray) -> Mapping[str, FloatArray]:
    """Height (t,) in m above z = 0 of each link's lowest point, at positions (t, n).

    Exact for spheres, capsules and boxes, of others that of a hull; only links with a shape.
    """
    model, still = DynamicsModel(character), np.zeros(character.layout.size)
    origins = np.empty((len(positions), len(character.links), 3))
    turns = np.empty((*origins.shape[:2], 4))
    for row, position in enumerate(positions):
        model.update(position, still)
        origins[row], turns[row] = model.link_poses()
    lowest: dict[str, FloatArray] = {}
    for row, link in enumerate(character.links):
        if not link.shapes:
            continue
        outlines = [outline(shape) for shape in link.shapes]
        centres = np.concatenate([points for points, _ in outlines])
        radii = np.concatenate([own for _, own in outlines])
        heights = rotations.rotate(turns[:, row, np.newaxis], centres)[..., 2] - radii
        lowest[link.name] = origins[:, row, 2] + heights.min(axis=1)
    return lowest


def _track(runner: StudyRunner, character: Character, clip: str) -> _Tracked:
    reference = {"reference": "clip", "clip": clip}
    outcome = runner.run(RunSpec(clip, _CHARACTER, _DURATION, reference))
    run, feet = outcome.recording, set(character.feet)
    parents = {link.name: character.links[link.parent].name for link in character.links[1:]}
    # a shin reaches down to its ankle, and to the ground where the foot turns over
    legs = feet | {parents[foot] for foot in feet}
    return _Tracked(
        clip,
        read_clip(character, clip).wraps,
        outcome,
        joint_errors(run)[:-1],
        _on_the_ground(character, run.reference_position[:-1:_EACH], feet),
        _on_the_ground(character, run.position[::_EACH], legs),
    )


def _on_the_ground(
    character: Character, positions: FloatArray, besides: set[str]
) -> tuple[str, ...]:
    heights = clearances(character, positions)
    return tuple(
        name for name, height in heights.items() if name not in besides and height.min() < _TOUCH
    )


def _row(run: _Tracked) -> Row:
    measured = run.outcome.measured
    return {
        "clip": run.clip,
        "loops": run.loops,
        "mean joint error (rad)": float(run.errors.mean()),
        "bound (rad)": run.bound,
        "largest joint error (rad)": float(run.errors.max()),
        "mean root error (m)": measured("root_error_mean_m"),
        "root force / weight": root_force_share(run.outcome.recording),
        "fell": run.falls,
        "down in the capture": bool(run.captured),
        "share saturated": measured("saturated_fraction"),
        "real-time factor": measured("real_time_factor"),
    }


def _draw(result: StudyResult, runs: Sequence[_Tracked]) -> None:
    means, others = result.add_panels(result.name, 2, 1, (11.0, 7.5), same_x=True)
    places = np.arange(len(runs))
    errors = [float(run.errors.mean()) for run in runs]
    means.bar(places, errors, 0.7, color="tab:blue", label="mean over joints and time")
    bounds = [run.bound for run in runs]
    means.hlines(
        bounds, places - 0.45, places + 0.45, color="tab:red", linewidth=2.0, label="bound"
    )
    falls = ", ".join(run.clip for run in runs if run.falls) or "no clip"
    label(means, "", "joint error (rad)", f"tracked with root force and torque: {falls} falls")
    roots = [run.outcome.measured("root_error_mean_m") or 0.0 for run in runs]
    others.bar(places - 0.2, roots, 0.4, color="tab:orange", label="mean root error (m)")
    twin = others.twinx()
    shares = [root_force_share(run.outcome.recording) for run in runs]
    twin.bar(places + 0.2, shares, 0.4, color="tab:green", label="root force / weight")
    twin.set_ylabel("root force / weight")
    twin.legend(loc="upper right", fontsize="small")
    for panel in (others, twin):
        panel.margins(y=0.2)  # for the legends
    label(others, "", "root error (m)", legend="upper left")
    others.set_xticks(places, [run.clip for run in runs], rotation=30, ha="right")


def _draw_poses(result: StudyResult, runs: Sequence[_Tracked]) -> None:
    """Poses of some clips over one cycle, the capture as a ghost."""
    pictures = {}
    for run in runs:
        if run.clip in _PICTURED:
            recording = run.outcome.recording
            last = min(_PICTURED[run.clip], float(recording.times[-2]))  # the last has no ghost
            times = np.linspace(0.0, last, _PICTURES).tolist()
            picture = strip(recording, times, ghost=True, size=_SIZE)
            pictures[f"{run.clip}; the capture in green"] = picture
    result.add_pictures("clips_poses", pictures)


STUDY = Study("clips", "every clip with root assistance, 10 s each", runs=15, fill=_fill)
