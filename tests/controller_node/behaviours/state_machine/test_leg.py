"""Legs: their inverse kinematics, against the model's own kinematics."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller_node.behaviours.state_machine.legs.leg import FootPose, make_leg
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.errors import ConfigurationError
from msgs_config.geometry.scalars import (
    Vector,
    about_z,
    add,
    conjugate,
    exp,
    log,
    multiply,
    norm,
    rotate,
)
from tests.support.physics import character

HUMANOID = character("humanoid")
MODEL = DynamicsModel(HUMANOID)
LEGS = {
    side: make_leg(HUMANOID, *(f"{side}_{part}" for part in ("hip", "knee", "ankle")))
    for side in ("right", "left")
}
UPRIGHT = exp((np.pi / 2, 0.0, 0.0))
small = st.floats(-0.3, 0.3)


@settings(max_examples=50, deadline=None)
@given(
    st.sampled_from(["right", "left"]),
    st.tuples(small, small, small),
    st.tuples(st.floats(-0.4, 0.4), st.floats(-0.2, 0.2), st.floats(-0.7, -0.55)),
    st.tuples(small, small, small),
)
def test_the_foot_is_where_it_is_wanted(
    side: str, tilt: Vector, foot: Vector, turn: Vector
) -> None:
    leg, root = LEGS[side], (0.3, -0.2, 0.8)
    root_xyzw = multiply(exp(tilt), UPRIGHT)
    hip = add(root, rotate(root_xyzw, leg.hip_in_root))
    wanted = FootPose(add(hip, foot), exp(turn))

    angles = leg.angles(root, root_xyzw, wanted, (0.0, 1.0, 0.0))

    position = np.array(HUMANOID.rest_position)
    position[:3], position[3:6] = root, log(root_xyzw)
    position[leg.hip_entries], position[leg.knee_entry] = angles.hip, angles.knee
    position[leg.ankle_entries] = angles.ankle
    MODEL.update(position, np.zeros(HUMANOID.layout.size))
    origins, turns = MODEL.link_poses()
    x, y, z, w = turns[leg.foot_link].tolist()
    there = add(tuple(origins[leg.foot_link].tolist()), rotate((x, y, z, w), leg.sole_in_foot))
    assert there == pytest.approx(wanted.sole, abs=1e-9)
    against = multiply((x, y, z, w), conjugate(multiply(wanted.turn, leg.upright[2])))
    assert norm(log(against)) < 1e-7
    assert angles.knee < 0.0  # of this character: bent backwards


def test_a_leg_that_is_too_short_points_there_almost_straight() -> None:
    leg, root = LEGS["left"], (0.0, 0.0, 0.9)

    angles = leg.angles(root, UPRIGHT, FootPose((0.8, 0.08, 0.0), about_z(0.0)), (0.0, 1.0, 0.0))

    assert angles.knee == pytest.approx(-0.05, abs=1e-6)


def test_the_sole_is_that_of_the_foots_box() -> None:
    leg = LEGS["right"]

    assert leg.sole_in_foot == pytest.approx((0.045, -0.05, 0.0))  # as docs/characters.md has it
    assert (leg.half_length, leg.half_width) == pytest.approx((0.0885, 0.045))


@pytest.mark.parametrize(
    ("joints", "says"),
    [
        (("right_knee", "right_hip", "right_ankle"), "'right_knee' is revolute; in a leg it must"),
        (("right_shoulder", "right_elbow", "right_ankle"), "must hang straight down at angle 0"),
    ],
)
def test_what_is_no_leg_is_refused(joints: tuple[str, str, str], says: str) -> None:
    with pytest.raises(ConfigurationError, match=says):
        make_leg(HUMANOID, *joints)
