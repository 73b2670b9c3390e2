"""Standing without assistance: for how long, and the largest pushes that it survives."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.render.stills import pose_strip
from actuated_characters.runs.planned_wrenches import PlannedPush
from actuated_characters.studies.framework.study import RunResult, RunSpec, StudyResult, StudyRunner
from msgs_config.arrays import BoolArray
from msgs_config.geometry import rotations
from msgs_config.messages.clock import TickClock

if TYPE_CHECKING:  # it takes a second to import
    from matplotlib.figure import Figure

_RATE = 240  # Hz
_PUSH_TIME, _PUSH_DURATION = 1.0, 0.1  # s
_PUSHED, _STANDING = 6.0, 60.0  # s, length of the runs
_LINK = "chest"
_LARGEST, _RESOLUTION = 32.0, 0.5  # N s
_STANDS = 0.8  # of the height at the beginning
_UPRIGHT = 0.7  # cosine of the trunk's tilt
_DIRECTIONS = {
    "forward": (1.0, 0.0),
    "backward": (-1.0, 0.0),
    "left": (0.0, 1.0),
    "right": (0.0, -1.0),
}
_SOFT_HIPS = {
    f"gains.{side}_hip.{kind}": gain
    for side in ("right", "left")
    for kind, gain in (("p", 70.0), ("d", 25.0))
}  # with stiff ones the trunk could not give way


@dataclass(frozen=True)
class _Limit:
    """What bisection has found in one direction."""

    survived: float  # N s
    fell: float  # N s
    strongest: RunResult  # the run with the largest impulse that it survived


class BalanceStudy:
    """The humanoid on its own feet, by joint efforts alone."""

    name = "balance"
    title = "balance without assistance: pushes at the chest, 0.1 s"
    runs = 2 + 7 * len(_DIRECTIONS)

    def run(self, runner: StudyRunner) -> StudyResult:
        """Stand with and without the virtual force, then be pushed harder and harder."""
        stood = runner.run(_case("stand", _STANDING))
        limp = runner.run(_case("without", _PUSHED, {"balance.enabled": False}))
        limits = {name: _largest_impulse(runner, name) for name in _DIRECTIONS}
        mass = stood.recording.character.mass
        rows = [
            (name, limit.survived, limit.fell, limit.survived / mass)
            for name, limit in limits.items()
        ]
        falls = standing_time(limp.recording)
        return StudyResult(
            columns=("direction", "survives (N s)", "falls (N s)", "change of speed (m/s)"),
            rows=rows,
            figures={
                self.name: _draw(stood.recording, limp.recording, limits),
                "balance_poses": _draw_poses(limp.recording, limits),
            },
            notes=(
                f"with the virtual force it stands {standing_time(stood.recording):.4g} s of "
                f"{_STANDING:g} s; by stable PD alone {falls:.3g} s",
            ),
        )


def stands(recording: Recording) -> BoolArray:
    """In which states (t + 1,) the root is not lower than 0.8 of its height at the beginning."""
    height = recording.position[:, 2]
    standing: BoolArray = height > _STANDS * height[0]
    return standing


def is_upright(recording: Recording) -> bool:
    """Whether the trunk is at most 45 degrees from where it was at first, at the end."""
    first, last = rotations.exp(recording.position[[0, -1], 3:6])
    up = np.array((0.0, 0.0, 1.0))
    own_up = rotations.rotate(rotations.conjugate(first), up)
    return bool(rotations.rotate(last, own_up)[2] > _UPRIGHT)


def standing_time(recording: Recording) -> float:
    """Time in s until it does not stand any more."""
    standing = stands(recording)
    last = len(standing) if standing.all() else int(np.argmin(standing))
    return float(recording.times[last - 1])


def survives(outcome: RunResult) -> bool:
    """Whether it stood all the time, and is upright in the end."""
    run = outcome.recording
    return not outcome.diverged and bool(stands(run).all()) and is_upright(run)


def _case(
    label: str,
    duration: float,
    controller: Mapping[str, object] | None = None,
    impulse: tuple[float, float] = (0.0, 0.0),
) -> RunSpec:
    stamp = TickClock(_RATE).stamp_ns(1 + round(_PUSH_TIME * _RATE))
    force = (impulse[0] / _PUSH_DURATION, impulse[1] / _PUSH_DURATION, 0.0)
    push = PlannedPush(stamp, _LINK, (*force, 0.0, 0.0, 0.0))
    return RunSpec(
        label,
        "humanoid",
        duration,
        reference={"reference": "keyframes", "keyframes": "humanoid_stand"},
        simulator={"rate": _RATE, "wrench_duration": _PUSH_DURATION},
        controller={
            "root_assistance": False,
            "balance.enabled": True,
            **_SOFT_HIPS,
            **(controller or {}),
        },
        pushes=[push] if any(impulse) else [],
    )


def _largest_impulse(runner: StudyRunner, direction: str) -> _Limit:
    """Bisect between no push and one that throws anybody over."""
    x, y = _DIRECTIONS[direction]

    def pushed(impulse: float) -> RunResult:
        label = f"{direction}_{impulse:g}Ns"
        return runner.run(_case(label, _PUSHED, impulse=(impulse * x, impulse * y)))

    low, high, strongest = 0.0, _LARGEST, None
    while high - low > _RESOLUTION:
        middle = 0.5 * (low + high)
        outcome = pushed(middle)
        if survives(outcome):
            low, strongest = middle, outcome
        else:
            high = middle
    return _Limit(low, high, strongest or pushed(0.0))


def _draw(stood: Recording, limp: Recording, limits: Mapping[str, _Limit]) -> "Figure":
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 7), layout="constrained")
    heights, sways, bars = figure.subplots(3)
    heights.plot(stood.times, stood.position[:, 2], label="with the virtual force")
    heights.plot(limp.times, limp.position[:, 2], label="stable PD alone")
    heights.set_xlabel("time (s)")
    heights.set_ylabel("root height (m)")
    heights.legend()
    for name, limit in limits.items():
        run = limit.strongest.recording
        axis = 0 if name in ("forward", "backward") else 1
        moved = run.position[:, axis] - run.position[0, axis]
        sways.plot(run.times, moved, label=f"{name}, {limit.survived:g} N s")
    sways.axvspan(_PUSH_TIME, _PUSH_TIME + _PUSH_DURATION, color="0.85")
    sways.set_xlabel("time (s)")
    sways.set_ylabel("root moved (m)")
    sways.legend(ncols=2, loc="upper left")
    bars.barh(list(limits), [limit.survived for limit in limits.values()])
    bars.set_xlabel("largest impulse that it survives (N s)")
    for panel in (heights, sways, bars):
        panel.grid(alpha=0.3)
    figure.suptitle("the humanoid on its own feet: no root force, no root torque")
    return figure


def _draw_poses(limp: Recording, limits: Mapping[str, _Limit]) -> "Figure":
    """The fall without the virtual force, and the recovery from the largest push forward."""
    from matplotlib.figure import Figure

    strongest = limits["forward"]
    figure = Figure(figsize=(12, 6), layout="constrained")
    for panel, run, times, title in zip(
        figure.subplots(2),
        (limp, strongest.strongest.recording),
        (np.linspace(0.0, 2.5, 6), np.linspace(1.0, 3.5, 6)),
        ("stable PD alone", f"virtual force, pushed forward by {strongest.survived:g} N s at 1 s"),
        strict=True,
    ):
        rows = np.searchsorted(run.times, times).clip(max=len(run.times) - 1)
        captions = [f"{time:.1f} s" for time in times]
        panel.imshow(pose_strip(run.character, run.position[rows], captions))
        panel.set_title(title)
        panel.set_axis_off()
    return figure


STUDY = BalanceStudy()
