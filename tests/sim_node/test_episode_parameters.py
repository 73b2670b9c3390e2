"""Parameters of the simulator that change at a reset, over its services and topics."""

import json
from functools import partial
from typing import Any

import pytest
from sensor_msgs.msg import JointState

from msgs_config.errors import ConfigurationError
from msgs_config.messages import topics
from msgs_config.messages.configuration import SINCE
from msgs_config.parameters import Value, Values
from sim_node.parameters import load_parameters
from tests.sim_node.conftest import Join
from tests.support.ros import Processes, SimulatorClient, joint_state, stamp_ns

NODE = topics.SIM_NODE
INITIAL_STATE = topics.INITIAL_STATE.of(topics.CONTROLLER_NODE)
STEP = 1.0 / 240.0


def told(client: SimulatorClient, count: int) -> list[dict[str, Any]]:
    """The configurations that the simulator has published, once there are so many."""
    messages = client.configuration.messages
    client.spin_until(lambda: len(messages) >= count, f"{count} configurations")
    return [json.loads(message.data) for message in messages]


def has_gravity(client: SimulatorClient, gravity: float) -> bool:
    """Whether the last configuration that a client has heard names a gravity in m/s^2."""
    return bool(told(client, 1)[-1]["parameters"]["gravity"] == gravity)


def begins_at(state: JointState) -> list[float]:
    return list(state.position)


# The parameters without ROS


def test_a_reset_takes_over_the_parameters_that_may_change_then_and_no_others() -> None:
    given = {"characters": ["one", "two"], "character": "pendulum"}
    loaded = load_parameters(given)
    wanted: dict[str, Value] = {
        "gravity": 1.0,
        "two.initial_position": [0.25],
        "wrench_duration": 3.0,
        "rate": 77,
    }

    changed = loaded.at_reset(Values(loaded.values | wanted))

    assert changed.values["wrench_duration"] == loaded.values["wrench_duration"]
    assert [each.values["gravity"] for each in changed.characters] == [1.0, 1.0]
    assert [each.values["initial_position"] for each in changed.characters] == [[0.5], [0.25]]
    assert changed.values["rate"] == changed.characters[0].values["rate"] == 240


def test_a_start_of_another_length_is_refused() -> None:
    loaded = load_parameters({"character": "pendulum"})

    with pytest.raises(ConfigurationError, match="'initial_velocity' has 2 entries; it must have"):
        loaded.check_starts(loaded.values, Values(loaded.values | {"initial_velocity": [0.0, 1.0]}))


# The node


def test_changes_count_from_the_first_state_of_the_next_episode_on(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator("lift")
    state = client.first_state()
    assert client.set_parameter(NODE, "gravity", 1.62) == (True, "")
    assert client.set_parameter(NODE, "initial_position", [0.4]) == (True, "")
    state = client.advance(state, {"height": 0.0})
    assert state.velocity[0] == pytest.approx(-9.81 * STEP)
    assert len(client.configuration) == 1

    client.reset()

    first = client.state(3)
    assert begins_at(first) == [0.4]
    following = client.advance(first, {"height": 0.0})
    assert following.velocity[0] == pytest.approx(-1.62 * STEP)
    before, after = told(client, 2)
    assert (before[SINCE], after[SINCE]) == (None, stamp_ns(state))
    changed = {
        name: value
        for name, value in after["parameters"].items()
        if value != before["parameters"][name]
    }
    assert changed == {"gravity": 1.62, "initial_position": [0.4]}
    assert after["probe"]["acceleration"] != before["probe"]["acceleration"]
    sent_ns = dict(zip(map(stamp_ns, client.states.messages), client.states.sent_ns, strict=True))
    assert client.configuration.sent_ns[1] < sent_ns[stamp_ns(first)]


def test_a_reset_without_a_change_publishes_no_configuration(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator()
    client.first_state()
    assert client.set_parameter(NODE, "gravity", 1.0) == (True, "")
    assert client.set_parameter(NODE, "gravity", 9.81) == (True, "")

    client.reset()
    client.state(2)

    assert len(client.configuration) == 1


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("gravity", -1.0, "gravity"),
        ("friction", "much", "expected"),
        ("initial_position", [0.1, 0.2], "has 2 entries; it must have 1: hinge"),
        ("initial_position", ["a"], "it must be a number"),
        ("rate", 120, "rate"),
        ("terrain", "none", "terrain"),
    ],
)
def test_what_is_wrong_is_refused_at_once_and_changes_nothing(
    processes: Processes, client: SimulatorClient, name: str, value: object, reason: str
) -> None:
    processes.simulator()
    client.first_state()

    taken, told_reason = client.set_parameter(NODE, name, value)
    client.reset()
    client.state(2)

    assert not taken
    assert reason in told_reason and "\n" not in told_reason
    assert len(client.configuration) == 1


def test_a_character_begins_again_where_its_reference_begins_now(
    processes: Processes, client: SimulatorClient
) -> None:
    references = client.speak(INITIAL_STATE)
    references.publish(joint_state(0, ["hinge"], [0.3], [0.0]))
    processes.simulator(initial_state="reference")
    assert begins_at(client.first_state()) == [0.3]
    taken, reason = client.set_parameter(NODE, "initial_position", [0.1])
    assert not taken and "'initial_state' is reference; set the controller's" in reason

    references.publish(joint_state(0, ["hinge"], [0.7], [0.2]))
    assert references.wait_for_all_acked()
    client.reset()

    assert begins_at(client.state(2)) == [0.7]
    assert told(client, 2)[1]["parameters"]["initial_velocity"] == [0.2]
    assert list(client.get_parameters(NODE, ["initial_position"])[0]) == [0.7]
    client.reset()  # nothing new has come
    assert begins_at(client.state(3)) == [0.7]
    assert len(client.configuration) == 2
    # what cannot be is not taken, and logged
    references.publish(joint_state(0, ["hinge"], [0.7], [1e9]))
    assert references.wait_for_all_acked()
    client.reset()
    assert begins_at(client.state(4)) == [0.7]


def test_where_a_character_begins_may_come_from_its_controller_later(
    processes: Processes, client: SimulatorClient
) -> None:
    references = client.speak(INITIAL_STATE)
    processes.simulator(initial_position=[0.1])
    client.first_state()
    assert client.set_parameter(NODE, "initial_state", "reference") == (True, "")
    client.reset()  # none has come: the simulator does not wait
    assert begins_at(client.state(2)) == [0.1]

    references.publish(joint_state(0, ["hinge"], [0.6], [0.0]))
    client.spin_until(references.get_subscription_count, "a subscription")
    assert references.wait_for_all_acked()
    client.reset()

    assert begins_at(client.state(3)) == [0.6]
    assert client.set_parameter(NODE, "initial_state", "given") == (True, "")
    assert client.set_parameter(NODE, "initial_position", [0.2]) == (True, "")
    client.reset()
    assert begins_at(client.state(4)) == [0.2]


def test_of_several_characters_one_begins_elsewhere(processes: Processes, join: Join) -> None:
    left, right = join("left_client", "left"), join("right_client", "right")
    processes.simulator(characters=["left", "right"], character="pendulum")
    left.first_state()
    assert left.set_parameter(NODE, "right.initial_position", [0.25]) == (True, "")
    assert left.set_parameter(NODE, "gravity", 2.0) == (True, "")

    left.reset()

    assert begins_at(left.state(2)) == [0.5]
    assert begins_at(right.state(2)) == [0.25]
    for client in (left, right):
        client.spin_until(partial(has_gravity, client, 2.0), "the last configuration")
