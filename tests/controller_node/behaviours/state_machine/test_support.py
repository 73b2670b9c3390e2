"""Efforts of a body on its feet: the equation of motion holds with the wrenches that they press."""

import numpy as np
import pytest

from controller_node.behaviours.state_machine.leg import make_leg
from controller_node.behaviours.state_machine.support import (
    Bounds,
    Contact,
    bounded,
    ground_wrench,
    solve_symmetric,
    support_effort,
)
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.geometry import rotations
from msgs_config.geometry.single_rotations import Vector
from tests.support.physics import character

HUMANOID = character("humanoid")
SIZE = HUMANOID.layout.size
FOOT = make_leg(HUMANOID, "right_hip", "right_knee", "right_ankle").foot_link


def moving_model() -> tuple[DynamicsModel, np.ndarray]:
    rng = np.random.default_rng(3)
    position = np.array(HUMANOID.rest_position)
    position[6:] += rng.normal(0.0, 0.1, SIZE - 6)
    model = DynamicsModel(HUMANOID)
    model.update(position, rng.normal(0.0, 0.3, SIZE))
    return model, position


def solve(wanted: np.ndarray, bounds: Bounds) -> tuple[np.ndarray, np.ndarray, DynamicsModel]:
    """The effort, the acceleration that it leads to with any wrench at the foot, and the model."""
    model, position = moving_model()
    x, y, z = position[:3].tolist()
    qx, qy, qz, qw = rotations.exp(position[3:6]).tolist()
    cx, cy, cz = model.centre_of_mass().tolist()
    pressure: Vector = (0.04, -0.08, 0.0)
    effort = support_effort(
        model,
        wanted,
        [Contact("right", FOOT, 1.0, pressure)],
        bounds,
        ((x, y, z), (qx, qy, qz, qw), (cx, cy, cz)),
    )
    # the force (3) and the moment about z that the root's six equations leave open
    jacobian = model.point_jacobian(FOOT, np.array(pressure))[[0, 1, 2, 5]]
    return effort, jacobian, model


def test_what_is_wanted_happens_where_the_ground_can_bear_it() -> None:
    wanted = np.zeros(SIZE)
    wanted[2:6], wanted[10], wanted[15] = (0.5, 0.3, 0.1, -0.2), 4.0, -6.0
    effort, jacobian, model = solve(wanted, Bounds(friction=10.0, spin=10.0, least=0.0, most=9.0))

    # M a + C = f + J' w, unknown: the horizontal acceleration, and w
    mass, bias = model.mass_matrix(), model.bias_force()
    known = mass @ wanted + bias - effort
    unknown = np.concatenate((jacobian.T, -mass[:, :2]), axis=1)
    found, *_ = np.linalg.lstsq(unknown, known, rcond=None)

    np.testing.assert_allclose(unknown @ found, known, atol=1e-9)
    assert found[2] == pytest.approx(model.weight, rel=0.2)  # it carries the body
    assert (effort[:6] == 0.0).all()


def test_beyond_friction_joints_still_move_as_wanted() -> None:
    wanted = np.zeros(SIZE)
    wanted[2:6], wanted[10] = (0.0, 30.0, -20.0, 25.0), 4.0
    effort, jacobian, model = solve(wanted, Bounds(friction=0.1, spin=0.001))

    # now the whole acceleration of the root is unknown, that of the joints is not
    mass, bias = model.mass_matrix(), model.bias_force()
    known = mass[:, 6:] @ wanted[6:] + bias - effort
    unknown = np.concatenate((jacobian.T, -mass[:, :6]), axis=1)
    found, *_ = np.linalg.lstsq(unknown, known, rcond=None)

    np.testing.assert_allclose(unknown @ found, known, atol=1e-9)


def test_without_contact_the_body_falls_freely() -> None:
    model, position = moving_model()
    wanted = np.zeros(SIZE)
    wanted[10] = 4.0
    origin: Vector = (0.0, 0.0, 0.0)
    effort = support_effort(model, wanted, [], Bounds(), (origin, (0.0, 0.0, 0.0, 1.0), origin))

    happens = np.linalg.solve(model.mass_matrix(), effort - model.bias_force())

    np.testing.assert_allclose(happens[6:], wanted[6:], atol=1e-8)
    acceleration = model.centre_of_mass_jacobian() @ (happens) + _convective(model, position)
    np.testing.assert_allclose(acceleration, (0.0, 0.0, -9.81), atol=1e-3)


def _convective(model: DynamicsModel, position: np.ndarray) -> np.ndarray:
    """Acceleration of the centre of mass where no entry accelerates, by differences."""
    velocity = np.random.default_rng(3)
    velocity.normal(0.0, 0.1, SIZE - 6)
    rates = velocity.normal(0.0, 0.3, SIZE)
    step, speeds = 1e-5, []
    layout = HUMANOID.layout
    for sign in (-1.0, 1.0):
        moved = position + sign * step * rates
        turns = rotations.multiply(
            rotations.exp(position[layout.rotation_entries]),
            rotations.exp(sign * step * rates[layout.rotation_entries]),
        )
        moved[layout.rotation_entries] = rotations.log(turns)
        other = DynamicsModel(HUMANOID)
        other.update(moved, rates)
        speeds.append(other.centre_of_mass_velocity())
    return (speeds[1] - speeds[0]) / (2.0 * step)


def test_a_force_has_no_moment_about_the_centre_of_pressure() -> None:
    root, centre, pressure = (0.1, 0.0, 0.9), (0.12, 0.02, 0.95), (0.05, -0.03, 0.0)
    weight = 45.0 * 9.81

    force, _, (ahead, left) = ground_wrench(
        ((0.0, 0.0, weight), (weight * 0.02, -weight * 0.02, 0.0)), root, centre, pressure, 45.0
    )

    # an inverted pendulum: a = g / h (c - p)
    assert ahead == pytest.approx(9.81 / 0.95 * (0.12 - 0.05), rel=1e-6)
    assert left == pytest.approx(9.81 / 0.95 * (0.02 + 0.03), rel=1e-6)
    assert force == pytest.approx((45.0 * ahead, 45.0 * left, weight))


def test_the_ground_bears_no_more_than_its_bounds() -> None:
    bounds = Bounds(friction=0.5, spin=0.02, least=0.1, most=2.0)

    force, spin = bounded((300.0, 400.0, 400.0), 30.0, bounds, 441.0)

    assert force == pytest.approx((120.0, 160.0, 400.0))  # the direction is kept
    assert spin == pytest.approx(8.0)
    assert bounded((0.0, 0.0, -50.0), 0.0, bounds, 441.0)[0][2] == pytest.approx(44.1)


def test_equations_are_solved() -> None:
    rng = np.random.default_rng(1)
    root = rng.normal(size=(6, 6))
    matrix, right = root @ root.T + np.eye(6), rng.normal(size=6)

    np.testing.assert_allclose(solve_symmetric(matrix, right), np.linalg.solve(matrix, right))
