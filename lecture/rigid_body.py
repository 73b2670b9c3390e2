"""A free rigid body: what forces, torques, points of application and inertia do to it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from actuated_characters.bags.recording import Recording
from actuated_characters.render.plots import draw_over_theory, label
from actuated_characters.render.stills import pose_strip
from actuated_characters.runs.planned.wrenches import PlannedPush
from lecture.framework.bodies import IN_SPACE, Box, Momenta, momenta, write_box
from lecture.framework.result import Row, StudyResult
from lecture.framework.study import HOLD, RunSpec, StudyRunner
from lecture.theory.euler import (
    Load,
    RigidBody,
    RigidBodyMotion,
    angular_acceleration,
    move,
    net_load,
)
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Vector
from msgs_config.geometry import rotations
from msgs_config.messages.clock import FIRST_TICK, TickClock
from sim_node.physics.settings import WorldSettings

TITLE = "a free rigid body: m dv/dt = f, I dw/dt + w x I w = tau + r x f"
RUNS = 8

_RATE = 1000  # Hz
_COMPACT = Box("compact", 6.0, (0.3, 0.3, 0.3))
_LONG_BOX = Box("long", 6.0, (1.2, 0.15, 0.15))
_BRICK = Box("brick", 6.0, (0.6, 0.4, 0.1))
_SPIN = (0.1, 5.0, 0.0)  # rad/s, nearly about the middle axis
_COUPLE = (
    Load(force=(0.0, 2.0, 0.0), point=(0.15, 0.0, 0.0)),
    Load(force=(0.0, -2.0, 0.0), point=(-0.15, 0.0, 0.0)),
)
_PUSH = (3.0, 0.0, 0.0)  # N
_ABOUT_X = (Load(torque=(0.3, 0.0, 0.0)),)
_TORQUE = (Load(torque=(0.0, 0.0, 0.3)),)


@dataclass(frozen=True)
class Trial:
    """A box, what acts on it all the time, and how it begins."""

    label: str
    title: str
    box: Box
    loads: Sequence[Load] = ()
    duration: float = 2.0  # s
    spin: Vector = (0.0, 0.0, 0.0)  # rad/s at the beginning, body axes
    rate: int = _RATE  # Hz


@dataclass(frozen=True)
class Observed:
    """A trial's run, beside what theory says of it."""

    trial: Trial
    recording: Recording
    motion: RigidBodyMotion  # (t + 1) simulated states
    theory: RigidBodyMotion  # the theory at the same times
    momenta: Momenta

    @property
    def turn_off_theory(self) -> FloatArray:
        """The angle (t + 1,) in rad between the simulated turn and that by theory."""
        return rotations.angle_between(self.motion.turn_xyzw, self.theory.turn_xyzw)

    @property
    def drift(self) -> FloatArray:
        """Distance (t + 1,) of the angular momentum from its first value, relative to that."""
        spin = self.momenta.spin
        off: FloatArray = np.linalg.norm(spin - spin[0], axis=1)
        return off / float(np.linalg.norm(spin[0]))


TRIALS = (
    Trial("force", "force f", _COMPACT, (Load(_PUSH),)),
    Trial("torque", "torque", _COMPACT, _TORQUE),
    Trial("off_centre", "force off the centre", _COMPACT, (Load(_PUSH, point=(0.0, -0.1, 0.0)),)),
    Trial("couple", "couple f, -f", _COMPACT, _COUPLE),
    Trial("torque_long", "the same torque, long box", _LONG_BOX, _TORQUE),
    Trial("spinning", "torque, spinning brick", _BRICK, _ABOUT_X, spin=(0.5, 1.0, 3.0)),
    Trial("middle_axis", "free spin, middle axis", _BRICK, (), 4.0, _SPIN),
    Trial("middle_axis_2000", "free spin at 2000 Hz", _BRICK, (), 4.0, _SPIN, 2 * _RATE),
)


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Push boxes that float, and integrate Newton's and Euler's laws beside each run."""
    seen = {trial.label: _observe(runner, trial) for trial in TRIALS}
    free, finer = seen["middle_axis"], seen["middle_axis_2000"]
    result.rows += [_row(one) for one in seen.values()]
    _draw_loads(result, seen)
    _draw_inertia(result, seen)
    _draw_spin(result, free, finer)
    columns = {"time_s": free.recording.times}
    for name, values in (
        ("angular_velocity_{}_rad_s", free.motion.angular_velocity),
        ("theory_{}_rad_s", free.theory.angular_velocity),
        ("angular_momentum_{}_kg_m2_s", free.momenta.spin),
    ):
        columns |= {name.format(axis): values[:, k] for k, axis in enumerate("xyz")}
    result.add_curves("rigid_body_spin", columns)
    shrink = seen["torque"].trial.box.inertia[2] / seen["torque_long"].trial.box.inertia[2]
    result.remarks += [
        "a couple moves no centre of mass; the same force off the centre moves it as much "
        "as through it",
        f"of one mass and under one torque the long box turns {shrink:.2g} times as fast",
        f"spun about its middle axis a box tumbles while L stays: it drifts by "
        f"{free.drift.max():.1e} of itself in {free.trial.duration:g} s at {free.trial.rate} Hz, "
        f"by {finer.drift.max():.1e} at {finer.trial.rate} Hz; that is the engine's step, of "
        "first order",
    ]


def _observe(runner: StudyRunner, trial: Trial) -> Observed:
    """Run a trial; the wrenches last as long as it does."""
    stamp = TickClock(trial.rate).stamp_ns(FIRST_TICK)
    case = RunSpec(
        label=trial.label,
        character=write_box(runner, trial.box),
        duration=trial.duration,
        reference=HOLD,
        simulator={
            **IN_SPACE,
            "rate": trial.rate,
            "wrench_duration": trial.duration + 1.0,
            "initial_velocity": [0.0, 0.0, 0.0, *trial.spin],
        },
        # a box has no joints: what makes the simulator wait is the root's effort, which is zero
        controller={"law": "zero", "root_assistance": True},
        pushes=[
            PlannedPush(stamp, trial.box.name, (*load.force, *load.torque), load.point)
            for load in trial.loads
        ],
    )
    run = runner.run(case).recording
    position, velocity = run.position, run.velocity
    simulated = RigidBodyMotion(
        position[:, :3], rotations.exp(position[:, 3:6]), velocity[:, :3], velocity[:, 3:6]
    )
    theory = move(RigidBody(trial.box.mass, trial.box.inertia), simulated, trial.loads, run.times)
    return Observed(trial, run, simulated, theory, momenta(run.character, position, velocity))


def euler_residual(
    inertia: FloatArray, motion: RigidBodyMotion, torque: FloatArray, step: float
) -> float:
    """The largest `I (w' - w) / h + w x I w - tau` of all ticks, relative to its largest part.

    `torque` (t, 3) is in the world, at the begin of each tick of `step` s.
    """
    spin, turn = motion.angular_velocity[:-1], rotations.matrix(motion.turn_xyzw[:-1])
    inertial = inertia * np.diff(motion.angular_velocity, axis=0) / step
    gyroscopic = np.cross(spin, inertia * spin)
    applied = np.einsum("tji,tj->ti", turn, torque)
    scale = max(float(np.abs(part).max()) for part in (inertial, gyroscopic, applied)) or 1.0
    return float(np.abs(inertial + gyroscopic - applied).max()) / scale


def missed_impulse(momentum: FloatArray, load: FloatArray, step: float) -> float:
    """The change of a momentum (t + 1, 3) that the impulse of its load (t, 3) does not explain.

    In kg m/s for a force, kg m^2/s for a torque; `step` in s.
    """
    impulse = step * load.sum(axis=0)
    return float(np.linalg.norm(momentum[-1] - momentum[0] - impulse))


def _row(one: Observed) -> Row:
    """Measurements of the first tick and of the whole run, beside theory."""
    trial, motion = one.trial, one.motion
    inertia, step = trial.box.inertia, 1.0 / trial.rate
    turns = rotations.matrix(motion.turn_xyzw)
    force, torque = net_load(trial.loads, turns)
    forces = np.broadcast_to(force, torque[:-1].shape)
    linear = np.diff(motion.velocity[:2], axis=0)[0] / step
    angular = np.diff(motion.angular_velocity[:2], axis=0)[0] / step
    by_force = force / trial.box.mass
    in_body = turns[0].T @ torque[0]
    by_torque = angular_acceleration(inertia, motion.angular_velocity[0], in_body)
    off = np.concatenate((linear - by_force, angular - by_torque))
    largest = np.abs(np.concatenate((by_force, by_torque))).max()
    return {
        "case": trial.title,
        "a (m/s^2)": float(np.linalg.norm(linear)),
        "theory (m/s^2)": float(np.linalg.norm(by_force)),
        "dw/dt (rad/s^2)": float(np.linalg.norm(angular)),
        "theory (rad/s^2)": float(np.linalg.norm(by_torque)),
        "relative difference": float(np.abs(off).max() / largest),
        "Euler residual (relative)": euler_residual(inertia, motion, torque[:-1], step),
        "P off impulse (kg m/s)": missed_impulse(one.momenta.linear, forces, step),
        "L off impulse (kg m^2/s)": missed_impulse(one.momenta.spin, torque[:-1], step),
        "turn off theory (rad)": float(one.turn_off_theory[-1]),
    }


def _draw_loads(result: StudyResult, seen: Mapping[str, Observed]) -> None:
    """Velocity and angular velocity under each kind of load on the compact box."""
    names = ("force", "torque", "off_centre", "couple")
    title = "A force moves the centre, wherever it acts; r × f turns the body"
    panels = result.add_panels(result.name, 2, len(names), (11.0, 5.6), title=title)
    for column, name in enumerate(names):
        one, upper, lower = seen[name], panels[column], panels[column + len(names)]
        times, motion, theory = one.recording.times, one.motion, one.theory
        draw_over_theory(upper, times, motion.velocity, theory.velocity, "xyz")
        draw_over_theory(lower, times, motion.angular_velocity, theory.angular_velocity, "xyz")
        left = column == 0
        legend = "upper left" if left else None
        label(upper, "", "velocity of the centre (m/s)" * left, one.trial.title, legend=legend)
        label(lower, "time (s)", "angular velocity (rad/s)" * left, legend=None)
        upper.set_ylim(-0.15, 1.15)
        lower.set_ylim(-7.0, 8.0)


def _draw_inertia(result: StudyResult, seen: Mapping[str, Observed]) -> None:
    """The same torque on two shapes of one mass; and on a box that spins."""
    shapes, spinning, off = result.add_panels("rigid_body_inertia", 1, 3, (11.0, 4.0))
    times = seen["torque"].recording.times
    pair = [seen["torque"], seen["torque_long"]]
    draw_over_theory(
        shapes,
        times,
        np.column_stack([one.motion.angular_velocity[:, 2] for one in pair]),
        np.column_stack([one.theory.angular_velocity[:, 2] for one in pair]),
        [f"{one.trial.box.name}, I = {one.trial.box.inertia[2]:.3g} kg m²" for one in pair],
    )
    label(shapes, "time (s)", "angular velocity about z (rad/s)", "one mass, one torque: I decides")
    one = seen["spinning"]
    draw_over_theory(
        spinning, times, one.motion.angular_velocity, one.theory.angular_velocity, "xyz"
    )
    title = "a torque on a spinning brick"
    label(spinning, "time (s)", "angular velocity, body axes (rad/s)", title)
    for name in ("torque", "off_centre", "couple", "spinning"):
        off.plot(times, seen[name].turn_off_theory, label=seen[name].trial.title)
    label(off, "time (s)", "angle (rad)", f"turn off theory, in steps of {1000 / _RATE:g} ms")


def _draw_spin(result: StudyResult, free: Observed, finer: Observed) -> None:
    """A free spin about the middle axis: it tumbles, and its angular momentum stays."""
    figure = result.figures["rigid_body_spin"] = Figure(figsize=(11.0, 6.0), layout="constrained")
    figure.suptitle("A box spun about its middle axis, free of torque: w × I w makes it tumble")
    grid = figure.add_gridspec(2, 3, height_ratios=(0.4, 1.0))
    recording, times = free.recording, free.recording.times
    rows = np.linspace(0, len(times) - 1, 7).astype(int)
    strip = figure.add_subplot(grid[0, :])
    strip.imshow(
        pose_strip(
            recording.character,
            recording.position[rows],
            [f"{time:.1f} s" for time in times[rows]],
            columns=len(rows),
            size=(160, 160),
            world=WorldSettings(ground=False),
        )
    )
    strip.set_axis_off()
    spin, momentum, drift = (figure.add_subplot(grid[1, column]) for column in range(3))
    draw_over_theory(spin, times, free.motion.angular_velocity, free.theory.angular_velocity, "xyz")
    label(spin, "time (s)", "angular velocity, body axes (rad/s)", "it turns over by itself")
    constant = np.broadcast_to(free.momenta.spin[0], free.momenta.spin.shape)
    draw_over_theory(momentum, times, free.momenta.spin, constant, "xyz")
    label(momentum, "time (s)", "L, world axes (kg m²/s)", "while L stays as it is")
    for one in (free, finer):
        drift.plot(one.recording.times, one.drift, label=f"{one.trial.rate} Hz")
    label(drift, "time (s)", "|L - L(0)| / |L(0)|", "half the step, half the drift")
