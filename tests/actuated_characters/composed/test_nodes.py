"""Simulator and controllers as nodes of one process: from outside they are what they were."""

import signal
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.bags.recording import read_recordings
from actuated_characters.metrics.state_hash import StateHash
from actuated_characters.replay.replay import replay
from actuated_characters.replay.through_topics import replay_commands, replay_states
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from controller_node.parameters import make_controller
from msgs_config.messages import topics
from sim_node.physics.simulation import Simulation
from sim_node.simulation_factory import make_character_setup, make_simulation_settings
from tests.support.ros import Processes, SimulatorClient, stamp_ns, tick_of, wrench_message
from tests.support.runs import Run, run_plan, summary_of

SLOWLY = {"real_time_factor": 0.05}  # a tick takes 83 ms: time for others to send something
SINE: dict[str, object] = {"reference": "sine", "signal__dofs": ["hinge"]}
WALK: dict[str, object] = {"reference": "clip", "clip": "walk"}
TICKS = 40  # of a planned walk
LONG = 120.0  # s that a planner may take to be compiled
PLANNED: dict[str, object] = {
    "planner": "predictive",
    "root_assistance": False,
    "plan.samples": 8,
    "plan.rounds": 1,
}


# The states


def hash_of(plan: RunPlan) -> str:
    """The hash of a plan's states in one process without ROS."""
    state_hash = StateHash()
    for number, tick in enumerate(ticks_in_process(plan)):
        for state in (tick.state, tick.following)[number > 0 :]:
            state_hash.add(state)
    return state_hash.hexdigest()


def plan_of(name: str) -> RunPlan:
    if name == "pendulum":
        return make_plan(name, 0.5, {"reference": "sine"}, {}, {"signal.dofs": ["hinge"]})
    if name == "walk":
        return make_plan("humanoid", 1.0, WALK, {}, {})
    return make_plan("humanoid", 0.4, WALK, {}, PLANNED)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "pendulum",
        pytest.param("walk", marks=pytest.mark.slow),
        pytest.param("planned", marks=[pytest.mark.slow, pytest.mark.nightly]),
    ],
)
def test_a_run_has_the_states_of_one_without_ros_and_its_recording_is_whole(
    domain: int, tmp_path: Path, name: str
) -> None:
    del domain
    plan = plan_of(name)

    run_plan(plan, tmp_path / "run", composed=True)

    expected = hash_of(plan)
    assert summary_of(tmp_path / "run")["state_hash"] == expected
    assert replay(read_recordings(tmp_path / "run")).state_hashes == {"": expected}


@pytest.mark.nightly
@pytest.mark.slow
def test_what_it_recorded_replays_through_topics(domain: int, tmp_path: Path) -> None:
    del domain
    plan = plan_of("pendulum")
    run_plan(plan, tmp_path / "run", composed=True)
    quietly = {"progress": lambda done: None, "tell": lambda line: None}

    states = replay_commands(tmp_path / "run", **quietly)
    commands = replay_states(tmp_path / "run", **quietly)

    assert states.state_hashes == {"": hash_of(plan)}
    assert commands.identical


@pytest.mark.parametrize("namespace", ["", "here"])
def test_each_character_has_a_controller_in_its_namespace(
    processes: Processes, client: SimulatorClient, namespace: str
) -> None:
    states = [
        client.listen(topics.JOINT_STATES.under(f"{namespace}/{n}".lstrip("/"))) for n in "ab"
    ]
    expected = {f"{namespace}/{name}/controller_node".lstrip("/") for name in ("a", "b")}

    def controllers() -> set[str]:
        named = client.node.get_node_names_and_namespaces()
        return {f"{space.lstrip('/')}/{name}" for name, space in named if name == "controller_node"}

    processes.composed({"characters": ["a", "b"]}, SINE, namespace)

    client.spin_until(lambda: all(len(each) > 20 for each in states), "states of both")
    assert any(any(state.effort) for state in states[1].messages)
    # names come by a topic of their own, later than data perhaps
    client.spin_until(lambda: controllers() == expected, "the controllers' names")


def test_it_ends_by_itself_after_the_last_tick(processes: Processes) -> None:
    composed = processes.composed({"max_ticks": 100}, SINE)

    assert composed.wait() == 0
    assert composed.stderr == ""


# While it runs


def test_services_and_parameters_of_both_answer(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.composed(SLOWLY, SINE)
    client.spin_until(lambda: client.states.messages, "states")

    assert client.pause(True).success
    step = client.step()
    client.spin_until(step.done, "a step")
    assert step.result().success
    assert client.set_parameter("sim_node", "step_count", 2) == (True, "")
    assert client.set_parameter("controller_node", "gains.hinge.p", 7.0) == (True, "")
    assert client.get_parameters("sim_node", ["step_count"]) == [2]
    assert client.get_parameters("controller_node", ["gains.hinge.p"]) == [7.0]
    taken, reason = client.set_parameter("controller_node", "gains.hinge.p", -7.0)
    assert not taken and "gains.hinge.p" in reason
    assert client.pause(False).success
    assert client.reset().success
    client.spin_until(lambda: len(client.episodes) == 2, "another episode")


def test_who_joins_late_hears_what_was_said_before(
    processes: Processes, client: SimulatorClient
) -> None:
    processes.composed({"max_ticks": 0}, SINE)
    client.spin_until(lambda: len(client.states) > 20, "states")

    configuration = client.listen(topics.CONFIGURATION.of(topics.CONTROLLER_NODE))
    client.spin_until(lambda: configuration.messages and client.configuration.messages, "both")


def test_another_controller_on_the_topics_is_a_conflict(
    processes: Processes, client: SimulatorClient
) -> None:
    composed = processes.composed({**SLOWLY, "on_fault": "abort"}, SINE)

    def interfere() -> None:
        if client.states.messages:
            client.command(stamp_ns(client.states.last), {"hinge": 99.0})

    client.spin_sending(interfere, lambda: composed.exit_code is not None, "the end")

    assert composed.exit_code == 1
    assert "error: sim_node: two different commands for 'hinge'" in composed.stderr
    assert "Traceback" not in composed.stderr


def test_a_push_from_another_process_acts(processes: Processes, client: SimulatorClient) -> None:
    processes.composed(SLOWLY, SINE)
    applied = client.listen(topics.APPLIED_WRENCH)
    message = wrench_message(0, [("rod", [5.0, 0.0, 0.0, 0.0, 0.0, 0.0])])
    client.spin_sending(
        lambda: client.wrenches.publish(message),
        lambda: any(each.joint_names for each in applied.messages),
        "a push that acted",
    )

    acted = next(each for each in applied.messages if each.joint_names)
    assert set(acted.joint_names) == {"rod"}  # sent again and again, several act at once
    assert {each.force.x for each in acted.wrench} == {5.0}


@pytest.mark.slow
def test_a_reset_while_a_plan_is_waited_for_begins_a_whole_episode(
    processes: Processes, client: SimulatorClient
) -> None:
    plan = make_plan("humanoid", TICKS / 240, WALK, {}, PLANNED)
    endless = {**plan.simulator, "max_ticks": 0, "wait_for_subscribers": 2}
    composed = processes.composed(endless, deepcopy(plan.controller))  # rcl reads no aliases
    client.spin_until(lambda: len(client.states.by_tick()) > TICKS, "states", LONG)

    for _ in range(3):  # nearly all of the time it plans
        assert client.reset().success

    client.spin_until(lambda: len(client.episodes) == 4, "the last of four episodes")
    begin = tick_of(client.episodes.last)
    expected = planned_positions(plan, begin)
    client.spin_until(lambda: tick_of(client.states.last) >= begin + TICKS, "states", LONG)
    by_tick = client.states.by_tick()
    assert sorted(by_tick) == list(range(1, len(by_tick) + 1))
    assert [list(by_tick[begin + n].position) for n in range(TICKS)] == expected
    assert composed.exit_code is None


def planned_positions(plan: RunPlan, begin: int) -> list[list[float]]:
    """The positions of an episode that begins at a tick, in one process without ROS."""
    driver = make_controller(plan.character, plan.reference, plan.controller)
    setup = make_character_setup(plan.character, plan.simulator)
    with Simulation([setup], make_simulation_settings(plan.simulator)) as run:
        while run.tick < begin:
            run.reset()
        (character,) = run.characters
        positions, begin_ns = [], character.state.stamp_ns
        for _ in range(TICKS):
            positions.append(character.state.position.tolist())
            effort, _ = driver.compute_effort(character.state, begin_ns)
            run.step([np.where(character.commanded, effort, 0.0)])
    return positions


def test_in_real_time_ticks_come_when_they_are_due(
    processes: Processes, client: SimulatorClient
) -> None:
    settings = {"mode": "realtime", "wait_for_subscribers": 2, "max_ticks": 240}
    composed = processes.composed(settings, SINE)

    assert composed.wait() == 0
    status = client.reported(tick=241)
    values = {item.key: item.value for item in status.values}
    assert int(values["accepted"]) > 120
    assert int(values["command_timeouts"]) == 0


# Its end


@pytest.mark.parametrize(
    ("simulator", "controller", "line"),
    [
        ({"friction": -1.0}, {}, "error: sim_node: parameter 'friction' is -1.0; it must be"),
        ({}, {"law": "magic"}, "error: controller_node: unknown value of parameter 'law': 'magic'"),
        ({"gravity": 1.0}, {}, "error: controller_node: the simulator's character is not the"),
        ({"characters": ["a"]}, {"law": "magic"}, "error: a/controller_node: unknown value"),
    ],
)
def test_an_error_of_either_node_is_one_line_that_names_it(
    processes: Processes, simulator: dict[str, object], controller: dict[str, object], line: str
) -> None:
    composed = processes.composed(simulator, controller)

    assert composed.wait() == 1
    (error,) = composed.stderr.splitlines()
    assert error.startswith(line)


def test_two_nodes_of_one_name_are_an_error(processes: Processes) -> None:
    composed = processes.python(
        "-m", "actuated_characters.composed.main", "--ros-args", "-r", "__node:=x"
    )

    assert composed.wait() == 1
    assert "error: two nodes of this process are called '/x'" in composed.stderr


def test_help_says_whose_parameters_are_set_how(processes: Processes) -> None:
    helping = processes.python("-m", "actuated_characters.composed.main", "--help")

    assert helping.wait() == 0
    assert "sim_node:NAME:=VALUE" in helping.stdout
    assert "/left/controller_node" in helping.stdout


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_well(
    processes: Processes, client: SimulatorClient, number: signal.Signals
) -> None:
    composed = processes.composed({}, SINE)
    client.spin_until(lambda: len(client.states) > 20, "states")

    composed.send(number)

    assert composed.wait() == 0
    assert composed.stderr == ""


def test_a_run_cannot_be_composed_and_without_ros(processes: Processes, tmp_path: Path) -> None:
    run = Run(processes, "run", "--composed", "--in-process", "--output", str(tmp_path / "run"))

    assert run.process.wait() == 2
    assert "--in-process: not allowed with argument --composed" in run.process.stderr
    assert not (tmp_path / "run").exists()
