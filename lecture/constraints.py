"""Two boxes on a ball joint: twelve coordinates and a constraint, or nine without one."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.render.plots import THEORY, draw_over_theory, label
from actuated_characters.render.stills import pose_strip
from lecture.framework.bodies import Box, write_box, write_jointed_boxes
from lecture.framework.result import Row, StudyResult
from lecture.framework.study import HOLD, RunSpec, StudyRunner
from lecture.theory.euler import order_of
from lecture.theory.maximal import (
    JointedBody,
    PairState,
    gaps,
    joint_force,
    move_pair,
    stacked,
    step_pair,
)
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.geometry import rotations
from sim_node.physics.engine import INSTALLED_ENGINES
from sim_node.physics.settings import WorldSettings

TITLE = "a ball joint: M dv/dt + C = f + J^T lambda with J v = c, and reduced coordinates"

_RATES = (60, 120, 240, 480, 960)  # Hz
RUNS = len(_RATES) * len(INSTALLED_ENGINES)

_DURATION, _LONG = 1.0, 4.0  # s: of what is compared; of what is shown of the drift
_SHOWN, _SEEN = 240, 60  # Hz, of the curves; of the pictures
_FINE_STEPS = 4  # of the theory, in the shortest tick
_GRAVITY = 9.81  # m/s^2
_SHARE = 0.2  # of the gap, that a stabilised step takes away
_PARENT = Box("upper", 2.0, (0.16, 0.12, 0.5), (0.0, 0.0, 0.25))
_CHILD = Box("lower", 1.0, (0.1, 0.1, 0.5), (0.04, 0.0, -0.25))
_BODIES = [
    JointedBody(box.mass, box.inertia, tuple((-np.array(box.centre)).tolist()))
    for box in (_PARENT, _CHILD)
]
_START = (0.0, 0.0, 3.0, 0.2, 0.0, 0.0, 0.9, 0.3, 0.0)  # m, rad
_MOVING = (0.0, 0.0, 3.0, 1.0, 4.0, 2.0, -3.0, 2.0, 4.0)  # m/s, rad/s
_SMALLEST_DRAWN = 1e-17  # m
_POSES = 8
_IN_AIR = {
    "gravity": _GRAVITY,
    "terrain": "none",
    "initial_position": list(_START),
    "initial_velocity": list(_MOVING),
}
_OFF, _GAP = "centres off theory at 1 s (m)", "largest gap (m)"
_FREE, _STABLE = "maximal, c = 0", "maximal, stabilised"


@dataclass(frozen=True)
class Outcome:
    """A motion of both boxes by one way to simulate them, at one rate."""

    motion: PairState  # (t + 1) states
    force: FloatArray  # (t, 3) of the joint on the upper box, N, world

    @property
    def gap(self) -> FloatArray:
        """How far (t + 1,) the joint is apart, m."""
        return gaps(_BODIES, self.motion)


Outcomes = Mapping[str, Mapping[int, Outcome]]
"""Outcomes by the way and the rate in Hz."""


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Throw two boxes into the air: by the lecture's steps, by engines, and in continuous time."""
    path = write_jointed_boxes(runner, "jointed", _PARENT, _CHILD)
    outcomes: dict[str, dict[int, Outcome]] = {_FREE: {}, _STABLE: {}}
    start = _initial_state(path)
    for name, share in ((_FREE, 0.0), (_STABLE, _SHARE)):
        for rate in _RATES:
            times = np.arange(round(_LONG * rate) + 1) / rate
            moved = step_pair(_BODIES, start, times, _GRAVITY, share)
            outcomes[name][rate] = Outcome(*moved)
    for engine in INSTALLED_ENGINES:
        outcomes[f"reduced, {engine}"] = {
            rate: measure(_run(runner, path, engine, rate)) for rate in _RATES
        }
    fine = _FINE_STEPS * max(_RATES)
    times = np.arange(round(_DURATION * fine) + 1) / fine
    exact = move_pair(_BODIES, start, times, _GRAVITY)
    for name, by_rate in outcomes.items():
        result.rows += [_row(name, rate, each, exact) for rate, each in by_rate.items()]
    _draw(result, outcomes, exact)
    _draw_poses(runner, result, outcomes)
    shown = outcomes[_FREE][_SHOWN]
    columns = {"time_s": np.arange(len(shown.gap)) / _SHOWN, "gap_m": shown.gap}
    columns["gap_stabilised_m"] = outcomes[_STABLE][_SHOWN].gap
    columns |= {f"force_{axis}_N": shown.force[:, k] for k, axis in enumerate("xyz")}
    result.add_curves("constraints_joint", columns)
    free, stable = (float(outcomes[name][_SHOWN].gap.max()) for name in (_FREE, _STABLE))
    result.remarks += [
        f"J v = 0 keeps the joint's speed at zero, not its gap: at {_SHOWN} Hz that is "
        f"{1e3 * free:.2g} mm in {_LONG:g} s, and {1e3 * stable:.2g} mm where each step takes "
        f"away {_SHARE:g} of it",
        "the force is late by a step: J v = 0 is of the step before, so that its J' v counts, and "
        "the first step, which begins with J v = 0, has none",
        "half the step, half the error: of order " + ", ".join(_orders(result, outcomes)),
        "the engines have six coordinates of the upper box and three of the joint: nothing can "
        "come apart, and no force of the joint is worked out",
    ]


def _initial_state(path: str) -> PairState:
    return _state(DynamicsModel(load_character(path)), np.array(_START), np.array(_MOVING))


def _run(runner: StudyRunner, path: str, engine: str, rate: int) -> Recording:
    case = RunSpec(
        label=f"{engine}_{rate}",
        character=path,
        duration=_DURATION,
        reference=HOLD,
        simulator={**_IN_AIR, "engine": engine, "rate": rate},
        # nothing acts: the simulator waits for the root's effort, which is zero
        controller={"law": "zero", "root_assistance": True},
    )
    return runner.run(case).recording


def _state(model: DynamicsModel, position: FloatArray, velocity: FloatArray) -> PairState:
    """Both boxes in a state (n,) of reduced coordinates."""
    model.update(position, velocity)
    origins, turns = model.link_poses()
    centres = origins + rotations.rotate(turns, np.array([_PARENT.centre, _CHILD.centre]))
    velocities = np.array([model.link_jacobian(link) @ velocity for link in range(2)])
    return PairState(centres, turns, velocities)


def measure(run: Recording) -> Outcome:
    """Both boxes in a run, and the joint's force by what the upper one does: `m (a - g)`."""
    model = DynamicsModel(run.character)
    states = zip(run.position, run.velocity, strict=True)
    motion = stacked([_state(model, *state) for state in states])
    step = float(run.times[1] - run.times[0])
    lifting = np.diff(motion.velocity[:, 0, :3], axis=0) / step
    lifting[:, 2] += _GRAVITY
    return Outcome(motion, _PARENT.mass * lifting)


def _orders(result: StudyResult, ways: Iterable[str]) -> list[str]:
    """The order of each way's error: the slope of its logarithm over that of the step."""
    texts = []
    for way in ways:
        errors = [row[_OFF] for row in result.rows if row["coordinates"] == way]
        order = order_of(1.0 / np.array(_RATES[1:]), errors[1:])
        texts.append(f"{order:.2f} ({way})")
    return texts


def _row(name: str, rate: int, outcome: Outcome, exact: PairState) -> Row:
    """The largest gap within what is compared, and how far motion and force are from theory.

    The force after the first quarter: the first maximal step begins with a joint that is at rest,
    and needs none, which a stabilised joint makes up for in the next ones.
    """
    ticks = round(_DURATION * rate)
    every = (len(exact.centre) - 1) // ticks
    off = np.abs(outcome.motion.centre[ticks] - exact.centre[-1]).max()
    theory = _forces(exact, every)[:-1]
    force_off = np.linalg.norm((outcome.force[:ticks] - theory)[ticks // 4 :], axis=1).max()
    return {
        "coordinates": name,
        "rate (Hz)": rate,
        _GAP: float(outcome.gap[: ticks + 1].max()),
        _OFF: float(off),
        "joint's force off theory / largest": float(
            force_off / np.linalg.norm(theory, axis=1).max()
        ),
    }


def _forces(exact: PairState, every: int) -> FloatArray:
    """The joint's force (k, 3) in N in continuous time, in every so many-th state."""
    parts = (exact.centre, exact.turn_xyzw, exact.velocity)
    states = zip(*(part[::every] for part in parts), strict=True)
    return np.array([joint_force(_BODIES, PairState(*state), _GRAVITY) for state in states])


def _draw(result: StudyResult, outcomes: Outcomes, exact: PairState) -> None:
    drift, force, off, largest = result.add_panels(result.name, 2, 2, (11.0, 7.5))
    for name, style in ((_FREE, "-"), (_STABLE, "--")):
        for rate, color in zip(
            (60, 240, 960), ("tab:blue", "tab:orange", "tab:green"), strict=True
        ):
            gap = outcomes[name][rate].gap
            times = np.arange(len(gap)) / rate
            named = f"{name.partition(', ')[2]}, {rate} Hz"
            drift.semilogy(times[1:], gap[1:], style, color=color, label=named, linewidth=1.2)
    label(drift, "time (s)", "gap of the joint (m)", "J v = c: what the joint comes apart")
    drift.legend(fontsize="x-small", ncols=2, loc="lower right")
    shown = outcomes[_FREE][_SHOWN].force[: round(_DURATION * _SHOWN)]
    times = np.arange(len(shown)) / _SHOWN
    theory = _forces(exact, (len(exact.centre) - 1) // len(shown))[:-1]
    draw_over_theory(force, times, shown, theory, "xyz")
    label(force, "time (s)", "λ (N)", f"the joint's force on the upper box, {_SHOWN} Hz")
    steps = 1.0 / np.array(_RATES)
    for axes, column, title in (
        (off, _OFF, "all ways come to the same motion"),
        (largest, _GAP, "the gap in 1 s"),
    ):
        for name in outcomes:
            values = [row[column] for row in result.rows if row["coordinates"] == name]
            marker = "o-" if name in (_FREE, _STABLE) else "x--"
            drawn = np.maximum(values, _SMALLEST_DRAWN)
            axes.loglog(steps, drawn, marker, label=name, fillstyle="none")
        label(axes, "step h (s)", column, title, legend=None)
    first = [row[_OFF] for row in result.rows[: len(_RATES)]]
    off.loglog(steps, 2.0 * first[-1] * steps / steps[-1], **THEORY, label="~ h")
    off.legend(fontsize="small")


def _draw_poses(runner: StudyRunner, result: StudyResult, outcomes: Outcomes) -> None:
    """Both boxes at a coarse rate, as two bodies that nothing but the constraint joins."""
    characters = [load_character(write_box(runner, box)) for box in (_PARENT, _CHILD)]
    pictures = {}
    for name in (_FREE, _STABLE):
        motion = outcomes[name][_SEEN].motion
        rows = np.linspace(0, len(motion.centre) - 1, _POSES).round().astype(int)
        centres = np.array([_PARENT.centre, _CHILD.centre])
        origins = motion.centre - rotations.rotate(motion.turn_xyzw, centres)
        # all pictures are of the upper box's height: both fall by tens of metres
        origins = origins - origins[:, :1]
        turns = rotations.log(motion.turn_xyzw)
        whole = np.concatenate((origins, turns), axis=2).reshape(len(origins), -1)
        gap = 1e3 * outcomes[name][_SEEN].gap[rows]
        captions = [
            f"{row / _SEEN:.1f} s: {each:.0f} mm" for row, each in zip(rows, gap, strict=True)
        ]
        pictures[f"{name}, {_SEEN} Hz: the gap of the joint"] = pose_strip(
            characters, whole[rows], captions, size=(165, 200), world=WorldSettings(ground=False)
        )
    result.add_pictures("constraints_poses", pictures)
