"""Standing without assistance: for how long, and the largest pushes that it survives."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.render.stills import pose_strip
from lecture.framework.result import StudyResult
from lecture.framework.study import (
    RunResult,
    RunSpec,
    StudyRunner,
    plan_push,
)
from msgs_config.arrays import BoolArray
from msgs_config.geometry import rotations

TITLE = "balance without assistance: pushes at the chest, 0.1 s"
RUNS = 30

_RATE = 240  # Hz
_PUSH_TIME, _PUSH_DURATION = 1.0, 0.1  # s
_PUSHED_TIME, _STANDING_TIME = 6.0, 60.0  # s, length of the runs
_LINK = "chest"
_MAX_IMPULSE, _IMPULSE_RESOLUTION = 32.0, 0.5  # N s
_STANDING_HEIGHT = 0.8  # share of the height at the beginning
_UPRIGHT_COSINE = 0.7  # cosine of the trunk's tilt
_DIRECTIONS = {
    "forward": (1.0, 0.0),
    "backward": (-1.0, 0.0),
    "left": (0.0, 1.0),
    "right": (0.0, -1.0),
}
HIPS: Mapping[str, object] = {  # with stiff ones the trunk could not give way
    **{f"gains.{side}_hip.p": 70.0 for side in ("right", "left")},
    **{f"gains.{side}_hip.d": 25.0 for side in ("right", "left")},
}
_PARAMETERS: Mapping[str, object] = {
    "root_assistance": False,
    "balance.enabled": True,
    **HIPS,
}


@dataclass(frozen=True)
class _Limit:
    """The result of the bisection in one direction."""

    survived: float  # N s
    fell: float  # N s
    strongest: RunResult  # the run with the largest impulse that it survived


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Stand with and without the virtual force, then be pushed harder and harder.

    By joint efforts alone.
    """
    stood = runner.run(_case("stand", _STANDING_TIME)).recording
    limp = runner.run(_case("without", _PUSHED_TIME, {"balance.enabled": False})).recording
    limits = {name: _largest_impulse(runner, name) for name in _DIRECTIONS}
    result.rows += [
        {
            "direction": name,
            "survives (N s)": limit.survived,
            "falls (N s)": limit.fell,
            "change of speed (m/s)": limit.survived / stood.character.mass,
        }
        for name, limit in limits.items()
    ]
    _draw(result, stood, limp, limits)
    _draw_poses(result, limp, limits["forward"])
    result.remarks.append(
        f"with the virtual force it stands {standing_time(stood):.4g} s of {_STANDING_TIME:g} s; "
        f"by stable PD alone {standing_time(limp):.3g} s"
    )


def stands(recording: Recording) -> BoolArray:
    """In which states (t + 1,) the root is not lower than 0.8 of its height at the beginning."""
    height = recording.position[:, 2]
    standing: BoolArray = height > _STANDING_HEIGHT * height[0]
    return standing


def is_upright(recording: Recording) -> bool:
    """True if the trunk has tilted by at most 45 degrees at the end of a run."""
    first, last = rotations.exp(recording.position[[0, -1], 3:6])
    up = np.array((0.0, 0.0, 1.0))
    own_up = rotations.rotate(rotations.conjugate(first), up)
    return bool(rotations.rotate(last, own_up)[2] > _UPRIGHT_COSINE)


def standing_time(recording: Recording) -> float:
    """Time in s until it does not stand any more."""
    standing = stands(recording)
    last = len(standing) if standing.all() else int(np.argmin(standing))
    return float(recording.times[last - 1])


def survives(outcome: RunResult) -> bool:
    """True if the character stood all the time and is upright at the end."""
    run = outcome.recording
    return not outcome.diverged and bool(stands(run).all()) and is_upright(run)


def _case(
    label: str,
    duration: float,
    controller: Mapping[str, object] | None = None,
    impulse: tuple[float, float] = (0.0, 0.0),
) -> RunSpec:
    force = (impulse[0] / _PUSH_DURATION, impulse[1] / _PUSH_DURATION, 0.0)
    return RunSpec(
        label,
        "humanoid",
        duration,
        reference={"reference": "keyframes", "keyframes": "humanoid_stand"},
        simulator={"rate": _RATE, "wrench_duration": _PUSH_DURATION},
        controller={**_PARAMETERS, **(controller or {})},
        pushes=[plan_push(_PUSH_TIME, _RATE, _LINK, force)] if any(impulse) else [],
    )


def _largest_impulse(runner: StudyRunner, direction: str) -> _Limit:
    """Bisect between no push and one that is too strong in every direction."""
    x, y = _DIRECTIONS[direction]

    def pushed(impulse: float) -> RunResult:
        label = f"{direction}_{impulse:g}Ns"
        return runner.run(_case(label, _PUSHED_TIME, impulse=(impulse * x, impulse * y)))

    low, high, strongest = 0.0, _MAX_IMPULSE, None
    while high - low > _IMPULSE_RESOLUTION:
        middle = 0.5 * (low + high)
        outcome = pushed(middle)
        if survives(outcome):
            low, strongest = middle, outcome
        else:
            high = middle
    return _Limit(low, high, strongest or pushed(0.0))


def _draw(
    result: StudyResult, stood: Recording, limp: Recording, limits: Mapping[str, _Limit]
) -> None:
    title = "the humanoid on its own feet: no root force, no root torque"
    heights, sways, bars = result.add_panels(result.name, 3, 1, (10.0, 7.0), title=title)
    heights.plot(stood.times, stood.position[:, 2], label="with the virtual force")
    heights.plot(limp.times, limp.position[:, 2], label="stable PD alone")
    heights.set(xlabel="time (s)", ylabel="root height (m)")
    heights.legend()
    for name, limit in limits.items():
        run = limit.strongest.recording
        axis = 0 if name in ("forward", "backward") else 1
        moved = run.position[:, axis] - run.position[0, axis]
        sways.plot(run.times, moved, label=f"{name}, {limit.survived:g} N s")
    sways.axvspan(_PUSH_TIME, _PUSH_TIME + _PUSH_DURATION, color="0.85")
    sways.set(xlabel="time (s)", ylabel="root moved (m)")
    sways.legend(ncols=2, loc="upper left")
    bars.barh(list(limits), [limit.survived for limit in limits.values()])
    bars.set_xlabel("largest impulse that it survives (N s)")
    for panel in (heights, sways, bars):
        panel.grid(alpha=0.3)


def _draw_poses(result: StudyResult, limp: Recording, forward: _Limit) -> None:
    """The fall without the virtual force, and the recovery from the largest push forward."""
    pushed = f"virtual force, pushed forward by {forward.survived:g} N s at 1 s"
    panels = result.add_panels("balance_poses", 2, 1, (12.0, 6.0))
    for panel, run, start, title in (
        (panels[0], limp, 0.0, "stable PD alone"),
        (panels[1], forward.strongest.recording, 1.0, pushed),
    ):
        times = np.linspace(start, start + 2.5, 6)
        rows = np.searchsorted(run.times, times).clip(max=len(run.times) - 1)
        captions = [f"{time:.1f} s" for time in times]
        panel.imshow(pose_strip(run.character, run.position[rows], captions))
        panel.set_title(title)
        panel.set_axis_off()
