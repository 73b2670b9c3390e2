"""The studies of one body and of two on a hinge: their maths against theory, and their runs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from actuated_characters.render.plots import draw_over_theory
from lecture import joint_torque, rigid_body
from lecture.framework.bodies import HINGE, Box, momenta, write_box
from lecture.framework.result import StudyResult
from lecture.framework.study import RunSpec
from lecture.theory.euler import (
    Load,
    RigidBody,
    RigidBodyMotion,
    angular_acceleration,
    move,
)
from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.geometry import rotations
from sim_node.physics.settings import WorldSettings
from tests.support.in_process import InProcessRunner
from tests.support.physics import FLOATING_CHARACTERS, LoneWorld, character, momentum, random_state

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

BODY = RigidBody(2.0, np.array([0.3, 0.5, 0.9]))
TIMES = np.linspace(0.0, 2.0, 801)
LOADS = (
    Load(force=(1.0, -2.0, 0.5), point=(0.1, 0.2, -0.1)),
    Load(torque=(0.2, 0.1, -0.3)),
)


def start(*spin: float) -> RigidBodyMotion:
    """At the origin, turned, with a velocity, and turning at `spin` in rad/s."""
    turn = rotations.exp(np.array([0.3, -0.8, 0.5]))
    return RigidBodyMotion(
        *(np.atleast_2d(part) for part in ([0.0] * 3, turn, [0.5, 0.0, 0.0], spin))
    )


def angular_momentum(motion: RigidBodyMotion) -> FloatArray:
    """About the centre, world axes."""
    return rotations.rotate(motion.turn_xyzw, BODY.inertia * motion.angular_velocity)


def energy(motion: RigidBodyMotion) -> FloatArray:
    twice: FloatArray = np.sum(BODY.inertia * motion.angular_velocity**2, axis=1)
    return 0.5 * twice


# The theory that the runs are compared with


def test_a_free_spin_keeps_angular_momentum_and_energy() -> None:
    motion = move(BODY, start(0.1, 5.0, 0.2), (), TIMES)

    momentum = angular_momentum(motion)
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), atol=1e-8)
    np.testing.assert_allclose(energy(motion), energy(motion)[0], rtol=1e-9)
    np.testing.assert_allclose(motion.centre[:, 0], 0.5 * TIMES, atol=1e-12)


def test_a_symmetric_body_precesses_as_theory_says() -> None:
    # Arrange: I1 = I2; the spin about the axis stays, the other two turn at (I3 - I1) / I1 of it
    body = RigidBody(1.0, np.array([0.4, 0.4, 0.7]))

    # Act
    spin = move(body, start(0.6, 0.0, 3.0), (), TIMES).angular_velocity

    # Assert
    rate = (0.7 - 0.4) / 0.4 * 3.0
    by_theory = np.column_stack((np.cos(rate * TIMES), np.sin(rate * TIMES)))
    np.testing.assert_allclose(spin[:, :2], 0.6 * by_theory, atol=1e-8)
    np.testing.assert_allclose(spin[:, 2], 3.0, atol=1e-12)


def test_a_load_changes_the_momenta_by_its_impulse_and_the_energy_by_its_work() -> None:
    motion = move(BODY, start(0.5, 1.0, -0.5), LOADS, TIMES)

    force = np.array(LOADS[0].force)
    arms = rotations.rotate(motion.turn_xyzw, np.array(LOADS[0].point))
    torques = np.cross(arms, force) + np.array(LOADS[1].torque)
    spin_in_world = rotations.rotate(motion.turn_xyzw, motion.angular_velocity)
    momenta_gained = angular_momentum(motion)[-1] - angular_momentum(motion)[0]
    np.testing.assert_allclose(momenta_gained, np.trapezoid(torques, TIMES, axis=0), atol=1e-4)
    work = np.trapezoid(np.sum(torques * spin_in_world, axis=1), TIMES)
    assert energy(motion)[-1] - energy(motion)[0] == pytest.approx(work, abs=1e-4)
    gained = BODY.mass * (motion.velocity[-1] - motion.velocity[0])
    np.testing.assert_allclose(gained, 2.0 * force, atol=1e-10)


def test_the_residual_vanishes_for_eulers_own_step_and_shows_another_inertia() -> None:
    # Arrange: a spin that was stepped by the equation itself
    step, torque = 1e-3, np.tile([0.1, -0.2, 0.3], (50, 1))
    motion = start(1.0, 2.0, 3.0)
    turn = motion.turn_xyzw[0]
    spins = [motion.angular_velocity[0]]
    for in_world in torque:
        in_body = rotations.rotate(rotations.conjugate(turn), in_world)
        spins.append(spins[-1] + step * angular_acceleration(BODY.inertia, spins[-1], in_body))
    still = np.tile(turn, (51, 1))
    stepped = RigidBodyMotion(np.zeros((51, 3)), still, np.zeros((51, 3)), np.array(spins))

    # Act
    left = rigid_body.euler_residual(BODY.inertia, stepped, torque, step)
    wrong = rigid_body.euler_residual(BODY.inertia * [1.0, 1.1, 1.0], stepped, torque, step)

    # Assert
    assert left < 1e-11
    assert wrong > 1e-2


def test_a_missed_impulse_is_what_the_load_does_not_explain() -> None:
    rng = np.random.default_rng(1)
    load = rng.normal(size=(40, 3))
    gained = np.vstack((np.ones(3), 1.0 + 0.01 * np.cumsum(load, axis=0)))

    assert rigid_body.missed_impulse(gained, load, 0.01) == pytest.approx(0.0, abs=1e-13)
    gained[-1] += [0.0, 3.0, 4.0]
    assert rigid_body.missed_impulse(gained, load, 0.01) == pytest.approx(5.0)


# Bodies


def test_a_boxs_inertia_is_that_of_its_grains(tmp_path: Path) -> None:
    # Arrange: grains in the middles of a fine grid
    box = Box("grains", 3.0, (0.5, 0.3, 0.2), (0.1, 0.0, -0.2))
    lines = [edge * ((np.arange(40) + 0.5) / 40 - 0.5) for edge in box.edges]
    x, y, z = np.meshgrid(*lines)
    squares = np.array([(y**2 + z**2).mean(), (x**2 + z**2).mean(), (x**2 + y**2).mean()])

    # Act
    loaded = load_character(write_box(InProcessRunner(tmp_path), box))

    # Assert
    np.testing.assert_allclose(box.inertia, 3.0 * squares, rtol=1e-3)
    (link,) = loaded.links
    assert link.mass == 3.0
    np.testing.assert_allclose(link.inertial_pose.position, box.centre, atol=1e-12)
    np.testing.assert_allclose(sorted(link.inertia_diagonal), sorted(box.inertia), rtol=1e-9)


@pytest.mark.parametrize("name", FLOATING_CHARACTERS, ids=lambda name: Path(name).stem)
def test_momenta_are_those_by_the_engines_own_numbers(name: str) -> None:
    whole = character(name)
    rng = np.random.default_rng(4)
    states = [random_state(whole, rng) for _ in range(3)]

    found = momenta(whole, *(np.array(part) for part in zip(*states, strict=True)))

    world = LoneWorld(whole, WorldSettings(ground=False))
    for row, state in enumerate(states):
        world.body.set_state(*state)
        linear, angular = momentum(world.body, whole)
        np.testing.assert_allclose(found.linear[row], linear, atol=1e-5 * whole.mass)
        np.testing.assert_allclose(found.angular[row], angular, atol=1e-4 * whole.mass)
        own = angular - np.cross(found.centre[row], linear)
        np.testing.assert_allclose(found.spin[row], own, atol=1e-4 * whole.mass)
    world.close()


def test_forces_that_sum_to_zero_have_the_torque_about_any_point() -> None:
    rng = np.random.default_rng(2)
    points, directions = rng.normal(size=(4, 3)), rng.normal(size=(3, 3))
    axis = np.array([0.0, 0.6, 0.8])

    forces = joint_torque.forces_of_torque(points, directions, axis)

    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-12)
    for origin in rng.normal(size=(5, 3)):
        assert np.cross(points - origin, forces).sum(axis=0) @ axis == pytest.approx(1.0)


# The studies


def test_of_theory_a_legend_says_once_what_it_is() -> None:
    axes = Figure().subplots()

    draw_over_theory(axes, np.arange(4.0), np.zeros((4, 3)), np.ones((4, 3)), "xyz")

    assert axes.get_legend_handles_labels()[1] == ["x", "y", "z", "theory"]


@pytest.fixture(scope="module")
def rigid(runner: InProcessRunner) -> StudyResult:
    return runner.study("rigid_body")


@pytest.fixture(scope="module")
def jointed(runner: InProcessRunner) -> StudyResult:
    return runner.study("joint_torque")


@pytest.fixture(scope="module")
def by_forces(runner: InProcessRunner, jointed: StudyResult) -> RunSpec:
    """The run of `joint_torque` with forces between the bodies."""
    (case,) = [case for case in runner.cases if case.label == "forces"]
    return case


def column(result: StudyResult, start_of_name: str) -> list[float]:
    (index,) = [k for k, name in enumerate(result.columns) if name.startswith(start_of_name)]
    return result.column(result.columns[index])


def test_each_load_accelerates_a_box_as_newton_and_euler_say(rigid: StudyResult) -> None:
    assert max(column(rigid, "relative difference")) < 1e-9
    assert max(column(rigid, "Euler residual")) < 1e-9
    assert max(column(rigid, "P off")) < 1e-9
    force, torque, off_centre, couple, *_ = column(rigid, "a (m/s^2)")
    assert force == off_centre == pytest.approx(3.0 / 6.0)
    assert couple == torque == 0.0
    force, torque, off_centre, couple, long, *_ = column(rigid, "dw/dt")
    assert force == 0.0
    assert torque == pytest.approx(0.3 / (6.0 / 6.0 * 0.3**2))
    assert couple == pytest.approx(2.0 * torque)  # 2 N, 0.3 m apart
    assert long == pytest.approx(0.3 / (6.0 / 12.0 * (1.2**2 + 0.15**2)))


def test_the_turn_is_off_theory_by_the_step_alone(rigid: StudyResult) -> None:
    off = column(rigid, "turn off theory")
    *loaded, free, finer = off

    assert max(loaded) < 0.01
    assert free / finer == pytest.approx(2.0, rel=0.05)  # first order: half the step
    drift, half = column(rigid, "L off")[-2:]
    assert drift / half == pytest.approx(2.0, rel=0.05)


def test_a_box_spun_about_its_middle_axis_turns_over(rigid: StudyResult) -> None:
    curve = rigid.curves["rigid_body_spin"]
    about_middle = curve["angular_velocity_y_rad_s"]

    assert about_middle.min() < -0.9 * about_middle[0]
    momentum = np.column_stack([curve[f"angular_momentum_{axis}_kg_m2_s"] for axis in "xyz"])
    assert np.linalg.norm(momentum - momentum[0], axis=1).max() < 0.005 * np.linalg.norm(
        momentum[0]
    )


def test_forces_between_two_bodies_do_what_the_joint_torque_does(
    jointed: StudyResult, by_forces: RunSpec
) -> None:
    curve = jointed.curves["joint_torque_hinge"]
    by_torque = curve["hinge_by_torque_rad"]
    np.testing.assert_allclose(curve["hinge_by_forces_rad"], by_torque, atol=1e-12)
    assert np.ptp(by_torque) > 1.0
    assert column(jointed, "state off")[-1] > 0.5  # by nothing
    by_tick: dict[int, list[tuple[float, ...]]] = {}
    for push in by_forces.pushes:
        by_tick.setdefault(push.stamp_ns, []).append(push.wrench)
    for wrenches in by_tick.values():
        np.testing.assert_allclose(np.sum(wrenches, axis=0), 0.0, atol=1e-12)


@pytest.mark.parametrize("pair", [0, 1, 2])
def test_without_one_of_the_pairs_the_motion_is_another(
    runner: InProcessRunner, jointed: StudyResult, by_forces: RunSpec, pair: int
) -> None:
    # six pushes a tick, each force and then its opposite
    some = [push for number, push in enumerate(by_forces.pushes) if number % 6 // 2 != pair]

    run = runner.run(replace(by_forces, label="some", pushes=some)).recording

    angle = run.position[:, run.layout.dof_names.index(HINGE)]
    by_torque = jointed.curves["joint_torque_hinge"]["hinge_by_torque_rad"]
    assert np.abs(angle - by_torque).max() > 0.1


def test_a_joint_torque_changes_no_momentum_and_a_root_force_does(jointed: StudyResult) -> None:
    for what, by_root in (
        ("P changed", 0.5 * 2.0),  # f t
        ("L changed", None),
        ("centre of mass", 0.5 * 0.5 / 3.0 * 2.0**2),  # f t^2 / 2 m
    ):
        coarse, fine, _, root, _ = column(jointed, what)
        assert coarse / fine == pytest.approx(8.0, rel=0.1)  # 1920 / 240
        assert fine < 0.01 * root
        assert by_root is None or root == pytest.approx(by_root, rel=0.01)
