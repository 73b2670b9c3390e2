"""Inverse dynamics fed forward: what it gives back on a fixed base, and why not on a floating one.

With as many actuators as degrees of freedom there are efforts for any motion; with fewer, the
motion needs root forces that no joint gives.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import yaml
from matplotlib.axes import Axes

from actuated_characters.render.plots import THEORY, label
from actuated_characters.runs.plan import make_plan
from controller_node.effort_series import write_effort_series
from controller_node.references.base import Reference
from lecture.framework.result import Row, StudyResult
from lecture.framework.study import WALK, RunResult, RunSpec, StudyRunner
from lecture.framework.tracking import joint_errors
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.clips.reading import read_clip

TITLE = "inverse dynamics of a motion, fed forward without feedback"
RUNS = 9

_ARM, _HUMANOID = "kuka", "humanoid"
_ARM_RATES, _WALK_RATES = (120, 240, 480, 960, 1920), (240, 480, 960)  # Hz
_ARM_LENGTH, _WALK_LENGTH = 1.2, 1.5  # s
_COMPARED_S = 0.2  # s, after which errors are compared; later they are as large as can be
_KEYFRAMES: Mapping[float, Mapping[str, float]] = {  # the arm's: time in s, angles in rad
    0.0: {},
    0.6: {
        "lbr_iiwa_joint_1": 0.6,
        "lbr_iiwa_joint_2": 0.2,
        "lbr_iiwa_joint_4": -1.0,
        "lbr_iiwa_joint_6": 0.4,
    },
    1.2: {
        "lbr_iiwa_joint_1": -0.2,
        "lbr_iiwa_joint_2": 0.8,
        "lbr_iiwa_joint_4": -1.7,
        "lbr_iiwa_joint_5": 0.5,
    },
}
_A_CYCLE, _CYCLES = 12, 1.5  # keyframes a cycle of the clip, cycles


@dataclass(frozen=True)
class _Inverse:
    """The inverse dynamics of a motion at a rate."""

    case: RunSpec  # the run that feeds it forward
    rate: int  # Hz
    times: FloatArray  # (t,) s
    efforts: FloatArray  # (t, n)
    weight: float  # N


@dataclass(frozen=True)
class _Return:
    """The run in which the inverse dynamics of a motion was fed forward."""

    inverse: _Inverse
    outcome: RunResult
    root: str  # "none", "fed forward" or "left out": the root efforts
    ground: bool
    times: FloatArray  # (t,) s
    error: FloatArray  # (t,) rad, mean over the joints

    @property
    def early(self) -> float:
        """The error (rad) after `_COMPARED_S`."""
        return float(np.interp(_COMPARED_S, self.times, self.error))


def run(runner: StudyRunner, result: StudyResult) -> None:
    """An arm and a walk in the air at several rates; the walk on the ground by its joints."""
    keyframes, cycle = _sample_walk()
    reach = _write_keyframes(runner, _ARM, _KEYFRAMES)
    walk = _write_keyframes(runner, _HUMANOID, keyframes)
    arms = [
        _give_back(runner, _invert(runner, _ARM, reach, _ARM_LENGTH, rate)) for rate in _ARM_RATES
    ]
    inverses = [_invert(runner, _HUMANOID, walk, _WALK_LENGTH, rate) for rate in _WALK_RATES]
    whole = [_give_back(runner, each, root="fed forward", ground=False) for each in inverses]
    joints = _give_back(runner, inverses[0], root="left out")
    result.rows += [*_rows(arms), *_rows(whole), *_rows([joints])]
    for each in (*arms, *whole, joints):
        air = "" if each.ground else "_air"
        result.add_curves(
            f"{result.name}_{each.inverse.case.character}_{each.inverse.rate}{air}",
            {"time_s": each.times, "joint_error_rad": each.error},
        )
    finest = inverses[-1]
    root = {
        "time_s": finest.times,
        "root_force_n": np.linalg.norm(finest.efforts[:, :3], axis=1),
        "root_torque_nm": np.linalg.norm(finest.efforts[:, 3:6], axis=1),
    }
    result.add_curves("forward_inverse_root", root)
    _draw_errors(result, arms, whole, joints)
    _draw_root(result, finest, cycle, whole[-1], joints)
    _add_notes(result, arms, whole, cycle)


def _sample_walk() -> tuple[dict[float, dict[str, float]], float]:
    """The clip as keyframes of a smooth motion, from rest, and the time in s of a cycle.

    The clip itself is linear between its frames: its velocity jumps, for which no effort is
    large enough.
    """
    plan = make_plan(_HUMANOID, _WALK_LENGTH, WALK, {}, {})
    cycle = float(read_clip(plan.character, str(WALK["clip"])).times[-1])
    names, keyframes = plan.character.layout.dof_names, {}
    for number in range(round(_A_CYCLE * _CYCLES) + 1):
        time = number * cycle / _A_CYCLE
        position = plan.reference.sample(time).configuration.position
        keyframes[time] = dict(zip(names, position.tolist(), strict=True))
    return keyframes, cycle


def _write_keyframes(
    runner: StudyRunner, character: str, poses: Mapping[float, Mapping[str, float]]
) -> dict[str, object]:
    """Write a motion as poses at times in s; returns the reference's parameters."""
    keyframes = [{"time": time, "pose": dict(pose)} for time, pose in poses.items()]
    content = {"interpolation": "smooth", "keyframes": keyframes}
    path = runner.path(f"{character}_keyframes.yaml")
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return {"reference": "keyframes", "keyframes": str(path)}


def _invert(
    runner: StudyRunner,
    character: str,
    reference: Mapping[str, object],
    duration: float,
    rate: int,
) -> _Inverse:
    """Inverse dynamics at each tick of a run."""
    plan = make_plan(character, duration, reference, {"rate": rate}, {})
    model, times = DynamicsModel(plan.character), np.arange(plan.ticks) / rate
    efforts = efforts_along(model, plan.reference, times, 1.0 / rate)
    file = runner.path(f"{character}_{rate}_efforts.csv")
    write_effort_series(file, plan.character.layout, times, efforts)
    controller = {"law": "feedforward", "feedforward": str(file)}
    label = f"{character}-{rate}"
    case = RunSpec(label, character, duration, reference, {"rate": rate}, controller)
    return _Inverse(case, rate, times, efforts, model.weight)


def efforts_along(
    model: DynamicsModel, reference: Reference, times: FloatArray, period: float
) -> FloatArray:
    """The generalised efforts (t, n) of a reference at times (t,) in s: `M dv/dt + C`.

    `dv/dt` is the change of the reference's velocity over the tick, so that a jump counts too.
    """
    efforts = []
    upcoming = reference.sample(float(times[0]))
    for time in times.tolist():
        now, upcoming = upcoming, reference.sample(time + period)
        model.update(now.configuration.position, now.velocity)
        efforts.append(model.inverse_dynamics((upcoming.velocity - now.velocity) / period))
    return np.array(efforts)


def _give_back(
    runner: StudyRunner, inverse: _Inverse, *, root: str = "none", ground: bool = True
) -> _Return:
    """Feed efforts forward; the root's only if `root` is "fed forward"."""
    case = inverse.case
    case = replace(
        case,
        label=f"{case.label}{'' if ground else '-air'}",
        simulator={**case.simulator, "terrain": "plane" if ground else "none"},
        controller={**case.controller, "root_assistance": root == "fed forward"},
    )
    outcome = runner.run(case)
    run = outcome.recording
    return _Return(inverse, outcome, root, ground, run.times[:-1], joint_errors(run).mean(axis=1))


def _rows(returns: Sequence[_Return]) -> list[Row]:
    steps = orders([1.0 / each.inverse.rate for each in returns], [each.early for each in returns])
    return [
        {
            "character": each.inverse.case.character,
            "ground": "yes" if each.ground else "no",
            "root efforts": each.root,
            "rate (Hz)": each.inverse.rate,
            "joint error after 0.2 s (rad)": each.early,
            "order in the tick": step,
            "joint error at the end (rad)": float(each.error[-1]),
            "largest root error (m)": each.outcome.measured("root_error_max_m"),
            "fell": each.outcome.measured("fell"),
        }
        for each, step in zip(returns, (None, *steps), strict=True)
    ]


def orders(periods: Sequence[float], errors: Sequence[float]) -> list[float]:
    """The power of the tick (s) with which the error shrinks, from each tick to the next one."""
    both = pairwise(zip(np.log(periods), np.log(errors), strict=True))
    return [float((e1 - e0) / (h1 - h0)) for (h0, e0), (h1, e1) in both]


def _add_notes(
    result: StudyResult, arms: Sequence[_Return], whole: Sequence[_Return], cycle: float
) -> None:
    inverse, start = whole[-1].inverse, cycle / _A_CYCLE  # `start`: the walk has set off from rest
    in_cycle = (inverse.times >= start) & (inverse.times < start + cycle)
    vertical = float(inverse.efforts[in_cycle, 2].mean())
    result.remarks += [
        "The arm has a motor for each degree of freedom: its motion comes back, but for an error "
        f"in proportion to the tick ({arms[0].early:.2g} rad at {arms[0].inverse.rate} Hz, "
        f"{arms[-1].early:.2g} rad at {arms[-1].inverse.rate} Hz, after {_COMPARED_S:g} s).",
        f"So does the walk in the air ({whole[0].early:.2g} rad and {whole[-1].early:.2g} rad), if "
        "the root gets its force and torque, too. What error there is grows without feedback.",
        f"That force is {vertical:.0f} N upwards in the mean over a cycle; the weight is "
        f"{inverse.weight:.0f} N. No joint gives it. Left out, the humanoid falls.",
    ]


def _draw_errors(
    result: StudyResult, arms: Sequence[_Return], whole: Sequence[_Return], joints: _Return
) -> None:
    *panels, ticks = result.add_panels("forward_inverse_errors", 1, 3, (12.0, 4.2))
    titles = ("arm (kuka)", "walk in the air, with root efforts")
    for axes, returns, title in zip(panels, (arms, whole), titles, strict=True):
        for each in returns:
            axes.semilogy(each.times[1:], each.error[1:], label=f"{each.inverse.rate} Hz")
        axes.set_ylim(1e-6, 5.0)
        axes.axvline(_COMPARED_S, color="grey", linewidth=0.8, linestyle=":")
        label(axes, "time (s)", "mean joint error (rad)", title, legend="lower right")
    without = "without, on the ground"
    panels[1].semilogy(joints.times[1:], joints.error[1:], color="black", label=without)
    panels[1].legend(loc="lower right", fontsize="small")
    _draw_orders(ticks, {"arm": arms, "walk in the air": whole})


def _draw_orders(axes: Axes, families: Mapping[str, Sequence[_Return]]) -> None:
    for name, returns in families.items():
        ticks = np.array([1e3 / each.inverse.rate for each in returns])  # ms
        errors = np.array([each.early for each in returns])
        axes.loglog(ticks, errors, "o", label=name)
        axes.loglog(ticks, errors[-1] * ticks / ticks[-1], **THEORY)
    axes.plot([], [], **THEORY, label="in proportion")
    axes.minorticks_off()
    shown = [0.5, 1.0, 2.0, 4.0, 8.0]
    axes.set_xticks(shown, [f"{tick:g}" for tick in shown])
    label(
        axes,
        "tick (ms)",
        f"error after {_COMPARED_S:g} s (rad)",
        "the error shrinks with the tick",
    )


def _draw_root(
    result: StudyResult, inverse: _Inverse, cycle: float, whole: _Return, joints: _Return
) -> None:
    forces, torques, heights = result.add_panels("forward_inverse_root", 1, 3, (12.0, 4.2))
    curves, shown = result.curves["forward_inverse_root"], inverse.times >= cycle / _A_CYCLE
    times = inverse.times[shown]
    forces.plot(times, curves["root_force_n"][shown], label="force")
    forces.axhline(inverse.weight, **THEORY, label="weight")
    forces.set_ylim(bottom=0.0)
    label(forces, "time (s)", "root force (N)", "what the walk needs and no joint gives")
    torques.plot(times, curves["root_torque_nm"][shown], color="tab:purple")
    label(torques, "time (s)", "root torque (N m)", "and the torque", legend=None)
    for name, each in (("root efforts, no ground", whole), ("joints alone, ground", joints)):
        run = each.outcome.recording
        heights.plot(run.times, run.position[:, 2], label=name)
    run = joints.outcome.recording
    heights.plot(run.times, run.reference_position[:, 2], **THEORY, label="reference")
    heights.set_ylim(bottom=0.0)
    label(heights, "time (s)", "height of the root (m)", "fed forward, no feedback")
