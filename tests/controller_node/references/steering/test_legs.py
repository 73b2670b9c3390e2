"""Legs: where MuJoCo has their feet, and joints that bring these where they are to be."""

import numpy as np
import pytest

from controller_node.references.steering.legs import Legs
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.model import Character
from msgs_config.geometry import rotations
from tests.support.physics import character

HUMANOID = character("humanoid")


def frames(body: Character, pose: GeneralizedPosition) -> tuple[FloatArray, FloatArray]:
    """Places (f, 3) and orientations (f, 4) of the feet, by MuJoCo's kinematics."""
    position = pose.position.copy()
    position[body.layout.rotation_entries] = rotations.log(pose.orientations_xyzw)
    model = DynamicsModel(body)
    model.update(position, np.zeros(body.layout.size))
    names = [link.name for link in body.links]
    return model.link_frames(np.array([names.index(name) for name in body.feet]))


def posed(body: Character, seed: int, spread: float = 0.3) -> GeneralizedPosition:
    """A pose around that at rest, with bent knees, anywhere and turned."""
    rng = np.random.default_rng(seed)
    position = np.array(body.rest_position) + spread * rng.normal(size=body.layout.size)
    for joint in body.moving_joints:
        entries = body.layout.joint(joint.name).entries
        if np.isfinite(joint.lower) and np.isfinite(joint.upper):
            middle, half = 0.5 * (joint.lower + joint.upper), 0.25 * (joint.upper - joint.lower)
            position[entries] = middle + half * rng.uniform(-1.0, 1.0)
    return body.layout.configuration(position)


@pytest.mark.parametrize("seed", range(5))
def test_feet_are_where_another_kinematics_has_them(seed: int) -> None:
    pose = posed(HUMANOID, seed)

    found = Legs(HUMANOID).feet(pose)

    places, turns = frames(HUMANOID, pose)
    assert found.position.reshape(-1, 3) == pytest.approx(places, abs=1e-12)
    matrices = rotations.matrix(found.orientations_xyzw)
    assert matrices == pytest.approx(turns.reshape(-1, 3, 3), abs=1e-12)


@pytest.mark.parametrize("seed", range(1, 9))
def test_legs_reach_where_feet_of_another_pose_are(seed: int) -> None:
    start, goal = posed(HUMANOID, 100, 0.1), posed(HUMANOID, 100 + seed, 0.1)
    root = start.position[:6].copy(), start.orientations_xyzw[0].copy()
    goal.position[:6], goal.orientations_xyzw[0] = root
    wanted = Legs(HUMANOID).feet(goal)

    Legs(HUMANOID).reach(start, wanted)

    places, turns = frames(HUMANOID, start)
    assert places == pytest.approx(wanted.position.reshape(-1, 3), abs=2e-3)
    assert turns.reshape(-1, 3, 3) == pytest.approx(
        rotations.matrix(wanted.orientations_xyzw), abs=2e-2
    )
    assert start.position[:6].tolist() == root[0].tolist()


def test_a_leg_that_is_too_short_stretches_towards_its_foot() -> None:
    pose, legs = posed(HUMANOID, 3, 0.0), Legs(HUMANOID)
    feet = legs.feet(pose)
    feet.position[2] -= 1.0  # the first foot, 1 m lower

    before = legs.feet(pose).position[2]
    legs.reach(pose, feet)

    after = legs.feet(pose).position
    assert feet.position[2] < after[2] < before - 0.05
    assert np.isfinite(pose.position).all()
    knee = pose.position[HUMANOID.layout.joint("right_knee").start]
    assert -3.14 <= knee <= 0.0


def test_a_leg_whose_foot_is_there_does_not_move() -> None:
    pose, legs = posed(HUMANOID, 4), Legs(HUMANOID)
    before = pose.position.copy(), pose.orientations_xyzw.copy()

    legs.reach(pose, legs.feet(pose))

    assert pose.position == pytest.approx(before[0], abs=1e-12)
    assert pose.orientations_xyzw == pytest.approx(before[1], abs=1e-12)
