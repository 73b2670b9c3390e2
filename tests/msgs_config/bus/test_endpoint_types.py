"""Nodes that use a topic with another message type are named, for DDS never joins the two."""

from collections.abc import Iterator

import pytest
from rclpy.context import Context

from msgs_config.messages import topics
from msgs_config.messages.topic import STREAM, Topic
from tests.support.ros import Client, Process, Processes, wait_until

pytestmark = pytest.mark.slow

JOINT_STATE, MULTI_DOF = "sensor_msgs/msg/JointState", "sensor_msgs/msg/MultiDOFJointState"
NUMBERS = "std_msgs/msg/Float64MultiArray"


@pytest.fixture
def stranger(context: Context) -> Iterator[Client]:
    client = Client(context, "effort_controller")
    yield client
    client.close()


def told(process: Process, *words: str) -> str:
    """The line of a process that has all these words, once it is there."""

    def find() -> list[str]:
        return [line for line in process.stderr.splitlines() if all(word in line for word in words)]

    lines: list[str] = wait_until(find, f"a line with {words}")
    return lines[0]


@pytest.mark.parametrize(
    ("topic", "right"),
    [
        ("joint_torques", JOINT_STATE),
        ("external_wrench", MULTI_DOF),
        ("throw", JOINT_STATE),
    ],
)
def test_the_simulator_names_whoever_sends_another_type(
    topic: str, right: str, stranger: Client, processes: Processes
) -> None:
    stranger.speak(Topic(topic, "std_msgs/msg/Float64MultiArray", STREAM))

    simulator = processes.simulator()

    line = told(simulator, f"'/{topic}' is published by /effort_controller as")
    assert f"as {NUMBERS}, which is never heard: its type must be {right}" in line


def test_the_line_about_missing_commands_names_the_type_that_was_found_and_the_right_one(
    stranger: Client, processes: Processes
) -> None:
    stranger.speak(Topic(topics.JOINT_TORQUES.name, "std_msgs/msg/Float64MultiArray", STREAM))

    simulator = processes.simulator()

    line = told(simulator, "waiting for commands of hinge")
    assert f"the type of /effort_controller is {NUMBERS}, and must be {JOINT_STATE}" in line


def test_the_simulator_names_whoever_reads_another_type(
    stranger: Client, processes: Processes
) -> None:
    stranger.listen(Topic(topics.JOINT_STATES.name, "std_msgs/msg/String", STREAM))

    simulator = processes.simulator()

    line = told(simulator, "'/joint_states' is read by /effort_controller")
    assert f"as std_msgs/msg/String, which is never sent: its type must be {JOINT_STATE}" in line


@pytest.mark.parametrize(
    ("topic", "right"),
    [
        ("joint_states", JOINT_STATE),
        ("episode", "std_msgs/msg/Header"),
        ("cmd_vel", "geometry_msgs/msg/Twist"),
    ],
)
def test_the_controller_names_whoever_sends_another_type(
    topic: str, right: str, stranger: Client, processes: Processes
) -> None:
    stranger.speak(Topic(topic, "std_msgs/msg/Float64MultiArray", STREAM))
    steered = {"reference": "steered"} if topic == "cmd_vel" else {}

    controller = processes.controller("humanoid" if steered else "pendulum", **steered)

    line = told(controller, f"'/{topic}' is published by /effort_controller")
    assert f"as {NUMBERS}, which is never heard: its type must be {right}" in line


def test_a_node_is_named_once_and_one_that_comes_later_as_well(
    stranger: Client, context: Context, processes: Processes
) -> None:
    simulator = processes.simulator()
    wrong = Topic(topics.JOINT_TORQUES.name, "std_msgs/msg/Float64MultiArray", STREAM)
    stranger.speak(wrong)
    told(simulator, "'/joint_torques' is published by /effort_controller as")
    later = Client(context, "later")
    try:
        later.speak(wrong)
        told(simulator, "'/joint_torques' is published by /later as")
    finally:
        later.close()

    first = "'/joint_torques' is published by /effort_controller as"
    assert simulator.stderr.count(first) == 1


def test_nodes_with_the_right_types_are_not_named(processes: Processes) -> None:
    simulator = processes.simulator(max_ticks=700)
    controller = processes.controller()

    assert simulator.wait() == 0

    assert "its type must be" not in simulator.stderr + controller.stderr
