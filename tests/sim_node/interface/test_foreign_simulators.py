"""A node belongs to one simulator: what others say on the same topics changes nothing."""

import json
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from rclpy.context import Context
from rclpy.publisher import Publisher
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from msgs_config.messages import topics
from msgs_config.messages.cdr import split_stamp
from msgs_config.messages.state import StampedState
from msgs_config.messages.wrenches import WrenchArrays, encode_wrenches
from sim_node.physics.probe import measure_probe
from tests.controller_node.test_model_check import REFUSED_SIMULATORS, description
from tests.controller_node.test_node import CLOCK, expected_answer
from tests.support.physics import character
from tests.support.ros import (
    ControllerClient,
    Processes,
    ReceivedMessages,
    SimulatorClient,
    joint_state,
    stamp_ns,
    tick_of,
    wait_until,
    wrench_message,
)

OWN, OTHER = "/sim_node#00000000000a", "/other/sim_node#00000000000b"
SINE = {"reference": "sine", "signal__dofs": ["hinge"]}
MOVES = {name.replace("__", "."): value for name, value in SINE.items()}
PENDULUM = character("pendulum").layout


def state(tick: int, session: str = OWN, *, first: bool = False) -> JointState:
    """A state of the pendulum; another one in each session."""
    position = 0.3 if session == OWN else -0.4
    effort = [] if first else [0.0]
    message = joint_state(CLOCK.stamp_ns(tick), PENDULUM.dof_names, [position], [0.1], effort)
    message.header.frame_id = session
    return message


def expected(message: JointState, first_tick: int) -> list[float]:
    """What answers a state of an episode that began with a tick."""
    position, velocity = np.array(message.position), np.array(message.velocity)
    found = StampedState(stamp_ns(message), position, velocity, None)
    effort, _ = expected_answer("pendulum", found, CLOCK.stamp_ns(first_tick), **MOVES)
    return list(effort.tolist())


def episode(stamp: int, frame_id: str) -> Header:
    """A message on `episode` with a stamp in ns."""
    header = Header(frame_id=frame_id)
    header.stamp.sec, header.stamp.nanosec = split_stamp(stamp)
    return header


STRAY_EPISODES = {
    "past": episode(CLOCK.stamp_ns(2), f"1 {OTHER}"),
    "future": episode(CLOCK.stamp_ns(100_000), f"7 {OTHER}"),
    "negative": episode(-5_000_000_000, f"1 {OTHER}"),
    "no tick": episode(1_234_567, f"1 {OTHER}"),
    "past, of nobody": episode(CLOCK.stamp_ns(2), "2"),
    "future, of nobody": episode(CLOCK.stamp_ns(100_000), ""),
    "negative, its own": episode(-5_000_000_000, f"1 {OWN}"),
    "past, its own": episode(CLOCK.stamp_ns(2), f"1 {OWN}"),
    "future, its own": episode(CLOCK.stamp_ns(100_000), f"2 {OWN}"),
}


@pytest.fixture
def other(context: Context) -> Iterator[ControllerClient]:
    """A second node that stands where a simulator stands."""
    client = ControllerClient(context)
    yield client
    client.close()


def reported(client: ControllerClient, inbox: ReceivedMessages, **least: int) -> None:
    """Wait until the controller has counted so many."""

    def found() -> bool:
        values = {
            item.key: item.value
            for message in inbox.messages
            for status in message.status
            if status.name.endswith(topics.CONTROLLER_NODE)
            for item in status.values
        }
        return bool(values) and all(int(values[name]) >= count for name, count in least.items())

    client.spin_until(found, f"a report of {least}")


# The controller: episodes


@pytest.mark.slow
def test_no_stray_episode_moves_the_reference_or_stops_the_answers(
    processes: Processes, simulator: ControllerClient
) -> None:
    reports = simulator.listen(topics.DIAGNOSTICS)
    node = processes.controller("pendulum", **SINE)
    first = state(5, first=True)
    assert list(simulator.ask(first).effort) == expected(first, 5)

    for tick, (name, stray) in enumerate(STRAY_EPISODES.items(), start=6):
        simulator.episodes.publish(stray)
        reported(simulator, reports, rejected_episodes=min(tick - 5, 7))

        reply = simulator.ask(state(tick))
        assert list(reply.effort) == expected(state(tick), 5), name

    assert node.exit_code is None
    lines = [line for line in node.stderr.splitlines() if "'episode'" in line]
    assert sum(OWN in line and OTHER in line for line in lines) == 1


def test_a_late_joiner_takes_the_episode_of_the_simulator_whose_state_it_answers(
    processes: Processes, simulator: ControllerClient, other: ControllerClient
) -> None:
    simulator.episodes.publish(episode(CLOCK.stamp_ns(2400), f"2 {OWN}"))
    other.episodes.publish(episode(CLOCK.stamp_ns(2450), f"9 {OTHER}"))
    processes.controller("pendulum", **SINE)

    reply = simulator.ask(state(2500))

    assert list(reply.effort) == expected(state(2500), 2400)
    assert reply.header.frame_id == OWN


def test_a_late_joiner_says_what_it_waits_for_while_no_episode_fits(
    processes: Processes, simulator: ControllerClient
) -> None:
    node = processes.controller("pendulum", **SINE)
    late = state(2500)

    for stray in (STRAY_EPISODES["future, its own"], STRAY_EPISODES["past"]):
        simulator.episodes.publish(stray)
    simulator.send(late, lambda: "waiting for a message on 'episode'" in node.stderr)
    assert not simulator.torques.messages

    simulator.episodes.publish(episode(CLOCK.stamp_ns(2400), f"2 {OWN}"))
    assert list(simulator.ask(late).effort) == expected(late, 2400)


# The controller: states, configurations, contacts


def test_two_simulators_that_alternate_are_not_mixed_and_both_are_named_once(
    processes: Processes, simulator: ControllerClient, other: ControllerClient
) -> None:
    reports = simulator.listen(topics.DIAGNOSTICS)
    node = processes.controller("pendulum", **SINE)
    simulator.ask(state(1, first=True))
    other.spin_until(other.states.get_subscription_count, "a controller that hears the other one")

    for tick in range(2, 60):
        other.states.publish(state(3 * tick, OTHER, first=tick % 7 == 0))
        reply = simulator.ask(state(tick))
        assert list(reply.effort) == expected(state(tick), 1)

    reported(simulator, reports, foreign_states=58)
    assert {torques.header.frame_id for torques in simulator.torques.messages} == {OWN}
    simulator.spin_until(lambda: len(simulator.references) > 50, "references")
    assert {each.header.frame_id for each in simulator.references.messages} == {OWN}
    told = [line for line in node.stderr.splitlines() if OTHER in line]
    assert len(told) == 1
    assert OWN in told[0] and "ROS_DOMAIN_ID" in told[0]
    assert "'rate'" not in node.stderr


def in_session(text: str, session: str) -> String:
    """A simulator's configuration as said in a session."""
    return String(data=json.dumps({**json.loads(text), "session": session}))


@pytest.mark.parametrize("case", REFUSED_SIMULATORS)
def test_a_configuration_of_another_simulator_does_not_end_a_running_controller(
    processes: Processes, simulator: ControllerClient, case: str
) -> None:
    measure, name, given = REFUSED_SIMULATORS[case]
    reports = simulator.listen(topics.DIAGNOSTICS)
    node = processes.controller("pendulum", **SINE)
    simulator.ask(state(1, first=True))
    configurations = simulator.speak(topics.CONFIGURATION.of(topics.SIM_NODE))
    simulator.spin_until(configurations.get_subscription_count, "a controller that listens")
    text = description(name, measure(), **given)

    configurations.publish(in_session(text, OTHER))

    # it is noticed, and after the bound simulator's own one that is answered no more
    reported(simulator, reports, foreign_configurations=1)
    assert list(simulator.ask(state(2)).effort) == expected(state(2), 1)
    configurations.publish(in_session(text, OWN))
    wait_until(lambda: "state ignored: the simulator's" in node.stderr, "the line")
    assert "waiting for a simulator that fits" in node.stderr.splitlines()[-1]
    probe = measure_probe(character("pendulum"), 9.81)
    configurations.publish(in_session(description("pendulum", probe), OWN))
    fitting = state(9, first=True)
    assert list(simulator.ask(fitting).effort) == expected(fitting, 9)
    assert node.exit_code is None


@pytest.mark.parametrize("first", ["lift", "pendulum"])
def test_of_two_simulators_a_controller_takes_up_the_one_that_fits_whichever_comes_first(
    processes: Processes, client: SimulatorClient, first: str
) -> None:
    second = "lift" if first == "pendulum" else "pendulum"
    processes.simulator(first)
    controller = processes.controller("pendulum")
    if first == "lift":
        wait_until(lambda: "waiting for a simulator that fits" in controller.stderr, "the line")
    processes.simulator(second)

    def moves() -> bool:
        found = [each for each in client.states.messages if list(each.name) == ["hinge"]]
        return bool(found) and tick_of(found[-1]) > 20

    client.spin_until(moves, "answers to the pendulum's simulator")
    assert controller.exit_code is None
    assert "error" not in controller.stderr


def test_a_simulator_that_is_not_the_controllers_is_passed_over_where_there_is_another(
    processes: Processes, simulator: ControllerClient, other: ControllerClient
) -> None:
    measure, name, given = REFUSED_SIMULATORS["another rate"]
    configurations = other.speak(topics.CONFIGURATION.of(topics.SIM_NODE))
    configurations.publish(in_session(description(name, measure(), **given), OTHER))

    node = processes.controller("pendulum", **SINE)
    for client in (simulator, other):
        client.spin_until(client.states.get_subscription_count, "a controller")
    simulator.send(
        state(10, OTHER, first=True), lambda: "state ignored: the simulator's" in node.stderr
    )

    assert list(simulator.ask(state(1, first=True)).effort) == expected(state(1), 1)
    assert node.exit_code is None


def test_a_configuration_that_comes_after_the_first_state_does_not_end_the_controller(
    processes: Processes, simulator: ControllerClient, other: ControllerClient
) -> None:
    measure, name, given = REFUSED_SIMULATORS["another rate"]
    configurations = other.speak(topics.CONFIGURATION.of(topics.SIM_NODE))
    node = processes.controller("pendulum", **SINE)
    other.spin_until(configurations.get_subscription_count, "a controller that listens")
    simulator.spin_until(simulator.states.get_subscription_count, "a controller")

    other.ask(state(2, OTHER, first=True))
    configurations.publish(in_session(description(name, measure(), **given), OTHER))
    other.send(
        state(10, OTHER, first=True), lambda: "state ignored: the simulator's" in node.stderr
    )

    assert list(simulator.ask(state(1, first=True)).effort) == expected(state(1), 1)
    assert node.exit_code is None


def test_contacts_of_another_simulator_are_no_hit(
    processes: Processes, simulator: ControllerClient
) -> None:
    humanoid, modes = character("humanoid"), simulator.listen(topics.MODE.of("controller_node"))
    contacts = simulator.speak(topics.CONTACTS)
    processes.controller("humanoid", behaviour="reactive")

    def at(tick: int) -> JointState:
        size = humanoid.layout.size
        effort = [] if tick == 1 else [0.0] * size
        position = list(humanoid.rest_position)
        names = humanoid.layout.dof_names
        message = joint_state(CLOCK.stamp_ns(tick), names, position, [0.0] * size, effort)
        message.header.frame_id = OWN
        return message

    def touch(tick: int, session: str, force: float) -> None:
        row = [force, 0.0, 0.0, 0.0, 0.0, 0.0]
        arrays = WrenchArrays.of_rows(CLOCK.stamp_ns(tick), ["chest"], [row], [], session)
        contacts.publish(encode_wrenches(arrays))

    def answered(tick: int) -> bool:
        stamps = {stamp_ns(torques) for torques in simulator.torques.messages}
        return CLOCK.stamp_ns(tick) in stamps

    for tick in range(1, 8):

        def send(tick: int = tick) -> None:
            for session in (OTHER, "world", ""):
                touch(tick, session, 5000.0)
            touch(tick, OWN, 0.0)
            simulator.states.publish(at(tick))

        simulator.spin_sending(send, lambda tick=tick: answered(tick), "an answer")

    assert [json.loads(message.data)["mode"] for message in modes.messages] == ["TRACK"]


# The controller: which one it belongs to


def test_a_simulator_that_was_started_again_is_taken_up_from_its_first_state_on(
    processes: Processes, simulator: ControllerClient
) -> None:
    processes.controller("pendulum", **SINE)
    for tick in range(1, 20):
        simulator.ask(state(tick, first=tick == 1))
    simulator.torques.messages.clear()
    began = time.monotonic()

    reply = simulator.ask(state(1, OTHER, first=True))

    assert list(reply.effort) == expected(state(1, OTHER), 1)
    assert reply.header.frame_id == OTHER
    assert time.monotonic() - began > 0.9  # s: it might just have been slow
    later = simulator.ask(state(2, OTHER))
    assert list(later.effort) == expected(state(2, OTHER), 1)


def test_a_session_that_is_given_is_the_only_one(
    processes: Processes, simulator: ControllerClient
) -> None:
    node = processes.controller("pendulum", session=OTHER, **SINE)
    measure, name, given = REFUSED_SIMULATORS["another rate"]
    configurations = simulator.speak(topics.CONFIGURATION.of(topics.SIM_NODE))
    configurations.publish(in_session(description(name, measure(), **given), OWN))

    simulator.send(state(1, first=True), lambda: OWN in node.stderr)
    reply = simulator.ask(state(3, OTHER, first=True))

    assert list(reply.effort) == expected(state(3, OTHER), 3)
    assert {stamp_ns(torques) for torques in simulator.torques.messages} == {CLOCK.stamp_ns(3)}


def test_in_a_session_that_is_given_a_state_that_comes_again_changes_nothing(
    processes: Processes, simulator: ControllerClient
) -> None:
    gains: dict[str, object] = {"law": "pid", "gains__hinge__i": 1000.0}
    processes.controller("pendulum", session=OTHER, **gains, **SINE)
    simulator.ask(state(1, OTHER, first=True))

    def answers() -> list[bytes]:
        pairs = zip(simulator.torques.messages, simulator.torques.raw, strict=True)
        return [raw for reply, raw in pairs if stamp_ns(reply) == CLOCK.stamp_ns(2)]

    simulator.send(state(2, OTHER), lambda: len(answers()) >= 4)

    assert len(set(answers())) == 1
    assert {reply.header.frame_id for reply in simulator.torques.messages} == {OTHER}


def test_a_session_that_is_none_is_refused_in_one_line(processes: Processes) -> None:
    nodes = [
        processes.controller("pendulum", session="mine"),
        processes.simulator(session="mine"),
        processes.node(topics.RECORDER_NODE, session="mine"),
    ]

    for node in nodes:
        assert node.wait() == 1
        (line,) = node.stderr.splitlines()
        assert line.startswith("error: parameter 'session' is 'mine'; it must be ")


# The simulator


def publish_in(publisher: Publisher, message: Any, session: str) -> None:
    message.header.frame_id = session
    publisher.publish(message)


def test_commands_and_pushes_for_another_simulator_are_rejected_counted_and_named(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator(initial_position=[0.0], gravity=0.0)
    first = client.first_state()
    session = first.header.frame_id
    torque = joint_state(stamp_ns(first), ["hinge"], effort=[9.0])
    push = wrench_message(0, [("rod", [50.0, 0.0, 50.0, 0.0, 50.0, 0.0])])

    for _ in range(3):
        publish_in(client.torques, torque, OTHER)
        publish_in(client.wrenches, push, OTHER)
    client.reported(foreign_commands=3, session=session)  # before any of them can be too late
    for tick, frame_id in enumerate((session, "", "base_link"), start=1):
        right = joint_state(CLOCK.stamp_ns(tick), ["hinge"], effort=[0.5])
        publish_in(client.torques, right, frame_id)
        assert list(client.state(tick + 1).effort) == [0.5]

    client.reported(foreign_commands=3, foreign_pushes=3, rejected=0, rejected_pushes=0)
    client.reported(accepted=3, conflict=0)
    (line,) = [line for line in simulator.stderr.splitlines() if OTHER in line]
    assert session in line


@pytest.mark.slow
def test_two_simulators_on_the_same_topics_name_each_other(
    processes: Processes, client: SimulatorClient
) -> None:
    module = ["-m", "sim_node.main", "--ros-args", "-p", "character:=pendulum"]
    one = processes.python(*module)
    rival = processes.python(*module, "-r", "__node:=rival")

    for process, own, its in ((one, "/sim_node", "/rival"), (rival, "/rival", "/sim_node")):
        client.spin_until(lambda process=process: "as well" in process.stderr, "a warning")
        (line,) = [line for line in process.stderr.splitlines() if "as well" in line]
        assert f"{own} (session {own}#" in line
        assert f"by {its} as well" in line
        assert "ROS_DOMAIN_ID" in line


def test_a_simulator_that_is_paused_beside_another_one_shows_that_it_is_there(
    processes: Processes, client: SimulatorClient, other: ControllerClient
) -> None:
    processes.simulator(republish_period=0.1)
    session = client.first_state().header.frame_id
    client.pause(True)
    wait_until(lambda: other.states.topic_name, "a second publisher of states")
    before = len(client.states)

    client.spin_until(lambda: len(client.episodes) > 5, "signs of life")

    assert {message.frame_id for message in client.episodes.messages} == {f"1 {session}"}
    assert len(client.states) <= before + 1
