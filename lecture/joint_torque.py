"""A joint torque as forces between two bodies that sum to zero, and change no momentum."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from actuated_characters.bags.recording import Recording
from actuated_characters.render.plots import THEORY, label
from actuated_characters.runs.planned.wrenches import PlannedPush
from controller_node.effort_series import write_effort_series
from lecture.framework.bodies import (
    HINGE,
    IN_SPACE,
    Box,
    Momenta,
    momenta,
    write_hinged_boxes,
)
from lecture.framework.result import Row, StudyResult
from lecture.framework.study import HOLD, RunSpec, StudyRunner
from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.geometry import rotations

TITLE = "joint torque: forces between two bodies that sum to zero"
RUNS = 5

_RATE, _FINE_RATE = 240, 1920  # Hz
_DURATION = 2.0  # s
_SMALLEST_DRAWN = 1e-18  # what is drawn where there is nothing
_TORQUE = 0.15  # N m, the largest torque
_FORCE = 0.5  # N, of the root in the run with assistance
_PARENT = Box("parent", 2.0, (0.15, 0.1, 0.6), (0.0, 0.0, 0.3))
_CHILD = Box("child", 1.0, (0.1, 0.1, 0.5), (0.05, 0.0, -0.25))
_POINTS = np.array([[0.1, 0.0, -0.1], [-0.05, 0.08, -0.3], [0.0, -0.08, -0.2]])  # m, child frame
_FORCES = np.array([[1.0, 2.0, 1.0], [-2.0, 0.5, 1.5]])  # N, child frame; the third balances them
_SPIN = (0.0, 0.0, 0.0, 0.4, 0.2, 0.3, 0.5)  # m/s, rad/s at the beginning


@dataclass(frozen=True)
class _Run:
    """One run, and the momentum of both bodies together."""

    recording: Recording
    momenta: Momenta

    @property
    def hinge(self) -> FloatArray:
        """The hinge's angle (t + 1,) in rad."""
        return self.recording.position[:, self.recording.layout.dof_names.index(HINGE)]

    @property
    def off_line(self) -> FloatArray:
        """Distance (t + 1,) in m of the centre of mass from where its first velocity leads it."""
        centre, times = self.momenta.centre, self.recording.times
        mass_velocity = (centre[1] - centre[0]) / (times[1] - times[0])
        straight = centre[0] + times[:, np.newaxis] * mass_velocity
        off: FloatArray = np.linalg.norm(centre - straight, axis=1)
        return off

    @property
    def changes(self) -> tuple[FloatArray, FloatArray]:
        """Distances (t + 1,) of P in kg m/s and L in kg m^2/s from their first values."""
        linear, angular = (
            np.linalg.norm(values - values[0], axis=1)
            for values in (self.momenta.linear, self.momenta.angular)
        )
        return linear, angular


def run(runner: StudyRunner, result: StudyResult) -> None:
    """Drive two boxes on a hinge, floating: by a torque, by forces between them, as a whole.

    The torque is prescribed over time. The forces that do the same depend on how the boxes lie, so
    they are worked out from the states that the torque has led to.
    """
    boxes = write_hinged_boxes(runner, "hinged", _PARENT, _CHILD)
    by_torque = _run(runner, boxes, "torque")
    at_fine_rate = _run(runner, boxes, "torque_fine", rate=_FINE_RATE)
    pushes = balanced_pushes(by_torque.recording, _profile(_RATE))
    by_forces = _run(runner, boxes, "forces", torque=0.0, pushes=pushes)
    by_root = _run(runner, boxes, "root_force", force=_FORCE, rate=_FINE_RATE)
    passive = _run(runner, boxes, "nothing", torque=0.0)
    apart = np.abs(by_torque.recording.position - by_forces.recording.position).max(axis=1)
    for name, run in (
        (f"joint torque, {_RATE} Hz", by_torque),
        (f"joint torque, {_FINE_RATE} Hz", at_fine_rate),
        ("forces between the bodies", by_forces),
        (f"and a root force of {_FORCE:g} N, {_FINE_RATE} Hz", by_root),
        ("neither", passive),
    ):
        result.rows.append(_row(name, run, by_torque))
    hinge, difference, *others = result.add_panels(result.name, 2, 2, (11.0, 7.0))
    times = by_torque.recording.times
    hinge.plot(times, by_torque.hinge, linewidth=2.5, alpha=0.7, label="by a joint torque")
    hinge.plot(times, by_forces.hinge, "k--", label="by 3 pairs of forces")
    hinge.plot(times, passive.hinge, color="tab:gray", label="by neither")
    label(hinge, "time (s)", "angle of the hinge (rad)", "the same motion: τ = Σ r × f, Σ f = 0")
    difference.semilogy(times, np.maximum(apart, _SMALLEST_DRAWN), label="largest entry")
    label(difference, "time (s)", "position apart (rad, m)", "the two runs differ by rounding")
    _draw_momentum(others, by_torque, at_fine_rate, by_root)
    curves = {"hinge_by_torque_rad": by_torque.hinge, "hinge_by_forces_rad": by_forces.hinge}
    result.add_curves("joint_torque_hinge", {"time_s": times, **curves})
    result.remarks += [
        f"three pairs of forces move the boxes as the torque sum r x f does: positions agree "
        f"within {apart.max():.1e}; what of it is not along the hinge's axis the hinge holds",
        "a joint torque changes neither P nor L; what is left falls with the step. "
        "A root force does",
    ]


def _profile(rate: int) -> FloatArray:
    """The torque (t,) in N m at ticks of a rate in Hz: one way, and back."""
    times = np.arange(round(_DURATION * rate)) / rate
    torque: FloatArray = _TORQUE * np.sin(2.0 * np.pi * times / _DURATION)
    return torque


def _run(
    runner: StudyRunner,
    boxes: str,
    name: str,
    *,
    torque: float = 1.0,  # factor of the torque's profile
    force: float = 0.0,  # N, of the root along x
    rate: int = _RATE,
    pushes: Sequence[PlannedPush] = (),
) -> _Run:
    layout, torques = load_character(boxes).layout, torque * _profile(rate)
    efforts = np.zeros((len(torques), layout.size))
    efforts[:, layout.dof_names.index(HINGE)] = torques
    efforts[:, 0] = force
    path = runner.path(f"{name}.csv")
    write_effort_series(path, layout, np.arange(len(torques)) / rate, efforts)
    case = RunSpec(
        label=name,
        character=boxes,
        duration=_DURATION,
        reference=HOLD,
        simulator={
            **IN_SPACE,
            "rate": rate,
            "initial_velocity": list(_SPIN),
            "wrench_duration": 1.0 / rate,  # each push is for one tick
        },
        controller={
            "law": "feedforward",
            "feedforward": str(path),
            "root_assistance": bool(force),
        },
        pushes=pushes,
    )
    run = runner.run(case).recording
    return _Run(run, momenta(run.character, run.position, run.velocity))


def forces_of_torque(points: FloatArray, forces: FloatArray, axis: FloatArray) -> FloatArray:
    """Forces (k, 3) that sum to zero and whose torque `sum r x f` has 1 N m along an axis (3,).

    `forces` (k - 1, 3) say their directions, at `points` (k, 3) in m from any origin: as they sum
    to zero, the torque does not depend on it.
    """
    balanced: FloatArray = np.vstack((forces, -forces.sum(axis=0)))
    return balanced / float(np.cross(points, balanced).sum(axis=0) @ axis)


def balanced_pushes(recording: Recording, torques: FloatArray) -> list[PlannedPush]:
    """Pushes for each tick that are to the hinge what its torques (t,) in N m were in a recording.

    Forces at points of the child, and their opposites on the parent at the same points in space.
    """
    axis = np.array(recording.character.links[1].joint.axis_in_child)
    unit = forces_of_torque(_POINTS, _FORCES, axis)
    parent, child = (link.name for link in recording.character.links)
    pushes = []
    for tick, torque in enumerate(torques.tolist()):
        position = recording.position[tick]
        # Turns the parent's axes into the world's.
        turn = rotations.matrix(rotations.exp(position[3:6]))
        # Turns the child's axes into the parent's.
        bend = rotations.matrix(rotations.exp(position[6] * axis))
        stamp = int(recording.stamps_ns[tick])
        for point, force in zip(_POINTS, torque * unit, strict=True):
            in_world = turn @ bend @ force
            where = bend @ point  # the hinge is at the origin of both
            pushes += [_push(stamp, child, in_world, point), _push(stamp, parent, -in_world, where)]
    return pushes


def _push(stamp_ns: int, link: str, force: FloatArray, point: FloatArray) -> PlannedPush:
    x, y, z = point.tolist()
    return PlannedPush(stamp_ns, link, (*force.tolist(), 0.0, 0.0, 0.0), (x, y, z))


def _row(name: str, run: _Run, other: _Run) -> Row:
    ours, theirs = run.recording.position, other.recording.position
    linear, angular = run.changes
    return {
        "driven by": name,
        "hinge at the end (rad)": float(run.hinge[-1]),
        "state off that of the torque (rad, m)": (
            float(np.abs(ours - theirs).max()) if len(ours) == len(theirs) else None
        ),
        "P changed by (kg m/s)": float(linear.max()),
        "L changed by (kg m^2/s)": float(angular.max()),
        "centre of mass off its line (m)": float(run.off_line.max()),
    }


def _draw_momentum(
    panels: Sequence[Axes], by_torque: _Run, at_fine_rate: _Run, by_root: _Run
) -> None:
    """The centre of mass of both boxes, and their momentum."""
    centre, momentum = panels
    times, mass = by_torque.recording.times, by_root.recording.character.mass
    for run, name, color in (
        (by_torque, f"joint torque, {_RATE} Hz", "tab:blue"),
        (at_fine_rate, f"joint torque, {_FINE_RATE} Hz", "tab:orange"),
        (by_root, f"and a root force, {_FINE_RATE} Hz", "tab:green"),
    ):
        clock, (linear, angular) = run.recording.times, run.changes
        centre.semilogy(clock, np.maximum(run.off_line, _SMALLEST_DRAWN), color=color, label=name)
        momentum.plot(clock, linear, color=color, label=f"P, {name}")
        momentum.plot(clock, angular, ":", color=color, label=f"L, {name}")
    centre.semilogy(times[1:], 0.5 * _FORCE / mass * times[1:] ** 2, label="f t² / 2 m", **THEORY)
    centre.set_ylim(1e-7, 10.0)
    momentum.plot(times, _FORCE * times, label="f t", **THEORY)
    label(centre, "time (s)", "centre of mass off its line (m)", "only the root force moves it")
    label(momentum, "time (s)", "change of P (kg m/s), L (kg m²/s)", "and only that adds momentum")
