"""What is made of a controller manager's commands; the rules are those of the pair of topics."""

import math

import numpy as np
import pytest

from actuated_characters.ros2_control.commands import JointCommand, Target, command_in_layout
from controller_node.control_laws import GainArrays
from msgs_config.character.layout import JointLayout, JointType
from msgs_config.errors import LayoutError, MessageError
from msgs_config.messages.joint_state import JointArrays

LAYOUT = JointLayout([("a", JointType.REVOLUTE), ("b", JointType.PRISMATIC)])
NONE = np.zeros(0)
NAN = math.nan
PERIOD = 0.5  # s


def command(
    position: tuple[float, float] = (NAN, NAN),
    velocity: tuple[float, float] = (NAN, NAN),
    effort: tuple[float, float] = (NAN, NAN),
) -> JointCommand:
    return JointCommand(np.array(position), np.array(velocity), np.array(effort))


def standing() -> Target:
    return Target.standing(np.array([1.0, 2.0]))


def followed(given: JointCommand, at: tuple[float, float] = (1.1, 2.1)) -> Target:
    return standing().followed_by(given, np.array(at), PERIOD)


def test_numbers_are_matched_by_name() -> None:
    arrays = JointArrays(7, ("b", "a"), np.array([2.0, 1.0]), NONE, np.array([NAN, 3.0]))

    found = command_in_layout(LAYOUT, arrays)

    assert found.position.tolist() == [1.0, 2.0]
    assert np.isnan(found.velocity).all()
    assert found.effort[0] == 3.0 and math.isnan(found.effort[1])


def test_lists_whose_joints_are_not_known_are_refused() -> None:
    with pytest.raises(MessageError, match=r"2 names but 1 numbers in 'position'.*same command"):
        command_in_layout(LAYOUT, JointArrays(0, ("a", "b"), np.ones(1), NONE, NONE))
    with pytest.raises(LayoutError, match="elbow"):
        command_in_layout(LAYOUT, JointArrays(0, ("elbow",), np.ones(1), NONE, NONE))


def test_before_a_controller_is_active_nothing_is_commanded() -> None:
    assert not command().commands_anything
    assert command(effort=(NAN, 0.0)).commands_anything


def test_a_position_is_reached_at_the_end_of_the_period() -> None:
    target = followed(command(position=(1.5, NAN)))

    assert target.at(0.0).tolist() == [1.0, 2.0]
    assert target.at(0.5).tolist() == [1.25, 2.0]
    assert target.at(1.0).tolist() == target.at(2.0).tolist() == [1.5, 2.0]
    assert target.velocity.tolist() == [1.0, 0.0]  # rad/s on the way


def test_a_velocity_beside_it_is_the_velocity() -> None:
    target = followed(command(position=(1.5, 2.0), velocity=(0.3, NAN)))

    assert target.velocity.tolist() == [0.3, 0.0]


def test_a_velocity_alone_moves_the_target_on() -> None:
    target = followed(command(velocity=(NAN, 0.4)))

    assert target.at(1.0).tolist() == [1.0, 2.0 + PERIOD * 0.4]
    assert target.velocity.tolist() == [0.0, 0.4]


def test_an_effort_alone_is_all_that_acts_and_tracking_begins_where_it_ends() -> None:
    gains = GainArrays(*(np.full(2, 9.0) for _ in range(3)), effort_limits=np.ones(2))
    pushed = followed(command(effort=(4.0, NAN)))

    assert pushed.tracked.tolist() == [False, True]
    assert pushed.effort.tolist() == [4.0, 0.0]
    assert pushed.gains(gains).stiffness.tolist() == [0.0, 9.0]

    held = pushed.followed_by(command(), np.array([1.7, 2.2]), PERIOD)
    assert held.tracked.all() and held.at(1.0).tolist() == [1.7, 2.0]


def test_an_effort_beside_a_position_is_added() -> None:
    target = followed(command(position=(1.5, 2.0), effort=(4.0, 5.0)))

    assert target.tracked.all() and target.effort.tolist() == [4.0, 5.0]
