"""What the lecture's root force and torque do: the walk with less and less of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.render.stills import strip
from actuated_characters.studies.framework.plots import label
from actuated_characters.studies.framework.result import StudyResult
from actuated_characters.studies.framework.study import WALK, RunSpec, Study, StudyRunner
from actuated_characters.studies.framework.tracking import (
    fall_time,
    joint_errors,
    root_force_share,
)
from msgs_config.character.layout import ROOT
from msgs_config.character.loading import load_character
from msgs_config.character.model import ROOT_TORQUE, Character

_CHARACTER = "humanoid"
_STRENGTHS = (1.0, 0.3, 0.1, 0.03, 0.01, 0.0)  # of root force and torque
_DURATION = 5.0  # s
_SMALLEST = 0.003  # where no assistance is drawn on an axis that has no zero
_PICTURES, _SIZE = 8, (190, 240)


@dataclass(frozen=True)
class _Walk:
    """What became of the walk with assistance of one strength."""

    name: str
    strength: float  # share of the character's own stiffness
    run: Recording
    fall: float | None  # s
    joint_error: float  # rad, mean until the fall
    root_error: float  # m, mean until the fall
    force_share: float  # mean root force over the weight until the fall


def _fill(runner: StudyRunner, result: StudyResult) -> None:
    """Walk with each strength of root force and torque, and with a root without commands."""
    character = load_character(_CHARACTER)
    walks = [
        _walk(runner, f"x {strength:g}", strength, weakened(character, strength))
        for strength in _STRENGTHS
    ]
    walks.append(_walk(runner, "none", 0.0, {"root_assistance": False}))
    result.rows += [
        {
            "root stiffness": walk.name,
            "falls at (s)": walk.fall,
            "mean joint error until then (rad)": walk.joint_error,
            "mean root error until then (m)": walk.root_error,
            "root force / weight until then": walk.force_share,
        }
        for walk in walks
    ]
    _draw(result, walks[:-1])
    _draw_poses(result, walks[-1], walks[0])
    longest = max((walk.run for walk in walks), key=lambda run: len(run.times))
    result.add_curves(
        "assistance_height",
        {
            "time_s": longest.times,
            "reference_m": longest.reference_position[:, 2],
            **{f"{walk.name.replace(' ', '')}_m": walk.run.position[:, 2] for walk in walks},
        },
    )
    zero, none = walks[-2:]
    same = np.array_equal(none.run.position, zero.run.position)
    result.notes += [
        f"without assistance it falls at {none.fall:.3g} s: 28 motors cannot hold 34 degrees of "
        "freedom on a path that was not planned for them (underactuation)"
        if none.fall is not None
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


def _walk(runner: StudyRunner, name: str, strength: float, controller: dict[str, object]) -> _Walk:
    case = RunSpec(name.replace(" ", ""), _CHARACTER, _DURATION, WALK, controller=controller)
    run = runner.run(case).recording
    fall = fall_time(run)
    until = len(run.effort) if fall is None else int(np.searchsorted(run.times, fall))
    off = run.position[:until, :3] - run.reference_position[:until, :3]
    return _Walk(
        name,
        strength,
        run,
        fall,
        float(joint_errors(run)[:until].mean()),
        float(np.linalg.norm(off, axis=1).mean()),
        root_force_share(run, until),
    )


def _draw(result: StudyResult, walks: Sequence[_Walk]) -> None:
    title = "the walk needs a force that no motor gives"
    panels = result.add_panels(result.name, 2, 2, (12.0, 7.5), title=title)
    strengths = [max(walk.strength, _SMALLEST) for walk in walks]
    falls, errors, forces, heights = panels
    for walk, place in zip(walks, strengths, strict=True):
        held = walk.fall is None
        falls.plot(place, walk.fall or _DURATION, "^" if held else "o", color="tab:blue")
    falls.plot(strengths, [walk.fall or _DURATION for walk in walks], color="tab:blue")
    falls.plot([], [], "^", color="tab:blue", label=f"does not fall within {_DURATION:g} s")
    label(falls, "strength of assistance", "time of the fall (s)")
    joints = [walk.joint_error for walk in walks]
    errors.plot(strengths, joints, "o-", label="joints (rad)")
    errors.plot(strengths, [walk.root_error for walk in walks], "s-", label="root (m)")
    label(errors, "strength of assistance", "mean error until the fall")
    forces.plot(strengths, [walk.force_share for walk in walks], "o-", color="tab:green")
    label(forces, "strength of assistance", "root force / weight until the fall", legend=None)
    for panel in (falls, errors, forces):
        panel.set_xscale("log")
        ticks = [f"{walk.strength:g}" for walk in walks]
        panel.set_xticks(strengths, ticks)
        panel.set_xticks([], minor=True)
        panel.set_ylim(bottom=0.0)
    for walk in walks:
        heights.plot(walk.run.times, walk.run.position[:, 2], label=walk.name)
    heights.plot(
        walks[0].run.times, walks[0].run.reference_position[:, 2], "k--", label="reference"
    )
    label(heights, "time (s)", "root height (m)", legend="center right")
    heights.set_xlim(right=1.3 * _DURATION)  # for the legend


def _draw_poses(result: StudyResult, none: _Walk, full: _Walk) -> None:
    """The fall without assistance, and the same times with all of it."""
    end = min(1.5 * (none.fall or _DURATION), float(none.run.times[-2]))
    times = np.linspace(0.0, end, _PICTURES).tolist()
    pictures = {
        f"{named}; the reference in green": strip(walk.run, times, ghost=True, size=_SIZE)
        for named, walk in (("without assistance", none), ("with root force and torque", full))
    }
    result.add_pictures("assistance_poses", pictures)


STUDY = Study(
    "assistance",
    "the walk by strength of root force and torque",
    runs=len(_STRENGTHS) + 1,
    fill=_fill,
)
