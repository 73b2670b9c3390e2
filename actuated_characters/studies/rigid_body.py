"""A free rigid body: what forces, torques, points of application and inertia do to it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.runs.planned_wrenches import PlannedPush
from actuated_characters.studies.framework.bodies import IN_SPACE, Box, Momenta, momenta, write_box
from actuated_characters.studies.framework.plots import draw_over_theory, label, make_panels
from actuated_characters.studies.framework.study import Cell, RunSpec, StudyResult, StudyRunner
from actuated_characters.studies.theory.euler import (
    Load,
    Motion,
    RigidBody,
    angular_acceleration,
    move,
    net_load,
)
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Vector
from msgs_config.geometry import rotations
from msgs_config.messages.clock import TickClock
from sim_node.physics.world import WorldSettings

if TYPE_CHECKING:  # it takes a second to import
    from matplotlib.figure import Figure

_RATE = 1000  # Hz
_COMPACT = Box("compact", 6.0, (0.3, 0.3, 0.3))
_LONG = Box("long", 6.0, (1.2, 0.15, 0.15))
_BRICK = Box("brick", 6.0, (0.6, 0.4, 0.1))
_SPIN = (0.1, 5.0, 0.0)  # rad/s, nearly about the middle axis
_COUPLE = (
    Load(force=(0.0, 2.0, 0.0), point=(0.15, 0.0, 0.0)),
    Load(force=(0.0, -2.0, 0.0), point=(-0.15, 0.0, 0.0)),
)
_TORQUE = (Load(torque=(0.0, 0.0, 0.3)),)
_COLUMNS = (
    "case",
    "a (m/s^2)",
    "theory (m/s^2)",
    "dw/dt (rad/s^2)",
    "theory (rad/s^2)",
    "relative difference",
    "Euler residual (relative)",
    "P off impulse (kg m/s)",
    "L off impulse (kg m^2/s)",
    "turn off theory (rad)",
)


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
    motion: Motion  # (t + 1) simulated states
    theory: Motion  # at the same times
    momenta: Momenta


TRIALS = (
    Trial("force", "force f", _COMPACT, (Load(force=(3.0, 0.0, 0.0)),)),
    Trial("torque", "torque", _COMPACT, _TORQUE),
    Trial(
        "off_centre",
        "force off the centre",
        _COMPACT,
        (Load(force=(3.0, 0.0, 0.0), point=(0.0, -0.1, 0.0)),),
    ),
    Trial("couple", "couple f, -f", _COMPACT, _COUPLE),
    Trial("torque_long", "the same torque, long box", _LONG, _TORQUE),
    Trial(
        "spinning",
        "torque, spinning brick",
        _BRICK,
        (Load(torque=(0.3, 0.0, 0.0)),),
        spin=(0.5, 1.0, 3.0),
    ),
    Trial("middle_axis", "free spin, middle axis", _BRICK, (), 4.0, _SPIN),
    Trial(
        "middle_axis_2000",
        "free spin at 2000 Hz",
        _BRICK,
        (),
        4.0,
        _SPIN,
        rate=2 * _RATE,
    ),
)


class RigidBodyStudy:
    """Boxes that float, pushed by external wrenches, against Newton's and Euler's laws."""

    name = "rigid_body"
    title = "a free rigid body: m dv/dt = f, I dw/dt + w x I w = tau + r x f"
    runs = len(TRIALS)

    def run(self, runner: StudyRunner) -> StudyResult:
        """Run each trial, and integrate the same equations beside it."""
        seen = {trial.label: _observe(runner, trial) for trial in TRIALS}
        free, finer = seen["middle_axis"], seen["middle_axis_2000"]
        drifts = [float(_off_start(one.momenta.spin).max()) for one in (free, finer)]
        shrink = seen["torque"].trial.box.inertia[2] / seen["torque_long"].trial.box.inertia[2]
        return StudyResult(
            columns=_COLUMNS,
            rows=[_row(one) for one in seen.values()],
            figures={
                self.name: _draw_loads(seen),
                "rigid_body_inertia": _draw_inertia(seen),
                "rigid_body_spin": _draw_spin(free, finer),
            },
            curves={"rigid_body_spin": _spin_curves(free)},
            notes=(
                "a couple moves no centre of mass; the same force off the centre moves it as much "
                "as through it",
                f"of one mass and under one torque the long box turns {shrink:.2g} times as fast",
                f"spun about its middle axis a box tumbles while L stays: it drifts by "
                f"{drifts[0]:.1e} of itself in {free.trial.duration:g} s at {free.trial.rate} Hz, "
                f"by {drifts[1]:.1e} at {finer.trial.rate} Hz; that is the engine's step, of "
                "first order",
            ),
        )


def _observe(runner: StudyRunner, trial: Trial) -> Observed:
    """Run a trial; the wrenches last as long as it does."""
    stamp = TickClock(trial.rate).stamp_ns(1)
    case = RunSpec(
        label=trial.label,
        character=write_box(runner, trial.box),
        duration=trial.duration,
        reference={"reference": "hold"},
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
    simulated = Motion(
        position[:, :3], rotations.exp(position[:, 3:6]), velocity[:, :3], velocity[:, 3:6]
    )
    theory = move(RigidBody(trial.box.mass, trial.box.inertia), simulated, trial.loads, run.times)
    return Observed(
        trial, run, simulated, theory, momenta(run.character, run.position, run.velocity)
    )


def euler_residual(inertia: FloatArray, motion: Motion, torque: FloatArray, step: float) -> float:
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
    """How far a momentum (t + 1, 3) has changed otherwise than by its load (t, 3) in each tick.

    In kg m/s for a force, kg m^2/s for a torque; `step` in s.
    """
    impulse = step * load.sum(axis=0)
    return float(np.linalg.norm(momentum[-1] - momentum[0] - impulse))


def _row(one: Observed) -> tuple[Cell, ...]:
    """What is measured in the first tick and over the run, beside theory."""
    trial, motion = one.trial, one.motion
    inertia, step = trial.box.inertia, 1.0 / trial.rate
    force, torque = net_load(trial.loads, motion.turn_xyzw)
    forces = np.broadcast_to(force, torque[:-1].shape)
    linear = np.diff(motion.velocity[:2], axis=0)[0] / step
    angular = np.diff(motion.angular_velocity[:2], axis=0)[0] / step
    by_force = force / trial.box.mass
    in_body = rotations.matrix(motion.turn_xyzw[0]).T @ torque[0]
    by_torque = angular_acceleration(inertia, motion.angular_velocity[0], in_body)
    off = np.concatenate((linear - by_force, angular - by_torque))
    largest = np.abs(np.concatenate((by_force, by_torque))).max()
    apart = rotations.angle_between(motion.turn_xyzw[-1], one.theory.turn_xyzw[-1])
    return (
        trial.title,
        float(np.linalg.norm(linear)),
        float(np.linalg.norm(by_force)),
        float(np.linalg.norm(angular)),
        float(np.linalg.norm(by_torque)),
        float(np.abs(off).max() / largest),
        euler_residual(inertia, motion, torque[:-1], step),
        missed_impulse(one.momenta.linear, forces, step),
        missed_impulse(one.momenta.spin, torque[:-1], step),
        float(apart),
    )


def _off_start(momentum: FloatArray) -> FloatArray:
    """How far (t,) a momentum (t, 3) is from where it was, relative to that."""
    off: FloatArray = np.linalg.norm(momentum - momentum[0], axis=1)
    return off / float(np.linalg.norm(momentum[0]))


def _spin_curves(one: Observed) -> tuple[Sequence[str], FloatArray]:
    names = ["time_s"]
    names += [f"angular_velocity_{axis}_rad_s" for axis in "xyz"]
    names += [f"theory_{axis}_rad_s" for axis in "xyz"]
    names += [f"angular_momentum_{axis}_kg_m2_s" for axis in "xyz"]
    parts = (one.motion.angular_velocity, one.theory.angular_velocity, one.momenta.spin)
    return names, np.column_stack((one.recording.times, *parts))


def _draw_loads(seen: Mapping[str, Observed]) -> "Figure":
    """Velocity and angular velocity under each kind of load on the compact box."""
    names = ("force", "torque", "off_centre", "couple")
    figure, panels = make_panels(2, len(names), (11.0, 5.6))
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
    figure.suptitle("A force moves the centre, wherever it acts; r × f turns the body")
    return figure


def _draw_inertia(seen: Mapping[str, Observed]) -> "Figure":
    """The same torque on two shapes of one mass; and on a box that spins."""
    figure, (shapes, spinning, off) = make_panels(1, 3, (11.0, 4.0))
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
        apart = rotations.angle_between(seen[name].motion.turn_xyzw, seen[name].theory.turn_xyzw)
        off.plot(times, apart, label=seen[name].trial.title)
    label(off, "time (s)", "angle (rad)", f"turn off theory, in steps of {1000 / _RATE:g} ms")
    return figure


def _draw_spin(free: Observed, finer: Observed) -> "Figure":
    """A free spin about the middle axis: it tumbles, and its angular momentum stays."""
    from matplotlib.figure import Figure

    from actuated_characters.render.stills import pose_strip

    figure = Figure(figsize=(11.0, 6.0), layout="constrained")
    grid = figure.add_gridspec(2, 3, height_ratios=(0.4, 1.0))
    recording, times = free.recording, free.recording.times
    rows = np.linspace(0, len(times) - 1, 7).astype(int)
    captions = [f"{times[row]:.1f} s" for row in rows]
    poses = recording.position[rows]
    strip = figure.add_subplot(grid[0, :])
    world = WorldSettings(ground=False)
    strip.imshow(
        pose_strip(
            recording.character, poses, captions, columns=len(rows), size=(160, 160), world=world
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
        off = _off_start(one.momenta.spin)
        drift.plot(one.recording.times, off, label=f"{one.trial.rate} Hz")
    label(drift, "time (s)", "|L - L(0)| / |L(0)|", "half the step, half the drift")
    figure.suptitle("A box spun about its middle axis, free of torque: w × I w makes it tumble")
    return figure


STUDY = RigidBodyStudy()
