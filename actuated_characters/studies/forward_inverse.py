"""Inverse dynamics fed forward: what it gives back on a fixed base, and why not on a floating one.

With as many actuators as degrees of freedom there are efforts for any motion; with fewer, the
motion needs root forces that no joint gives.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import yaml

from actuated_characters.runs.plan import make_plan
from actuated_characters.studies.framework.motion_replay import (
    effort_table,
    efforts_along,
    errors_of,
    orders,
)
from actuated_characters.studies.framework.plots import THEORY, label, make_panels
from actuated_characters.studies.framework.study import (
    Cell,
    RunResult,
    RunSpec,
    StudyResult,
    StudyRunner,
)
from controller_node.references.files.clip import read_clip
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.dynamics import DynamicsModel

if TYPE_CHECKING:  # it takes a second to import
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ARM, _HUMANOID = "kuka", "humanoid"
_ARM_RATES, _WALK_RATES = (120, 240, 480, 960, 1920), (240, 480, 960)  # Hz
_ARM_LENGTH, _WALK_LENGTH = 1.2, 1.5  # s
_EARLY = 0.2  # s, after which errors are compared; later they are as large as can be
_KEYFRAMES = {  # the arm's: time in s, angles in rad
    0.0: {},
    0.6: {"joint_1": 0.6, "joint_2": 0.2, "joint_4": -1.0, "joint_6": 0.4},
    1.2: {"joint_1": -0.2, "joint_2": 0.8, "joint_4": -1.7, "joint_5": 0.5},
}
_CLIP, _A_CYCLE, _CYCLES = "walk", 12, 1.5  # keyframes a cycle of the clip
_COLUMNS = (
    "character",
    "ground",
    "root efforts",
    "rate (Hz)",
    "joint error after 0.2 s (rad)",
    "order in the tick",
    "joint error at the end (rad)",
    "largest root error (m)",
    "fell",
)


@dataclass(frozen=True)
class _Motion:
    """What is to be done."""

    character: str
    keyframes: str  # path of their file
    duration: float  # s

    @property
    def reference(self) -> dict[str, object]:
        """The parameters that say it."""
        return {"reference": "keyframes", "keyframes": self.keyframes}


@dataclass(frozen=True)
class _Inverse:
    """What inverse dynamics says of a motion at a rate."""

    motion: _Motion
    rate: int  # Hz
    times: FloatArray  # (t,) s
    efforts: FloatArray  # (t, n)
    weight: float  # N
    file: str  # what the law `feedforward` reads


@dataclass(frozen=True)
class _Return:
    """What came back of a motion whose inverse dynamics was fed forward."""

    inverse: _Inverse
    outcome: RunResult
    root: str  # what was done with the root efforts
    ground: bool

    @property
    def early(self) -> float:
        """The mean joint error (rad) after `_EARLY`."""
        times, error = errors_of(self.outcome.recording)
        return float(np.interp(_EARLY, times, error))


class ForwardInverseStudy:
    """When inverse dynamics is the inverse of the simulation."""

    name = "forward_inverse"
    title = "inverse dynamics of a motion, fed forward without feedback"
    runs = len(_ARM_RATES) + len(_WALK_RATES) + 1

    def run(self, runner: StudyRunner) -> StudyResult:
        """An arm and a walk in the air at several rates; the walk on the ground by its joints."""
        arm = _Motion(_ARM, _arm_keyframes(runner), _ARM_LENGTH)
        keyframes, cycle = _walk_keyframes(runner)
        walk = _Motion(_HUMANOID, keyframes, _WALK_LENGTH)
        arms = [_give_back(runner, _invert(runner, arm, rate)) for rate in _ARM_RATES]
        inverses = [_invert(runner, walk, rate) for rate in _WALK_RATES]
        whole = [_give_back(runner, each, root="fed forward", ground=False) for each in inverses]
        joints = _give_back(runner, inverses[0], root="left out")
        return StudyResult(
            columns=_COLUMNS,
            rows=[*_rows(arms), *_rows(whole), *_rows([joints])],
            figures={
                "forward_inverse_errors": _draw_errors(arms, whole, joints),
                "forward_inverse_root": _draw_root(inverses[-1], cycle, whole[-1], joints),
            },
            curves=_curves([*arms, *whole, joints], inverses[-1]),
            notes=_notes(arms, whole, inverses[-1], cycle),
        )


def _arm_keyframes(runner: StudyRunner) -> str:
    return _write_keyframes(
        runner,
        _ARM,
        [
            (time, {f"lbr_iiwa_{name}": angle for name, angle in pose.items()})
            for time, pose in _KEYFRAMES.items()
        ],
    )


def _walk_keyframes(runner: StudyRunner) -> tuple[str, float]:
    """The clip as a smooth motion, from rest; the file, and the time in s of a cycle.

    The clip itself is linear between its frames: its velocity jumps, for which no effort is
    large enough.
    """
    plan = make_plan(_HUMANOID, _WALK_LENGTH, {"reference": "clip", "clip": _CLIP}, {}, {})
    cycle = float(read_clip(plan.character, _CLIP).times[-1])
    names, keyframes = plan.character.layout.dof_names, []
    for number in range(round(_A_CYCLE * _CYCLES) + 1):
        time = number * cycle / _A_CYCLE
        position = plan.reference.sample(time).configuration.position
        keyframes.append((time, dict(zip(names, position.tolist(), strict=True))))
    return _write_keyframes(runner, _HUMANOID, keyframes), cycle


def _write_keyframes(
    runner: StudyRunner, character: str, keyframes: Sequence[tuple[float, Mapping[str, float]]]
) -> str:
    content = {
        "interpolation": "smooth",
        "keyframes": [{"time": time, "pose": dict(pose)} for time, pose in keyframes],
    }
    return runner.write(f"{character}_keyframes.yaml", yaml.safe_dump(content))


def _invert(runner: StudyRunner, motion: _Motion, rate: int) -> _Inverse:
    """Inverse dynamics at each tick of a run."""
    plan = make_plan(motion.character, motion.duration, motion.reference, {"rate": rate}, {})
    model = DynamicsModel(plan.character)
    times = np.arange(plan.ticks) / rate
    efforts = efforts_along(model, plan.reference, times, 1.0 / rate)
    table = effort_table(plan.character.layout, times, efforts)
    file = runner.write(f"{motion.character}_{rate}_efforts.csv", table)
    return _Inverse(motion, rate, times, efforts, model.weight, file)


def _give_back(
    runner: StudyRunner, inverse: _Inverse, *, root: str = "none", ground: bool = True
) -> _Return:
    """Feed efforts forward; the root's only if that is what is said of them."""
    motion = inverse.motion
    outcome = runner.run(
        RunSpec(
            label=f"{motion.character}-{inverse.rate}{'' if ground else '-air'}",
            character=motion.character,
            duration=motion.duration,
            reference=motion.reference,
            simulator={"rate": inverse.rate, "terrain": "plane" if ground else "none"},
            controller={
                "law": "feedforward",
                "feedforward": inverse.file,
                "root_assistance": root == "fed forward",
            },
        )
    )
    return _Return(inverse, outcome, root, ground)


def _rows(returns: Sequence[_Return]) -> list[list[Cell]]:
    steps: list[float | None] = [
        None,
        *orders([1.0 / each.inverse.rate for each in returns], [each.early for each in returns]),
    ]
    rows: list[list[Cell]] = []
    for each, step in zip(returns, steps, strict=True):
        summary = each.outcome.summary
        farthest, fell = summary["root_error_max_m"], summary["fell"]
        rows.append(
            [
                each.inverse.motion.character,
                "yes" if each.ground else "no",
                each.root,
                each.inverse.rate,
                each.early,
                step,
                float(errors_of(each.outcome.recording)[1][-1]),
                farthest if isinstance(farthest, float) else None,
                fell if isinstance(fell, bool) else None,
            ]
        )
    return rows


def within_a_cycle(times: FloatArray, cycle: float) -> BoolArray:
    """Which times (t,) are in one cycle (s), after the walk has set off from rest."""
    start = cycle / _A_CYCLE
    inside: BoolArray = (times >= start) & (times < start + cycle)
    return inside


def _notes(
    arms: Sequence[_Return], whole: Sequence[_Return], inverse: _Inverse, cycle: float
) -> list[str]:
    vertical = float(inverse.efforts[within_a_cycle(inverse.times, cycle), 2].mean())
    return [
        "The arm has a motor for each degree of freedom: its motion comes back, but for an error "
        f"in proportion to the tick ({arms[0].early:.2g} rad at {arms[0].inverse.rate} Hz, "
        f"{arms[-1].early:.2g} rad at {arms[-1].inverse.rate} Hz, after {_EARLY:g} s).",
        f"So does the walk in the air ({whole[0].early:.2g} rad and {whole[-1].early:.2g} rad), if "
        "the root gets its force and torque, too. What error there is grows without feedback.",
        f"That force is {vertical:.0f} N upwards in the mean over a cycle; the weight is "
        f"{inverse.weight:.0f} N. No joint gives it. Left out, the humanoid falls.",
    ]


def _curves(
    returns: Sequence[_Return], inverse: _Inverse
) -> dict[str, tuple[list[str], FloatArray]]:
    curves = {}
    for each in returns:
        ground = "" if each.ground else "_air"
        name = f"forward_inverse_{each.inverse.motion.character}_{each.inverse.rate}{ground}"
        errors = np.column_stack(errors_of(each.outcome.recording))
        curves[name] = (["time_s", "joint_error_rad"], errors)
    curves["forward_inverse_root"] = (
        ["time_s", "root_force_n", "root_torque_nm"],
        np.column_stack([inverse.times, *_root_norms(inverse)]),
    )
    return curves


def _root_norms(inverse: _Inverse) -> tuple[FloatArray, FloatArray]:
    """Size of the root's force (t,) in N and torque (t,) in N m."""
    force: FloatArray = np.linalg.norm(inverse.efforts[:, :3], axis=1)
    torque: FloatArray = np.linalg.norm(inverse.efforts[:, 3:6], axis=1)
    return force, torque


def _draw_errors(arms: Sequence[_Return], whole: Sequence[_Return], joints: _Return) -> "Figure":
    figure, panels = make_panels(1, 3, (12.0, 4.2))
    titles = ("arm (kuka)", "walk in the air, with root efforts")
    for axes, returns, title in zip(panels, (arms, whole), titles, strict=False):
        for each in returns:
            times, error = errors_of(each.outcome.recording)
            axes.semilogy(times[1:], error[1:], label=f"{each.inverse.rate} Hz")
        axes.set_ylim(1e-6, 5.0)
        axes.axvline(_EARLY, color="grey", linewidth=0.8, linestyle=":")
        label(axes, "time (s)", "mean joint error (rad)", title, legend="lower right")
    times, error = errors_of(joints.outcome.recording)
    panels[1].semilogy(times[1:], error[1:], color="black", label="without, on the ground")
    panels[1].legend(loc="lower right", fontsize="small")
    _draw_orders(panels[2], {"arm": arms, "walk in the air": whole})
    return figure


def _draw_orders(axes: "Axes", families: Mapping[str, Sequence[_Return]]) -> None:
    for name, returns in families.items():
        ticks = np.array([1e3 / each.inverse.rate for each in returns])  # ms
        errors = np.array([each.early for each in returns])
        axes.loglog(ticks, errors, "o", label=name)
        axes.loglog(ticks, errors[-1] * ticks / ticks[-1], **THEORY)
    axes.plot([], [], **THEORY, label="in proportion")
    axes.minorticks_off()
    shown = [0.5, 1.0, 2.0, 4.0, 8.0]
    axes.set_xticks(shown, [f"{tick:g}" for tick in shown])
    label(axes, "tick (ms)", f"error after {_EARLY:g} s (rad)", "the error shrinks with the tick")


def _draw_root(inverse: _Inverse, cycle: float, whole: _Return, joints: _Return) -> "Figure":
    figure, panels = make_panels(1, 3, (12.0, 4.2))
    force, torque = _root_norms(inverse)
    shown = inverse.times >= cycle / _A_CYCLE
    panels[0].plot(inverse.times[shown], force[shown], label="force")
    panels[0].axhline(inverse.weight, **THEORY, label="weight")
    panels[0].set_ylim(bottom=0.0)
    label(panels[0], "time (s)", "root force (N)", "what the walk needs and no joint gives")
    panels[1].plot(inverse.times[shown], torque[shown], color="tab:purple")
    label(panels[1], "time (s)", "root torque (N m)", "and the torque", legend=None)
    for name, each in (("root efforts, no ground", whole), ("joints alone, ground", joints)):
        run = each.outcome.recording
        panels[2].plot(run.times, run.position[:, 2], label=name)
    run = joints.outcome.recording
    panels[2].plot(run.times, run.reference_position[:, 2], **THEORY, label="reference")
    panels[2].set_ylim(bottom=0.0)
    label(panels[2], "time (s)", "height of the root (m)", "fed forward, no feedback")
    return figure


STUDY = ForwardInverseStudy()
