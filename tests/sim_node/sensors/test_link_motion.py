"""A link's motion by the state alone is that which the engine has for the link."""

import numpy as np
import pytest

from msgs_config.geometry import rotations
from sim_node.sensors.link_motion import LinkKinematics
from tests.support.physics import (
    EVERY_CHARACTER,
    character,
    character_id,
    free_random_state,
    link_motions,
    link_poses,
    still_world,
)


@pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
def test_every_link_moves_as_the_engine_says(name: str) -> None:
    whole, rng = character(name), np.random.default_rng(3)
    with still_world(whole) as world:
        position, velocity = free_random_state(world.body, whole, rng)
        motions = link_motions(world.body, whole)
        origins, turns = link_poses(world.body, whole)

    for link, engine, origin, turn in zip(whole.links, motions, origins, turns, strict=True):
        kinematics = LinkKinematics(whole, link.name)
        found = kinematics.motion(position.tolist(), velocity.tolist())
        inertial = link.inertial_pose
        centre = found.at(inertial.position, inertial.orientation_xyzw)

        assert kinematics.orientation(position.tolist()) == found.turn_xyzw
        assert found.origin == pytest.approx(origin, abs=1e-6)
        assert abs(np.dot(found.turn_xyzw, turn)) == pytest.approx(1.0, abs=1e-9)
        assert centre.origin == pytest.approx(engine.centre, abs=1e-6)
        assert centre.velocity == pytest.approx(engine.velocity, abs=1e-5)
        spin = rotations.rotate(np.array(centre.turn_xyzw), np.array(centre.angular_velocity))
        assert spin == pytest.approx(engine.angular_velocity, abs=1e-5)
