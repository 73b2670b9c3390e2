"""The simulator as a process of its own, seen from the topics."""

import itertools
import json
import re
import signal
from typing import Any

import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.messages import topics
from sim_node.parameters import PARAMETERS, character_parameters
from tests.sim_node.conftest import Join
from tests.support import golden
from tests.support.ros import Processes, SimulatorClient, joint_state, stamp_ns, tick_of, wait_until

TICK_NS = 10**9 // 240
SOON = 0.05  # s, a republish period for tests that wait for repeated states
NO_TIME = 0.2  # s, a lockstep timeout
PROMPTLY = 2.0  # s that a node may take to end after a signal


def efforts_of(state: JointState) -> dict[str, float]:
    return dict(zip(state.name, state.effort, strict=True))


def all_but_left_elbow(state: JointState, effort: float = 0.0) -> dict[str, float]:
    """A command of every motor of the humanoid but one."""
    motors = [name for name in state.name if not name.startswith("root_")]
    return {name: effort for name in motors if name != "left_elbow"}


def wait_for_repeats(client: SimulatorClient, count: int = 2) -> None:
    """Wait until the last state has come again: time enough to go on, for who would go on."""
    enough = len(client.states) + count
    client.spin_until(lambda: len(client.states) >= enough, "repeated states")


# What it says first


def test_episode_clock_and_states_begin_at_tick_one_and_the_first_state_has_no_effort(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator("humanoid", wait_for_subscribers=1)

    state = client.first_state()

    assert stamp_ns(state) == TICK_NS
    assert tuple(state.name) == load_character("humanoid").layout.dof_names
    assert len(state.position) == len(state.velocity) == len(state.name)
    assert len(state.effort) == 0
    client.spin_until(lambda: client.episodes.messages and client.clock.messages, "both")
    (episode,) = client.episodes.messages
    assert (stamp_ns(episode), episode.frame_id) == (TICK_NS, f"1 {state.header.frame_id}")
    assert client.clock.last.clock.nanosec == TICK_NS


def test_the_configuration_holds_all_that_a_run_depends_on(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator("lift", initial_position=[0.25], gravity=1.62)

    client.spin_until(lambda: client.configuration.messages, "configuration")

    content = json.loads(client.configuration.last.data, parse_constant=pytest.fail)
    lift = load_character("lift")
    assert content["character"] == "lift"
    assert content["character_file"] == lift.file.read_text()
    assert content["urdf"] == lift.loading.urdf_text
    assert content["joints"] == [{"name": "height", "type": "prismatic"}]
    assert content["mass"] == lift.mass
    names = {parameter.name for parameter in PARAMETERS + character_parameters(lift)}
    assert set(content["parameters"]) == names - {"session"}  # which is of no influence
    assert content["session"] == client.state(1).header.frame_id
    assert re.fullmatch("/sim_node#[0-9a-f]{12}", content["session"])
    assert content["parameters"]["initial_position"] == [0.25]
    assert content["parameters"]["initial_velocity"] == [0.0]
    assert content["parameters"]["gravity"] == 1.62
    for package in ("python", *golden.engines(), "numpy", "actuated_characters"):
        assert re.match(r"\d+\.\d+", content["versions"][package])


def test_who_comes_late_hears_configuration_and_episode_too(
    processes: Processes, client: SimulatorClient, join: Join
) -> None:
    processes.simulator(republish_period=SOON)
    client.advance(client.first_state(), {})
    client.spin_until(lambda: client.configuration.messages, "configuration")

    late = join("late")
    late.spin_until(lambda: late.configuration.messages and late.episodes.messages, "both")
    assert late.configuration.raw == client.configuration.raw
    assert stamp_ns(late.episodes.last) == TICK_NS


# Lockstep


def test_the_next_state_comes_only_when_every_motor_has_its_command(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator("humanoid", republish_period=SOON)
    state = client.first_state()
    wait_for_repeats(client)
    assert len(set(client.states.raw)) == 1

    for tick in range(1, 4):
        client.command(stamp_ns(state), all_but_left_elbow(state, 0.5))
        wait_for_repeats(client)
        assert tick_of(client.states.last) == tick
        client.command(stamp_ns(state), {"left_elbow": 0.25})
        state = client.state(tick + 1)

        applied = {name: effort for name, effort in efforts_of(state).items() if effort}
        assert applied == all_but_left_elbow(state, 0.5) | {"left_elbow": 0.25}


def test_a_controller_that_comes_late_is_not_too_late(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator(republish_period=SOON)
    client.first_state()
    wait_for_repeats(client, 10)

    processes.controller()

    assert tick_of(client.state(100)) == 100


# Commands that it does not take


def test_an_exact_repeat_is_a_duplicate_and_changes_nothing(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator("humanoid", max_ticks=1)
    state = client.first_state()

    client.command(stamp_ns(state), {"left_elbow": 3.0})
    client.command(stamp_ns(state), {"left_elbow": 3.0})
    client.command(stamp_ns(state), all_but_left_elbow(state))

    assert efforts_of(client.state(2))["left_elbow"] == 3.0
    client.reported(tick=2, accepted=2, duplicate=1, conflict=0)


def test_old_and_future_stamps_are_counted_and_dropped(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator(max_ticks=2)
    state = client.advance(client.first_state(), {"hinge": 1.0})

    client.command(TICK_NS, {"hinge": 1.0})
    client.command(stamp_ns(state) + TICK_NS, {"hinge": 8.0})
    client.command(0, {"hinge": 9.0})
    state = client.advance(state, {"hinge": 2.0})

    assert list(state.effort) == [2.0]
    client.reported(tick=3, accepted=2, stale=2, future=1)


def test_two_different_commands_pause_it_and_name_the_joint_and_the_senders(
    processes: Processes, client: SimulatorClient, join: Join
) -> None:
    processes.simulator("humanoid")
    intruder = join("intruder")
    state = client.first_state()
    intruder.first_state()
    conflicts = itertools.count(1)

    def provoke() -> str:
        for sender, effort in ((client, 1.0), (intruder, 2.0)):
            sender.command(stamp_ns(state), {"left_elbow": effort})
        status = client.reported(paused=True, conflict=next(conflicts), tick=1)
        assert status.level == status.ERROR
        assert "'left_elbow'" in status.message
        assert client.pause(False).success
        return str(status.message)

    # a node hears of publishers a little before it hears of their names
    wait_until(
        lambda: {"/intruder", "/test_client"} <= set(re.split(r"[ ,;]+", provoke())),
        "the names of the senders",
    )


def test_after_a_conflict_it_goes_on_when_it_is_told_to_and_asks_again(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator("humanoid")
    state = client.first_state()
    for effort in (1.0, 2.0):
        client.command(stamp_ns(state), {"left_elbow": effort})
    client.command(stamp_ns(state), all_but_left_elbow(state))
    client.reported(paused=True, conflict=1, accepted=2, tick=1)  # complete, and yet it waits

    response = client.pause(False)

    assert response.success
    client.spin_until(lambda: len(client.states) == 2, "the state again")
    assert client.states.raw[0] == client.states.raw[1]
    state = client.advance(state, {"left_elbow": 4.0})
    assert efforts_of(state)["left_elbow"] == 4.0


def test_a_conflict_ends_it_where_a_fault_is_to_abort(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator("humanoid", on_fault="abort")
    state = client.first_state()

    for effort in (1.0, 2.0):
        client.command(stamp_ns(state), {"left_elbow": effort})

    assert simulator.wait() == 1
    assert "error: two different commands for 'left_elbow'" in simulator.stderr


MALFORMED = {
    "not a number": (["chest_x", "chest_y", "chest_z"], [5.0, float("nan"), 0.0], "'chest_y'"),
    "infinite": (["right_knee", "left_knee"], [5.0, float("-inf")], "'left_knee'"),
    "unknown name": (["right_knee", "tail"], [5.0, 1.0], "'tail'"),
    "root": (
        ["right_knee", *(f"root_{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz"))],
        [5.0] * 7,
        "'root_x'",
    ),
    "fewer efforts than names": (["right_knee", "left_knee"], [5.0], "2 names but 1 effort"),
    "more efforts than names": (["right_knee"], [5.0, 1.0], "1 names but 2 efforts"),
    "a part of a ball joint": (["right_knee", "chest_x"], [5.0, 1.0], "'chest_y'"),
    "a name twice": (["right_knee", "right_knee"], [5.0, 5.0], "'right_knee'"),
    "empty": ([], [], "empty"),
}


def test_a_malformed_command_is_rejected_whole_and_the_reason_named(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator("humanoid", max_ticks=1)
    state = client.first_state()

    for names, efforts, _ in MALFORMED.values():
        client.torques.publish(joint_state(stamp_ns(state), names, effort=efforts))
    client.torques.publish(b"\x00\x01\x00\x00\xff\xff\xff\xff")
    state = client.advance(state, {"right_knee": 3.0})  # would conflict if any had been taken

    applied = {name: effort for name, effort in efforts_of(state).items() if effort}
    assert applied == {"right_knee": 3.0}
    client.reported(tick=2, rejected=len(MALFORMED) + 1, accepted=1, conflict=0)
    reasons = [reason for _, _, reason in MALFORMED.values()] + ["no JointState"]
    warnings = [line for line in simulator.stderr.splitlines() if "command rejected" in line]
    for reason, warning in zip(reasons, warnings, strict=True):
        assert reason in warning


def test_a_wrong_message_at_every_tick_is_told_once(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator(max_ticks=20)
    state = client.first_state()

    for _ in range(20):
        client.command(stamp_ns(state), {"tail": 1.0})
        state = client.advance(state, {})

    client.reported(rejected=20)
    assert simulator.stderr.count("'tail'") == 1


# Waiting, faults and the end


def test_a_long_wait_names_what_is_missing_and_whose_quality_of_service_does_not_fit(
    processes: Processes, client: SimulatorClient
) -> None:
    unreliable = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    client.node.destroy_publisher(client.torques)
    client.speak(topics.JOINT_TORQUES, unreliable)

    simulator = processes.simulator("humanoid", wait_for_subscribers=1)

    told = client.spin_until(
        lambda: [line for line in simulator.stderr.splitlines() if "waiting for commands" in line],
        "what it waits for",
    )
    assert "waiting for commands of chest_x, chest_y, chest_z, " in told[0]
    assert "/test_client" in told[0]
    assert "the QoS of test_client does not fit" in told[0]
    assert "reliab" in told[0].lower()


def test_it_ends_well_after_its_last_tick_and_the_last_state_arrives(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator(max_ticks=3)
    state = client.first_state()

    for _ in range(3):
        state = client.advance(state, {"hinge": 1.0})

    assert tick_of(state) == 4
    assert simulator.wait() == 0
    lines = simulator.stderr.splitlines()  # on a busy machine that it waits for this test
    assert all("waiting for commands" in line for line in lines)


def test_a_timeout_does_not_run_before_the_first_command(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator(republish_period=SOON, lockstep_timeout=SOON)

    client.first_state()
    wait_for_repeats(client, 5)

    assert simulator.exit_code is None
    client.advance(client.states.last, {})


def test_a_timeout_aborts_and_names_what_is_missing(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator("humanoid", lockstep_timeout=NO_TIME)
    state = client.advance(client.first_state(), {})

    client.command(stamp_ns(state), all_but_left_elbow(state))

    assert simulator.wait() == 1
    (error,) = [line for line in simulator.stderr.splitlines() if line.startswith("error: ")]
    assert f"no command within {NO_TIME} s" in error
    assert "waiting for commands of left_elbow;" in error


@pytest.mark.parametrize(("action", "filled"), [("hold", 1.5), ("zero", 0.0)])
def test_a_timeout_fills_in_the_last_command_or_zero_and_counts_it(
    processes: Processes, client: SimulatorClient, action: str, filled: float
) -> None:
    simulator = processes.simulator(lockstep_timeout=NO_TIME, on_timeout=action, max_ticks=4)
    state = client.first_state()

    client.advance(state, {"hinge": 1.5})

    assert simulator.wait() == 0
    assert list(client.state(2).effort) == [1.5]
    assert [list(client.state(tick).effort) for tick in (3, 4, 5)] == [[filled]] * 3
    client.reported(tick=5, timeouts=3)
    assert f"on_timeout: {action}" in simulator.stderr


def test_a_timeout_pauses_until_it_is_told_to_go_on(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator(lockstep_timeout=NO_TIME, on_timeout="pause")
    state = client.advance(client.first_state(), {})

    status = client.reported(paused=True, tick=2)
    assert status.level == status.ERROR
    assert "no command within" in status.message
    assert client.pause(False).success

    client.advance(state, {})
    assert simulator.exit_code is None


def test_it_pauses_on_request_and_goes_on(processes: Processes, client: SimulatorClient) -> None:
    processes.simulator()
    state = client.first_state()

    assert client.pause(True).message == "paused"
    client.command(stamp_ns(state), {"hinge": 1.0})
    status = client.reported(paused=True, accepted=1, tick=1)
    assert status.level == status.OK
    assert client.pause(False).message == "running"

    assert list(client.advance(state, {"hinge": 2.0}).effort) == [2.0]


def test_a_divergence_aborts_and_names_the_joint(
    processes: Processes, client: SimulatorClient
) -> None:
    simulator = processes.simulator("humanoid", on_fault="abort", speed_limit=10.0)
    state = client.first_state()
    harmful = {"left_elbow": 0.0, "left_knee": -150.0}

    client.command(stamp_ns(state), all_but_left_elbow(state) | harmful)

    assert simulator.wait() == 1
    (error,) = [line for line in simulator.stderr.splitlines() if line.startswith("error: ")]
    assert "diverged at tick 2: 'left_knee'" in error
    assert "the limit is 10" in error


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_promptly_and_well_while_somebody_listens(
    processes: Processes, client: SimulatorClient, number: signal.Signals
) -> None:
    simulator = processes.simulator()
    client.advance(client.first_state(), {})

    simulator.send(number)

    assert simulator.wait(PROMPTLY) == 0
    assert "Traceback" not in simulator.stderr


# Parameters


WRONG: dict[str, tuple[dict[str, Any], list[str]]] = {
    "character": ({"character": "centaur"}, ["centaur", "humanoid"]),
    "name": ({"max_tick": 3}, ["'max_tick'", "max_ticks"]),
    "joint": ({"commanded_joints": ["hinge", "tail"]}, ["'tail'", "hinge"]),
    "both": (
        {"initial_state": "reference", "initial_position": [0.1]},
        ["'initial_position' is given, and 'initial_state' is reference", "to given"],
    ),
    "length": ({"initial_position": [0.0, 1.0]}, ["'initial_position'", "2 entries", "hinge"]),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_parameter_ends_it_with_one_clear_line(processes: Processes, wrong: str) -> None:
    parameters, expected = WRONG[wrong]

    simulator = processes.simulator(**({"character": "pendulum"} | parameters))

    assert simulator.wait() == 1
    (line,) = simulator.stderr.splitlines()
    assert line.startswith("error: ")
    assert all(part in line for part in expected)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [(("--params-file", "none.yaml"), "none.yaml"), (("-p", "character"), "character")],
    ids=["no such file", "no value"],
)
def test_wrong_ros_arguments_end_it_with_one_clear_line(
    processes: Processes, arguments: tuple[str, ...], reason: str
) -> None:
    simulator = processes.python("-m", "sim_node.main", "--ros-args", *arguments)

    assert simulator.wait() == 1
    assert "Traceback" not in simulator.stderr
    *_, line = simulator.stderr.splitlines()  # what comes before is ROS' own
    assert line.startswith("error: ")
    assert reason in line


def test_parameters_are_answered_while_it_runs(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator(gravity=1.62, wait_for_subscribers=2)
    processes.controller(gravity=1.62)
    client.state(50)

    values = client.get_parameters(
        "sim_node", ["gravity", "rate", "on_timeout", "initial_position"]
    )
    names = client.list_parameters("sim_node")

    assert values == [1.62, 240, "abort", pytest.approx([0.5])]
    pendulum: Character = load_character("pendulum")
    assert set(names) >= {p.name for p in PARAMETERS + character_parameters(pendulum)}
    client.state(tick_of(client.states.last) + 50)


def test_a_parameter_that_is_fixed_while_it_runs_is_refused(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.simulator()
    client.first_state()

    taken, reason = client.set_parameter("sim_node", "substeps", 4)

    assert not taken
    assert reason
    assert client.get_parameters("sim_node", ["substeps"]) == [1]
