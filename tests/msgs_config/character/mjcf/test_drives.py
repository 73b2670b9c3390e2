"""Actuators of an MJCF as effort limits and gains; equalities as joints that follow."""

import math
from pathlib import Path

import pytest

from msgs_config.character.model import Character, Gains, Joint
from tests.support.mjcf import BALL, ROD, arm, load_mjcf

JOINTS = '<joint name="h"/><joint name="k" axis="0 1 0"/>'


def driven(folder: Path, actuators: str, joints: str = JOINTS, more: str = "") -> Character:
    """An arm with actuators."""
    return load_mjcf(folder, arm(joints), f"<actuator>{actuators}</actuator>{more}")


def joint(character: Character, name: str = "h") -> Joint:
    """A joint of a character by its name."""
    return next(each for each in character.moving_joints if each.name == name)


LIMITS = {
    "none": ('<motor joint="h"/>', math.inf),
    "gear and control": ('<motor joint="h" gear="20" ctrlrange="-0.5 0.5"/>', 10.0),
    "force": ('<motor joint="h" gear="-3" forcerange="-4 4"/>', 12.0),
    "the smaller one": ('<motor joint="h" gear="2" ctrlrange="-9 9" forcerange="-4 4"/>', 8.0),
    "a gain": ('<general joint="h" gainprm="7" ctrlrange="-1 1"/>', 7.0),
    "two motors": ('<motor joint="h" ctrlrange="-1 1"/><motor joint="h" ctrlrange="-2 2"/>', 3.0),
    "a servo's force": ('<position joint="h" kp="9" ctrlrange="-1 1" forcerange="-5 5"/>', 5.0),
    "a servo's control is none": ('<position joint="h" kp="9" ctrlrange="-1 1"/>', math.inf),
    "one of other sides": ('<motor joint="h" ctrlrange="-2 5"/>', 5.0),
}


@pytest.mark.parametrize(("actuators", "limit"), LIMITS.values(), ids=LIMITS)
def test_the_largest_effort_is_the_limit(tmp_path: Path, actuators: str, limit: float) -> None:
    assert joint(driven(tmp_path, actuators)).effort_limit == pytest.approx(limit)


def test_the_joints_own_bound_counts_too(tmp_path: Path) -> None:
    joints = '<joint name="h" actuatorfrcrange="-2 2"/>'

    character = driven(tmp_path, '<motor joint="h" ctrlrange="-9 9"/>', joints)

    assert joint(character).effort_limit == 2.0


def test_gains_of_a_servo_are_those_at_the_joint(tmp_path: Path) -> None:
    servos = '<position joint="h" kp="50" kv="2" gear="3"/><velocity joint="k" kv="4"/>'

    character = driven(tmp_path, servos)

    assert character.gains["h"] == Gains(450.0, 18.0)
    assert character.gains["k"] == Gains(0.0, 4.0)


def test_without_an_actuator_a_joint_is_limp_where_others_have_one(tmp_path: Path) -> None:
    character = driven(tmp_path, '<motor joint="h"/>')

    assert character.gains["k"] == Gains()
    assert joint(character, "k").effort_limit == 0.0
    assert character.gains["h"].stiffness > 0.0


def test_without_any_all_joints_are_driven(tmp_path: Path) -> None:
    character = load_mjcf(tmp_path, arm(JOINTS))

    assert all(character.gains[name].stiffness > 0.0 for name in ("h", "k"))
    assert joint(character, "k").effort_limit == math.inf


def test_motors_about_three_axes_bound_a_ball_joints_vector(tmp_path: Path) -> None:
    motors = "".join(
        f'<motor joint="b" gear="{axis}" ctrlrange="-1 1"/>' for axis in ("2 0 0", "0 3 0", "0 0 6")
    )

    character = driven(tmp_path, motors, '<joint name="b" type="ball"/>')

    assert joint(character, "b").effort_limit == pytest.approx(7.0)


def test_what_an_actuator_has_beside_is_said(tmp_path: Path) -> None:
    tendon = '<tendon><fixed name="t"><joint joint="k" coef="1"/></fixed></tendon>'
    actuators = (
        '<motor name="one_sided" joint="h" ctrlrange="0 1"/><damper name="brake" joint="k" kv="1" '
        'ctrlrange="0 1"/><motor name="pull" tendon="t"/><general name="slow" joint="h" '
        'dyntype="filter" dynprm="1"/>'
    )

    lines = "\n".join(driven(tmp_path, actuators, more=tendon).warnings)

    assert "left out: actuators of tendons, sites or bodies" in lines
    assert "(1): pull" in lines
    assert "is no motor or servo; its joint is driven (1): brake" in lines
    assert "left out: 'dyntype' of actuators: efforts act at once (1): slow" in lines
    assert "are the larger of both (1): one_sided" in lines
    assert "left out: <tendon> (1): t" in lines


def test_an_equality_of_two_joints_has_one_follow(tmp_path: Path) -> None:
    hand = f'<body name="b" pos="0 0 1">{ROD}<joint name="k" ref="0.2"/></body>'
    joints = f'<joint name="h" ref="0.1"/>{BALL}{hand}'
    equality = '<equality><joint joint1="k" joint2="h" polycoef="0.3 -2 0 0 0"/></equality>'

    character = load_mjcf(tmp_path, f'<body name="a">{joints}</body>', equality)

    # q_k - 0.2 = 0.3 - 2 (q_h - 0.1)
    leader, multiplier, offset = joint(character, "k").mimic or ("", 0.0, 0.0)
    assert (leader, multiplier) == ("h", -2.0)
    assert offset == pytest.approx(0.7)
    h, k = character.rest_position
    assert k == pytest.approx(0.7 - 2.0 * h)


def test_other_equalities_are_said(tmp_path: Path) -> None:
    equality = '<equality><weld name="held" body1="arm"/></equality>'

    character = load_mjcf(tmp_path, arm(JOINTS), equality)

    assert "left out: <equality> (1): held" in character.warnings
