"""Where a character begins: the simulator asks, its controller says where its reference begins."""

import json
import signal

import numpy as np
import pytest
from rclpy.context import Context
from sensor_msgs.msg import JointState

from controller_node import parameters as for_controller
from controller_node.references.factory import make_motion
from msgs_config.clips.reading import available_clips
from msgs_config.errors import ConfigurationError, MessageError
from msgs_config.messages import topics
from msgs_config.messages.state import StampedState
from sim_node.initial_state import check_state
from sim_node.parameters import load_parameters
from sim_node.physics.simulation import Simulation
from tests.sim_node.conftest import Join
from tests.support.physics import (
    EVERY_CHARACTER,
    character,
    character_id,
    joint_simulation,
    random_state,
)
from tests.support.ros import (
    Client,
    Process,
    Processes,
    SimulatorClient,
    joint_state,
    stamp_ns,
    tick_of,
)

HUMANOID = character("humanoid").layout
INITIAL_STATE = topics.INITIAL_STATE.of(topics.CONTROLLER_NODE)
SPEED_LIMIT = 500.0
THIRD = 1.0 / 3.0  # of 17 digits
ANSWERED = {"hinge": 0.25}


# What is taken


def reference_state(name: str, **given: object) -> StampedState:
    whole = character(name)
    values = for_controller.resolve_for(whole, {"character": name, **given})
    return make_motion(whole, values).first_state()


@pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
def test_every_character_can_begin_in_its_rest_pose(name: str) -> None:
    check_state(character(name), reference_state(name), SPEED_LIMIT)


@pytest.mark.parametrize("clip", available_clips(character("humanoid")))
def test_a_character_can_begin_where_a_clip_begins(clip: str) -> None:
    state = reference_state("humanoid", reference="clip", clip=clip)

    check_state(character("humanoid"), state, SPEED_LIMIT)
    assert np.any(state.velocity)


def wrong_state(dof: str, position: float = 0.0, velocity: float = 0.0) -> StampedState:
    there = reference_state("humanoid")
    entry = HUMANOID.dof_names.index(dof)
    positions, velocities = there.position.copy(), there.velocity.copy()
    positions[entry], velocities[entry] = position, velocity
    return StampedState(0, positions, velocities, None)


@pytest.mark.parametrize(
    ("state", "expected"),
    [
        (wrong_state("chest_y", position=np.nan), ["'chest_y'", "nan", "finite"]),
        (wrong_state("neck_x", velocity=-np.inf), ["'neck_x'", "-inf", "finite"]),
        (wrong_state("left_knee", position=0.5), ["'left_knee'", "0.5", "-3.14 to 0"]),
        (wrong_state("root_x", velocity=-501.0), ["'root_x'", "-501", "speed_limit", "500"]),
    ],
    ids=["position", "velocity", "limits", "speed"],
)
def test_a_state_that_cannot_be_is_rejected_with_its_joint(
    state: StampedState, expected: list[str]
) -> None:
    with pytest.raises(MessageError) as caught:
        check_state(character("humanoid"), state, SPEED_LIMIT)

    assert all(part in str(caught.value) for part in expected)


# Parameters


@pytest.mark.parametrize("name", ["initial_position", "initial_velocity"])
def test_a_state_is_either_given_or_asked_for(name: str) -> None:
    given: dict[str, object] = {"character": "pendulum", name: [0.1]}

    with pytest.raises(ConfigurationError, match=f"'{name}' is given, and 'initial_state' is"):
        load_parameters(given | {"initial_state": "reference"})
    load_parameters(given | {"initial_state": "given"})


def test_one_character_may_ask_while_another_is_given_its_state() -> None:
    given = {
        "characters": ["one", "two"],
        "character": "pendulum",
        "one.initial_state": "reference",
        "two.initial_position": [0.2],
    }

    one, two = load_parameters(given).characters

    assert one.values["initial_state"] == "reference"
    assert two.values["initial_state"] == "given"
    with pytest.raises(ConfigurationError, match=r"character 'one': .*'initial_position'"):
        load_parameters(given | {"one.initial_position": [0.2]})


def test_values_of_one_character_leave_those_of_others() -> None:
    cast = load_parameters({"characters": ["one", "two"], "character": "pendulum"})

    changed = cast.with_values({"two": {"initial_position": [0.75]}})

    assert [part.values["initial_position"] for part in changed.characters] == [[0.5], [0.75]]
    assert changed.values["one.initial_position"] == [0.5]
    assert changed.values["two.initial_position"] == [0.75]
    assert changed.values.keys() == cast.values.keys()
    assert cast.characters[1].values["initial_position"] == [0.5]


# The simulation


def bits_after(run: Simulation, ticks: int = 60) -> list[bytes]:
    """Every bit of the states of all actors, from now on."""
    states = []
    for _ in range(ticks):
        states += [a.state.position.tobytes() + a.state.velocity.tobytes() for a in run.characters]
        run.step([np.zeros(simulated.layout.size) for simulated in run.characters])
    return states


def test_a_simulation_begins_in_a_state_as_if_it_were_given_to_the_bit() -> None:
    position, velocity = random_state(character("humanoid"), np.random.default_rng(3))
    two = {"characters": ["one", "two"], "two.character": "pendulum", "one.character": "humanoid"}
    given = {
        "one.initial_position": position.tolist(),
        "one.initial_velocity": velocity.tolist(),
    }
    with joint_simulation(two | given) as run:
        expected = bits_after(run)

    with joint_simulation(two) as run:
        run.begin_in({"one": StampedState(0, position, velocity, None)})
        begun, first = run.tick, bits_after(run)
        run.reset()
        again = bits_after(run)

    assert begun == 1
    assert first == expected
    assert again == expected


# What controllers say


def test_a_controller_says_where_its_reference_begins_also_to_who_comes_late(
    processes: Processes, context: Context
) -> None:
    processes.controller("humanoid", reference="clip", clip="walk", placement=[1.0, 2.0, 0.0, 0.5])
    placement = [1.0, 2.0, 0.0, 0.5]
    states = []
    for name in ("early", "late"):
        client = Client(context, name)
        inbox = client.listen(INITIAL_STATE)
        client.spin_until(lambda inbox=inbox: inbox.messages, "an initial state")
        states.append(inbox.last)
        client.close()

    first = reference_state("humanoid", reference="clip", clip="walk")
    assert states[0] == states[1]
    assert tuple(states[0].name) == HUMANOID.dof_names
    assert stamp_ns(states[0]) == 0
    assert list(states[0].velocity)[6:] == first.velocity.tolist()[6:]
    assert list(states[0].position)[6:] == first.position.tolist()[6:]
    assert np.allclose(states[0].position[:2], np.array(placement[:2]), atol=0.1)


# The simulator's node


def pendulum_state(position: float = THIRD, velocity: float = -THIRD) -> JointState:
    return joint_state(0, ["hinge"], [position], [velocity])


def asking(processes: Processes, name: str = "pendulum", **given: object) -> Process:
    return processes.simulator(name, initial_state="reference", **given)


def wait_for_line(client: Client, process: Process, part: str) -> str:
    """The first line with a part in it that a process has said."""

    def found() -> str:
        return next((line for line in process.stderr.splitlines() if part in line), "")

    return str(client.spin_until(found, f"a line with {part!r}"))


def begins_in(state: JointState) -> tuple[list[float], list[float]]:
    return list(state.position), list(state.velocity)


def test_the_simulator_begins_where_it_is_told_and_tells_all_of_it(
    processes: Processes, client: SimulatorClient, join: Join
) -> None:
    simulator = asking(processes)
    line = wait_for_line(client, simulator, "waiting")
    assert "'controller_node/initial_state' has no publisher" in line
    assert not client.states.messages and not client.configuration.messages

    client.speak(INITIAL_STATE).publish(pendulum_state())

    assert begins_in(client.first_state()) == ([THIRD], [-THIRD])
    names = ["initial_state", "initial_position", "initial_velocity"]
    expected = ["reference", [THIRD], [-THIRD]]
    values = client.get_parameters(topics.SIM_NODE, names)
    assert [values[0], *map(list, values[1:])] == expected
    late = join("late")
    late.spin_until(lambda: late.configuration.messages, "the configuration")
    parameters = json.loads(late.configuration.last.data)["parameters"]
    assert [parameters[name] for name in names] == expected
    assert simulator.stderr.count("waiting for the initial state") == 1


def test_entries_are_matched_by_name(processes: Processes, client: SimulatorClient) -> None:
    position, velocity = random_state(character("humanoid"), np.random.default_rng(5))
    order = [*range(6, HUMANOID.size), *range(6)]
    names = [HUMANOID.dof_names[entry] for entry in order]
    client.speak(INITIAL_STATE).publish(
        joint_state(0, names, position[order].tolist(), velocity[order].tolist())
    )

    asking(processes, "humanoid")

    content = client.spin_until(lambda: client.configuration.messages, "configuration")[0].data
    parameters = json.loads(content)["parameters"]
    assert parameters["initial_position"] == position.tolist()
    assert parameters["initial_velocity"] == velocity.tolist()


def test_a_state_that_is_there_already_is_taken_without_a_word_and_again_after_a_reset(
    processes: Processes, client: SimulatorClient
) -> None:
    client.speak(INITIAL_STATE).publish(pendulum_state())
    simulator = asking(processes)
    first = client.first_state()
    assert begins_in(first) == ([THIRD], [-THIRD])
    assert simulator.stderr == ""
    state = client.advance(first, ANSWERED)

    client.reset()

    again = client.state(tick_of(state) + 1)
    assert begins_in(again) == ([THIRD], [-THIRD]) != begins_in(state)
    assert not len(again.effort)


WRONG: list[tuple[JointState | bytes, str]] = [  # and a part of what is said of it
    (bytes(range(40)), "40 bytes that are no JointState"),
    (joint_state(0, ["height"], [0.0], [0.0]), "'height'; there are: hinge"),
    (joint_state(0, [], [], []), "'hinge' is missing"),
    (joint_state(0, ["hinge"], [0.0], []), "1 names but arrays of [0, 1]"),
    (pendulum_state(np.nan), "'hinge' is at nan"),
    (pendulum_state(0.0, 501.0), "'hinge' has the velocity 501"),
]


def test_what_cannot_be_is_rejected_each_in_a_line_and_the_next_one_taken(
    processes: Processes, client: SimulatorClient
) -> None:
    publisher, simulator = client.speak(INITIAL_STATE), asking(processes)
    for message, expected in WRONG:
        publisher.publish(message)
        line = wait_for_line(client, simulator, expected)
        assert "initial state rejected: " in line
    assert not client.states.messages

    publisher.publish(pendulum_state())

    assert begins_in(client.first_state()) == ([THIRD], [-THIRD])
    lines = [line for line in simulator.stderr.splitlines() if "rejected" in line]
    assert len(lines) == len(WRONG)


@pytest.mark.parametrize(
    ("message", "timeout", "expected"),
    [
        (None, 0.5, "'controller_node/initial_state' has no publisher"),
        (pendulum_state(np.inf), 4.0, "'hinge' is at inf"),  # time enough to be heard
    ],
    ids=["nothing", "something wrong"],
)
def test_without_a_state_in_time_it_ends_with_what_is_missing_and_the_remedy(
    processes: Processes,
    client: SimulatorClient,
    message: JointState | None,
    timeout: float,
    expected: str,
) -> None:
    publisher = client.speak(topics.JOINT_STATES if message is None else INITIAL_STATE)
    if message is not None:
        publisher.publish(message)

    simulator = asking(processes, initial_state_timeout=timeout)

    assert simulator.wait() == 1
    *_, line = simulator.stderr.splitlines()
    assert line.startswith(f"error: no initial state within {timeout:g} s; ")
    assert expected in line
    assert "start controller_node" in line and "'initial_state' to given" in line
    assert not client.states.messages and not client.configuration.messages


def test_a_signal_ends_the_wait(processes: Processes, client: SimulatorClient) -> None:
    simulator = asking(processes)
    wait_for_line(client, simulator, "waiting")

    simulator.send(signal.SIGINT)

    assert simulator.wait() == 0
    assert not client.states.messages and not client.episodes.messages


def test_services_and_parameters_answer_while_it_waits(
    processes: Processes, client: SimulatorClient
) -> None:
    asking(processes)

    assert client.pause(True).message == "paused"
    assert client.set_parameter(topics.SIM_NODE, "step_count", 2) == (True, "")
    taken, reason = client.set_parameter(topics.SIM_NODE, "wrench_duration", -1.0)
    assert not taken and reason
    names = client.list_parameters(topics.SIM_NODE)
    assert "initial_state" in names and "initial_position" not in names
    client.reset()
    client.speak(INITIAL_STATE).publish(pendulum_state())

    second = client.state(2)  # the reset has consumed a tick
    assert client.pause(False).message == "running"
    client.advance(second, ANSWERED)
    assert begins_in(second) == ([THIRD], [-THIRD])


def test_while_several_controllers_say_a_state_none_counts(
    processes: Processes, client: SimulatorClient, context: Context
) -> None:
    own, other = client.speak(INITIAL_STATE), Client(context, "other")
    own.publish(pendulum_state(0.1))
    other.speak(INITIAL_STATE).publish(pendulum_state(0.2))
    simulator = asking(processes)
    line = wait_for_line(client, simulator, "waiting")
    assert "several" in line and "/test_client" in line and "/other" in line
    assert not client.states.messages

    other.close()

    assert begins_in(client.first_state()) == ([0.1], [-THIRD])


def test_each_of_several_characters_is_told_by_its_own_controller(
    processes: Processes, client: SimulatorClient, join: Join
) -> None:
    given: dict[str, object] = {"characters": ["one", "two", "three"], "character": "pendulum"}
    simulator = processes.simulator(
        **given, one__initial_state="reference", two__initial_state="reference"
    )
    line = wait_for_line(client, simulator, "waiting")
    assert "'one/controller_node/initial_state'" in line
    assert "'two/controller_node/initial_state'" in line
    assert "three" not in line
    first = [join(f"at_{name}", name) for name in ("one", "two", "three")]
    client.speak(INITIAL_STATE.under("two")).publish(pendulum_state(0.2))
    client.speak(INITIAL_STATE.under("one")).publish(pendulum_state(0.1))

    states = [begins_in(each.first_state()) for each in first]

    assert states == [([0.1], [-THIRD]), ([0.2], [-THIRD]), ([0.5], [0.0])]
