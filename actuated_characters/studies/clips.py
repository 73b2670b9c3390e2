"""Every motion clip of the humanoid, tracked with root assistance: errors, falls, real time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from actuated_characters.metrics.error_measures import joint_errors
from actuated_characters.render.engine.renderer import Picture
from actuated_characters.render.engine.visual_shapes import outline
from actuated_characters.render.stills import strip
from actuated_characters.studies.framework.plots import label, make_panels, show_pictures
from actuated_characters.studies.framework.study import RunResult, RunSpec, StudyResult, StudyRunner
from controller_node.references.files.clip import available_clips, read_clip
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.geometry import rotations

if TYPE_CHECKING:  # it takes a second to import
    from matplotlib.figure import Figure

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
    force_share: float  # mean root force over the weight

    @property
    def bound(self) -> float:
        return _BOUNDS.get(self.clip, _BOUND)

    @property
    def falls(self) -> bool:
        """Below half its height, or on the ground with what should not be there."""
        down = bool(self.touching) and not self.captured
        return bool(self.outcome.summary["fell"]) or down or bool(self.outcome.diverged)


class ClipsStudy:
    """All clips, each for the same time."""

    name = "clips"
    title = "every clip with root assistance, 10 s each"
    runs = 15

    def run(self, runner: StudyRunner) -> StudyResult:
        """Track each clip and compare its error with the bound."""
        character = load_character(_CHARACTER)
        runs = [_track(runner, character, clip) for clip in available_clips(character)]
        worst = max(runs, key=lambda run: float(run.errors.mean()) / run.bound)
        return StudyResult(
            columns=(
                "clip",
                "loops",
                "mean joint error (rad)",
                "bound (rad)",
                "largest joint error (rad)",
                "mean root error (m)",
                "root force / weight",
                "fell",
                "down in the capture",
                "share saturated",
                "real-time factor",
            ),
            rows=[_row(run) for run in runs],
            figures={
                self.name: _draw(runs),
                "clips_poses": show_pictures(_pictures(runs), columns=1),
            },
            curves={"clips_errors": _curves(runs)},
            notes=(
                f"nearest to its bound: {worst.clip}, {worst.errors.mean():.3f} of "
                f"{worst.bound:g} rad",
                _fall_note(runs),
            ),
        )


def clearances(character: Character, positions: FloatArray) -> Mapping[str, FloatArray]:
    """Height (t,) in m above z = 0 of each link's lowest point, at positions (t, n).

    Exact for spheres, capsules and boxes, of others that of a hull; only links with a shape.
    """
    model, still = DynamicsModel(character), np.zeros(character.layout.size)
    poses = []
    for position in positions:
        model.update(position, still)
        poses.append(model.link_poses())
    origins = np.stack([pose[0] for pose in poses])
    turns = np.stack([pose[1] for pose in poses])
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
    case = RunSpec(clip, _CHARACTER, _DURATION, {"reference": "clip", "clip": clip})
    outcome = runner.run(case)
    run, feet = outcome.recording, set(character.feet)
    parents = {link.name: character.links[link.parent].name for link in character.links[1:]}
    # a shin reaches down to its ankle, and to the ground where the foot turns over
    legs = feet | {parents[foot] for foot in feet}
    desired = run.reference_position[:-1]
    weight = character.mass * float(run.parameters["gravity"])
    return _Tracked(
        clip,
        read_clip(character, clip).wraps,
        outcome,
        joint_errors(run.layout, run.position[:-1], desired),
        _on_the_ground(character, desired[::_EACH], feet),
        _on_the_ground(character, run.position[::_EACH], legs),
        float(np.linalg.norm(run.effort[:, :3], axis=1).mean()) / weight,
    )


def _on_the_ground(
    character: Character, positions: FloatArray, besides: set[str]
) -> tuple[str, ...]:
    heights = clearances(character, positions)
    return tuple(
        name for name, height in heights.items() if name not in besides and height.min() < _TOUCH
    )


def _row(run: _Tracked) -> tuple[str | int | float | bool | None, ...]:
    summary = run.outcome.summary
    return (
        run.clip,
        run.loops,
        float(run.errors.mean()),
        run.bound,
        float(run.errors.max()),
        _number(summary["root_error_mean_m"]),
        run.force_share,
        run.falls,
        bool(run.captured),
        _number(summary["saturated_fraction"]),
        _number(summary["real_time_factor"]),
    )


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) else None


def _fall_note(runs: Sequence[_Tracked]) -> str:
    fallen = [run.clip for run in runs if run.falls]
    down = [run.clip for run in runs if run.captured]
    return (
        f"falls: {', '.join(fallen) or 'none'}; in the capture itself on the ground with more than "
        f"the feet: {', '.join(down) or 'none'}"
    )


def _curves(runs: Sequence[_Tracked]) -> tuple[Sequence[str], FloatArray]:
    """Each clip's joint error over time, mean over the joints; NaN after its end."""
    longest = max(runs, key=lambda run: len(run.errors))
    columns = [longest.outcome.recording.times[: len(longest.errors)]]
    for run in runs:
        errors = run.errors.mean(axis=1)
        missing = len(longest.errors) - len(errors)
        columns.append(np.pad(errors, (0, missing), constant_values=np.nan))
    return ("time_s", *(f"{run.clip}_rad" for run in runs)), np.column_stack(columns)


def _draw(runs: Sequence[_Tracked]) -> "Figure":
    figure, (means, others) = make_panels(2, 1, (11.0, 7.5), same_x=True)
    places = np.arange(len(runs))
    errors = [float(run.errors.mean()) for run in runs]
    means.bar(places, errors, 0.7, color="tab:blue", label="mean over joints and time")
    means.hlines(
        [run.bound for run in runs],
        places - 0.45,
        places + 0.45,
        color="tab:red",
        linewidth=2.0,
        label="bound",
    )
    falls = ", ".join(run.clip for run in runs if run.falls) or "no clip"
    label(means, "", "joint error (rad)", f"tracked with root force and torque: {falls} falls")
    roots = [_number(run.outcome.summary["root_error_mean_m"]) or 0.0 for run in runs]
    others.bar(places - 0.2, roots, 0.4, color="tab:orange", label="mean root error (m)")
    twin = others.twinx()
    twin.bar(
        places + 0.2,
        [run.force_share for run in runs],
        0.4,
        color="tab:green",
        label="root force / weight",
    )
    twin.set_ylabel("root force / weight")
    twin.legend(loc="upper right", fontsize="small")
    for panel in (others, twin):
        panel.margins(y=0.2)  # for the legends
    label(others, "", "root error (m)", legend="upper left")
    others.set_xticks(places, [run.clip for run in runs], rotation=30, ha="right")
    return figure


def _pictures(runs: Sequence[_Tracked]) -> dict[str, Picture]:
    """Poses of some clips over one cycle, the capture as a ghost."""
    pictures = {}
    for run in runs:
        if run.clip in _PICTURED:
            recording = run.outcome.recording
            last = min(_PICTURED[run.clip], float(recording.times[-2]))  # the last has no ghost
            times = np.linspace(0.0, last, _PICTURES).tolist()
            pictures[f"{run.clip}; the capture in green"] = strip(
                recording, times, ghost=True, size=_SIZE
            )
    return pictures


STUDY = ClipsStudy()
