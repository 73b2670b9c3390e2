"""The tag of ros2_control in a character's URDF, by which a controller manager finds its joints.

The hardware is the pair of `JointState` topics of ros-controls' `topic_based_hardware_interfaces`
(1.1): https://control.ros.org/jazzy/doc/topic_based_hardware_interfaces/doc/index.html.
"""

from collections.abc import Sequence
from xml.etree import ElementTree

from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError

COMMAND_INTERFACES = ("position", "velocity", "effort")
HARDWARE = "actuated_character"
"""The name of the hardware; a controller manager's node for it is called so, too."""

_PLUGIN = "joint_state_topic_hardware_interface/JointStateTopicSystem"
_ALWAYS = "-1"  # the difference of state and command from which on a command is sent: any


def controlled_joints(character: Character) -> list[str]:
    """The joints that ros2_control can command: those with a motor, in the layout's order.

    Raises:
        ConfigurationError: one is a ball joint, which ros2_control does not know, or there is none.
    """
    names = character.layout.actuated_joint_names
    for name in names:
        if character.layout.joint(name).type is JointType.SPHERICAL:
            raise ConfigurationError(
                f"character '{character.name}': '{name}' is a ball joint, and ros2_control knows "
                "hinges and sliders alone; it must be a character without ball joints"
            )
    if not names:
        raise ConfigurationError(
            f"character '{character.name}' has no joint with a motor for ros2_control"
        )
    return names


def with_ros2_control(
    description: str,
    character: Character,
    interfaces: Sequence[str],
    states_topic: str,
    commands_topic: str,
) -> str:
    """The text of a URDF with the tag, whose joints have these command interfaces.

    All joints have the same ones: a command lists those of one kind without the joints' names. Of
    several kinds, those that no controller claims come as NaN. Commands are always sent, as the
    simulation waits for each.

    Raises:
        ConfigurationError: the character has no joint for it, or a ball joint.
    """
    robot = ElementTree.fromstring(description)
    tag = ElementTree.SubElement(robot, "ros2_control", name=HARDWARE, type="system")
    hardware = ElementTree.SubElement(tag, "hardware")
    ElementTree.SubElement(hardware, "plugin").text = _PLUGIN
    for name, value in {
        "joint_states_topic": states_topic,
        "joint_commands_topic": commands_topic,
        "trigger_joint_command_threshold": _ALWAYS,
    }.items():
        ElementTree.SubElement(hardware, "param", name=name).text = value
    for name in controlled_joints(character):
        joint = ElementTree.SubElement(tag, "joint", name=name)
        for interface in COMMAND_INTERFACES:
            if interface in interfaces:
                ElementTree.SubElement(joint, "command_interface", name=interface)
        for interface in COMMAND_INTERFACES:
            ElementTree.SubElement(joint, "state_interface", name=interface)
    return ElementTree.tostring(robot, encoding="unicode")
