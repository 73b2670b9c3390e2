"""The tag of ros2_control in a robot's description, as JointStateTopicSystem's page has it."""

from xml.etree import ElementTree

import pytest

from msgs_config.character.loading import load_character
from msgs_config.character.urdf.robot_description import robot_description
from msgs_config.character.urdf.ros2_control import controlled_joints, with_ros2_control
from msgs_config.errors import ConfigurationError


def tag(name: str, *interfaces: str) -> ElementTree.Element:
    character = load_character(name)
    text = with_ros2_control(
        robot_description(character), character, interfaces, "/robot_joint_states", "/commands"
    )
    (found,) = ElementTree.fromstring(text).findall("ros2_control")
    return found


def test_it_names_plugin_topics_and_joints() -> None:
    found = tag("franka_panda", "position")

    assert found.attrib == {"name": "actuated_character", "type": "system"}
    plugin = "joint_state_topic_hardware_interface/JointStateTopicSystem"
    assert found.findtext("hardware/plugin") == plugin
    assert {each.get("name"): each.text for each in found.iter("param")} == {
        "joint_states_topic": "/robot_joint_states",
        "joint_commands_topic": "/commands",
        "trigger_joint_command_threshold": "-1",  # always: the world waits for each
    }
    joints = [each.get("name") for each in found.iter("joint")]
    assert joints[:7] == [f"panda_joint{number}" for number in range(1, 8)] and len(joints) == 9


def test_all_joints_have_the_same_interfaces() -> None:
    for joint in tag("franka_panda", "effort", "position").iter("joint"):
        commands = [each.get("name") for each in joint.iter("command_interface")]
        states = [each.get("name") for each in joint.iter("state_interface")]
        assert (commands, states) == (["position", "effort"], ["position", "velocity", "effort"])


def test_a_floating_base_is_left_out() -> None:
    assert "root" not in controlled_joints(load_character("laikago"))


def test_ball_joints_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="'chest' is a ball joint"):
        tag("humanoid", "position")
