"""Efforts of a body on its feet: the equation of motion holds with the wrenches that they press."""

import numpy as np
import pytest

from controller_node.behaviours.state_machine.legs.leg import make_leg
from controller_node.behaviours.state_machine.support import (
    Bounds,
    FootContact,
    bounded,
    support_effort,
)
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.geometry import rotations
from msgs_config.geometry.scalars import Vector
from tests.support.physics import character

HUMANOID = character("humanoid")
SIZE = HUMANOID.layout.size
LEGS = {
    side: make_leg(HUMANOID, f"{side}_hip", f"{side}_knee", f"{side}_ankle")
    for side in ("right", "left")
}
ANYTHING = Bounds(friction=10.0, spin=10.0, least=0.0, most=9.0)
PRESSURE: Vector = (0.04, -0.08, 0.0)
RIGHT = FootContact("right", LEGS["right"], 1.0, PRESSURE)
OTHERS = [entry for entry in range(6, SIZE) if entry not in LEGS["right"].entries]


def moving_model() -> tuple[DynamicsModel, np.ndarray, np.ndarray]:
    """A model, and the position and the velocity that it is in: the knees are bent."""
    rng = np.random.default_rng(3)
    position = np.array(HUMANOID.rest_position)
    position[6:] += rng.normal(0.0, 0.1, SIZE - 6)
    for leg in LEGS.values():
        position[leg.knee_entry] = leg.knee_sign * 0.9
    velocity = rng.normal(0.0, 0.3, SIZE)
    model = DynamicsModel(HUMANOID)
    model.update(position, velocity)
    return model, position, velocity


def moved(position: np.ndarray, velocity: np.ndarray, time: float) -> DynamicsModel:
    """The model after a time at a velocity that stays what it is."""
    turned = HUMANOID.layout.rotation_entries
    there = position + time * velocity
    there[turned] = rotations.log(
        rotations.multiply(rotations.exp(position[turned]), rotations.exp(time * velocity[turned]))
    )
    model = DynamicsModel(HUMANOID)
    model.update(there, velocity)
    return model


def support(wanted: np.ndarray, contacts: list[FootContact], bounds: Bounds) -> np.ndarray:
    """The effort of the model that moves."""
    model, position, _ = moving_model()
    x, y, z = position[:3].tolist()
    qx, qy, qz, qw = rotations.exp(position[3:6]).tolist()
    return support_effort(model, wanted, contacts, bounds, ((x, y, z), (qx, qy, qz, qw)))


def happening(effort: np.ndarray, sides: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations (n,), and the wrench (6,) on each foot about `PRESSURE`, where feet rest.

    `M a + C = f + J' w` and `J a = -J' v`, whole: by numpy, the rate of J by differences.
    """
    model, position, velocity = moving_model()
    step, point, rows, drifts = 1e-5, np.array(PRESSURE), [], []
    for side in sides:
        foot = LEGS[side].foot_link
        rows.append(model.link_jacobian(foot))
        ends = [moved(position, velocity, time).link_jacobian(foot) for time in (-step, step)]
        drifts.append((ends[1] - ends[0]) @ velocity / (2.0 * step))
    jacobian, drift = np.vstack(rows), np.concatenate(drifts)
    size = len(drift)
    left = np.block([[model.mass_matrix(), -jacobian.T], [jacobian, np.zeros((size, size))]])
    right = np.concatenate((effort - model.bias_force(), -drift))
    found, *_ = np.linalg.lstsq(left, right, rcond=None)
    wrenches = found[SIZE:].reshape(-1, 6)
    for wrench, side in zip(wrenches, sides, strict=True):
        wrench[3:] += np.cross(_centre_of(model, LEGS[side].foot_link) - point, wrench[:3])
    return found[:SIZE], wrenches


def _centre_of(model: DynamicsModel, link: int) -> np.ndarray:
    """The centre of mass of a link, m, world."""
    origins, turns = model.link_poses()
    local = np.array(HUMANOID.links[link].inertial_pose.position)
    return np.asarray(origins[link] + rotations.rotate(turns[link], local))


def test_what_is_wanted_happens_where_the_ground_can_bear_it() -> None:
    wanted = np.zeros(SIZE)
    wanted[2:6], wanted[10], wanted[15] = (0.5, 0.3, 0.1, -0.2), 4.0, -6.0
    effort = support(wanted, [RIGHT], ANYTHING)

    happens, (wrench,) = happening(effort, ["right"])

    np.testing.assert_allclose(happens[2:6], wanted[2:6], atol=0.02)
    np.testing.assert_allclose(happens[OTHERS], wanted[OTHERS], atol=0.02)
    assert wrench[2] > 100.0
    np.testing.assert_allclose(wrench[3:5], 0.0, atol=0.01 * wrench[2] * 0.1)  # there it presses
    assert (effort[:6] == 0.0).all()


def test_beyond_friction_joints_still_move_as_wanted() -> None:
    wanted = np.zeros(SIZE)
    wanted[2:6], wanted[10] = (0.0, 12.0, -8.0, 10.0), 4.0
    bounds = Bounds(friction=0.1, spin=0.001)
    effort = support(wanted, [RIGHT], bounds)

    happens, (wrench,) = happening(effort, ["right"])

    np.testing.assert_allclose(happens[OTHERS], wanted[OTHERS], atol=0.3)
    across = float(np.hypot(wrench[0], wrench[1]))
    assert across == pytest.approx(0.1 * wrench[2], rel=0.02)
    assert abs(wrench[5]) == pytest.approx(0.001 * wrench[2], rel=0.2)


def test_two_feet_share_the_load() -> None:
    wanted = np.zeros(SIZE)
    contacts = [FootContact(side, LEGS[side], 0.5, PRESSURE) for side in LEGS]
    effort = support(wanted, contacts, ANYTHING)
    joints = [entry for entry in OTHERS if entry not in LEGS["left"].entries]

    happens, wrenches = happening(effort, list(LEGS))

    np.testing.assert_allclose(happens[2:6], 0.0, atol=0.05)
    np.testing.assert_allclose(happens[joints], 0.0, atol=0.05)
    assert (wrenches[:, 2] > 50.0).all()


def test_without_contact_the_body_falls_freely() -> None:
    model, position, velocity = moving_model()
    wanted = np.zeros(SIZE)
    wanted[10] = 4.0
    effort = support(wanted, [], Bounds())

    happens = np.linalg.solve(model.mass_matrix(), effort - model.bias_force())

    np.testing.assert_allclose(happens[6:], wanted[6:], atol=1e-8)
    step = 1e-5
    ends = [moved(position, velocity, time).centre_of_mass_velocity() for time in (-step, step)]
    drift = (ends[1] - ends[0]) / (2.0 * step)
    acceleration = model.centre_of_mass_jacobian() @ happens + drift
    np.testing.assert_allclose(acceleration, (0.0, 0.0, -9.81), atol=1e-3)


def test_the_ground_bears_no_more_than_its_bounds() -> None:
    bounds = Bounds(friction=0.5, spin=0.02, least=0.1, most=2.0)

    force, spin = bounded((300.0, 400.0, 400.0), 30.0, bounds, 441.0)

    assert force == pytest.approx((120.0, 160.0, 400.0))  # the direction is kept
    assert spin == pytest.approx(8.0)
    assert bounded((0.0, 0.0, -50.0), 0.0, bounds, 441.0)[0][2] == pytest.approx(44.1)
