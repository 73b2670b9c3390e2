"""The parameter files that ship: each starts its nodes, and says what it claims to say."""

import json
import re
import signal
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from actuated_characters.bags.recording import read_recordings
from actuated_characters.metrics.state_hash import StateHash
from actuated_characters.replay.replay import replay
from actuated_characters.replay.through_topics import replay_commands
from actuated_characters.ros2_control import parameters as for_bridge
from actuated_characters.ros2_control.timetable import UpdatePeriod
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from actuated_characters.runs.processes import MODULES
from controller_node import parameters as for_controller
from controller_node.controller import Controller
from controller_node.references.factory import make_motion
from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.messages import topics
from msgs_config.messages.state import StampedState
from msgs_config.parameters import Values
from msgs_config.shared_parameters import placed
from sim_node.initial_state import CharacterSettings
from sim_node.parameters import CharacterParameters, load_parameters
from sim_node.physics.simulation import Simulation
from sim_node.simulation_factory import make_character_setup, make_simulation_settings
from tests.support.ros import Process, Processes, ReceivedMessages, SimulatorClient, stamp_ns

CONFIG = Path(__file__).parents[2] / "config"
SIMULATOR, CONTROLLER = "/sim_node", "/controller_node"
SIDES = ("left", "right")
BRIDGE = "/ros2_control_bridge"
OF_ROS2_CONTROL = ("/controller_manager", "/joint_trajectory_controller")
NODES = {  # full names of the nodes that each file is for
    "franka_panda_realtime.yaml": [SIMULATOR, CONTROLLER],
    "franka_panda_ros2_control.yaml": [SIMULATOR, BRIDGE, *OF_ROS2_CONTROL],
    "humanoid_balance.yaml": [SIMULATOR, CONTROLLER],
    "humanoid_walk.yaml": [SIMULATOR, CONTROLLER],
    "pendulum.yaml": [SIMULATOR, CONTROLLER],
    "two_humanoids.yaml": [SIMULATOR, *(f"/{side}{CONTROLLER}" for side in SIDES)],
}
WITHOUT_CONTROLLER_NODE = "franka_panda_ros2_control.yaml"
PAIRS = sorted(NODES.keys() - {WITHOUT_CONTROLLER_NODE})
"""The files of a simulator and its `controller_node`."""
LAYOUTS = ("actuated_characters.rviz", "foxglove.json")  # see test_layouts.py
SHARED = (
    "character",
    "rate",
    "gravity",
    "placement",
    "command_delay_ticks",
)  # must be the same on both sides
A_FEW_TICKS = 20
LONG = 120.0  # s that a run may take: a node that was killed before stays in the graph for 20 s
TICKS = 240  # within which two humanoids have met
A_PUSH = 0.01  # m that a root is moved by


def given(file: str, node: str) -> dict[str, Any]:
    """What a file says for a node, as rcl reads it: every key that matches, the last one counts."""
    content = yaml.safe_load((CONFIG / file).read_text())
    found: dict[str, Any] = {}
    for key, section in content.items():
        if matches(key, node):
            found |= dict(flattened(section["ros__parameters"]))
    return found


def matches(key: str, node: str) -> bool:
    return re.fullmatch(key.replace("/**", r"(/\w+)*"), node) is not None


def flattened(section: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in section.items():
        if isinstance(value, dict):
            yield from flattened(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def controller_values(file: str, node: str) -> tuple[Character, Values]:
    parameters = given(file, node)
    character = placed(load_character(parameters["character"]), parameters)
    return character, for_controller.resolve_for(character, parameters)


def controllers(file: str) -> list[str]:
    return [node for node in NODES[file] if node.endswith(CONTROLLER)]


# What is in them


def test_no_file_is_forgotten_here() -> None:
    assert {path.name for path in CONFIG.iterdir()} == {*NODES, *LAYOUTS}


@pytest.mark.parametrize("file", NODES)
def test_everything_in_a_file_is_for_one_of_its_nodes(file: str) -> None:
    keys = yaml.safe_load((CONFIG / file).read_text())

    assert all(any(matches(key, node) for node in NODES[file]) for key in keys)
    assert all(given(file, node) for node in NODES[file])


@pytest.mark.parametrize("file", PAIRS)
def test_both_sides_agree_on_what_they_must_agree_on(file: str) -> None:
    parts = load_parameters(given(file, SIMULATOR)).characters

    for part, node in zip(parts, controllers(file), strict=True):
        character, values = controller_values(file, node)
        assert {name: part.values[name] for name in SHARED} == {
            name: values[name] for name in SHARED
        }
        commanded = for_controller.commanded_joints(character, values)
        assert set(part.values["commanded_joints"]) == set(commanded)


def test_the_bridge_agrees_with_both_of_its_sides() -> None:
    simulator, bridge, manager, _ = (
        given(WITHOUT_CONTROLLER_NODE, node) for node in NODES[WITHOUT_CONTROLLER_NODE]
    )
    character = load_character(bridge["character"])

    assert for_bridge.resolved(character, bridge)["rate"] == simulator["rate"]
    assert simulator["character"] == bridge["character"]
    assert bridge["update_rate"] == manager["update_rate"]
    UpdatePeriod(bridge["rate"], bridge["update_rate"]).whole_ns(bridge["start_time"])


MOTIONS = ["humanoid_balance.yaml", "humanoid_walk.yaml", "two_humanoids.yaml"]


@pytest.mark.parametrize("file", MOTIONS)
def test_the_file_of_a_motion_holds_no_state(file: str) -> None:
    parameters = given(file, SIMULATOR)

    assert not [name for name in parameters if "initial_pos" in name or "initial_vel" in name]
    assert all(
        CharacterSettings.of(part.values).begins_with_reference
        for part in load_parameters(parameters).characters
    )


# What they do


def start(processes: Processes, file: str, node: str, **more: object) -> Process:
    """Start a node, given by its full name, with a file, and parameters beside it."""
    namespace, _, name = node.rpartition("/")
    arguments = ["--ros-args", "--params-file", str(CONFIG / file)]
    for parameter, value in more.items():
        arguments += ["-p", f"{parameter}:={value}"]
    arguments += ["-r", f"__ns:={namespace}"] if namespace else []
    return processes.python("-m", MODULES[name], *arguments)


WAITING = "[sim_node]: waiting for "  # rightly, where controllers take long to start


def complaints(nodes: Iterable[Process]) -> list[str]:
    lines = [line for node in nodes for line in node.stderr.splitlines()]
    return [line for line in lines if WAITING not in line]


def have_been_answered(states: ReceivedMessages) -> bool:
    """Whether some states have come, of a character that is moved by torques."""
    stamps = {stamp_ns(state) for state in states.messages}
    return len(stamps) >= A_FEW_TICKS and any(any(state.effort) for state in states.messages)


@pytest.mark.slow
@pytest.mark.parametrize("file", sorted({*PAIRS} - {*MOTIONS}))  # those are recorded below
def test_the_nodes_start_with_a_file_and_run(
    processes: Processes, client: SimulatorClient, file: str
) -> None:
    spaces = [node.removesuffix(CONTROLLER)[1:] for node in controllers(file)]
    states = [client.listen(topics.JOINT_STATES.under(space)) for space in spaces]

    nodes = [start(processes, file, node) for node in NODES[file]]

    client.spin_until(lambda: all(map(have_been_answered, states)), "states that were answered")
    assert [node.exit_code for node in nodes] == [None] * len(nodes)
    assert complaints(nodes) == []


@pytest.mark.slow
def test_a_file_is_for_any_namespace(processes: Processes, client: SimulatorClient) -> None:
    states = client.listen(topics.JOINT_STATES.under("here/there"))

    for node in NODES["pendulum.yaml"]:
        start(processes, "pendulum.yaml", f"/here/there{node}")

    client.spin_until(lambda: have_been_answered(states), "states that were answered")


def test_what_is_set_beside_a_file_counts_more_than_the_file(
    processes: Processes, client: SimulatorClient
) -> None:
    file = str(CONFIG / "pendulum.yaml")

    processes.python(
        "-m", "sim_node.main", "--ros-args", "--params-file", file, "-p", "initial_position:=[0.25]"
    )

    assert list(client.first_state().position) == [0.25]


@dataclass(frozen=True)
class Ending:
    """What a character of a file comes to."""

    position: FloatArray  # (n,) the last one
    state_hash: str


def ends_of(file: str, parts: Sequence[CharacterParameters]) -> dict[str, Ending]:
    """What characters of a file come to, together in one world, without ROS."""
    drivers, states = list[Controller](), dict[str, StampedState]()
    for part in parts:
        node = f"/{part.name}{CONTROLLER}" if part.name else CONTROLLER
        character, values = controller_values(file, node)
        motion = make_motion(character, values)
        drivers.append(for_controller.make_controller(character, motion.reference, values))
        states[part.name] = motion.first_state()
    setups = [make_character_setup(part.character, part.values, part.name) for part in parts]
    hashes = {part.name: StateHash() for part in parts}
    with Simulation(setups, make_simulation_settings(parts[0].values)) as simulation:
        simulation.begin_in(states)
        begin_ns = simulation.stamp_ns
        for tick in range(TICKS + 1):
            for simulated in simulation.characters:
                hashes[simulated.setup.name].add(simulated.state)
            if tick < TICKS:
                simulation.step(
                    [
                        np.where(
                            simulated.commanded,
                            driver.compute_effort(simulated.state, begin_ns)[0],
                            0.0,
                        )
                        for driver, simulated in zip(drivers, simulation.characters, strict=True)
                    ]
                )
        return {
            simulated.setup.name: Ending(
                simulated.state.position, hashes[simulated.setup.name].hexdigest()
            )
            for simulated in simulation.characters
        }


@cache
def ends_of_two() -> dict[str, Ending]:
    return ends_of(
        "two_humanoids.yaml", load_parameters(given("two_humanoids.yaml", SIMULATOR)).characters
    )


def test_two_humanoids_push_each_other() -> None:
    file = "two_humanoids.yaml"
    parts = load_parameters(given(file, SIMULATOR)).characters

    together = ends_of_two()
    alone = {part.name: ends_of(file, [part])[part.name] for part in parts}

    assert together.keys() == set(SIDES)
    for name, ending in together.items():
        assert np.linalg.norm(ending.position[:3] - alone[name].position[:3]) > A_PUSH


# The states of a run


def record(processes: Processes, folder: Path, file: str, order: Sequence[str]) -> dict[str, str]:
    """Let a file's nodes run, started in an order; the hashes of the states of its characters."""
    cast = load_parameters(given(file, SIMULATOR))
    listening = {"directory": str(folder / "run"), "characters": list(cast.names)}
    recorder = processes.node(topics.RECORDER_NODE, **listening)
    more: dict[str, object] = {"wait_for_subscribers": 2}  # controller, or simulator, and recorder
    started = {}
    for node in order:
        ends = {"max_ticks": TICKS} if node == SIMULATOR else {}
        started[node] = start(processes, file, node, **more, **ends)
    assert started[SIMULATOR].wait(LONG) == 0
    recorder.send(signal.SIGINT)
    assert recorder.wait(LONG) == 0
    assert complaints(started.values()) == []
    return {part.name: hash_in(folder / "run" / part.name) for part in cast.characters}


def hash_in(directory: Path) -> str:
    summary = json.loads((directory / "summary.json").read_text())
    assert summary["ticks"] == TICKS
    return str(summary["state_hash"])


@pytest.mark.slow
@pytest.mark.parametrize("file", [pytest.param(MOTIONS[0], marks=pytest.mark.nightly), MOTIONS[1]])
def test_the_nodes_of_a_file_have_the_states_of_a_run(
    processes: Processes, tmp_path: Path, file: str
) -> None:
    settings = given(file, CONTROLLER)
    character = settings.pop("character")
    plan = make_plan(character, TICKS / settings["rate"], {}, {}, settings)
    run = StateHash()
    for number, tick in enumerate(ticks_in_process(plan)):
        for state in (tick.state, tick.following)[number > 0 :]:
            run.add(state)

    found = record(processes, tmp_path, file, NODES[file])

    assert found == {"": run.hexdigest()}
    assert replay(read_recordings(tmp_path / "run")).state_hashes == found
    again = replay_commands(tmp_path / "run", progress=lambda done: None, tell=lambda line: None)
    assert again.state_hashes == found


@pytest.mark.slow
def test_nodes_of_one_process_take_a_file_and_have_the_same_states(
    processes: Processes, tmp_path: Path
) -> None:
    file = "two_humanoids.yaml"
    listening = {"directory": str(tmp_path / "run"), "characters": list(SIDES)}
    recorder = processes.node(topics.RECORDER_NODE, **listening)

    ends = ("-p", "wait_for_subscribers:=2", "-p", f"sim_node:max_ticks:={TICKS}")
    arguments = ("--ros-args", "--params-file", str(CONFIG / file), *ends)
    composed = processes.python("-m", MODULES["composed"], *arguments)

    assert composed.wait(LONG) == 0
    recorder.send(signal.SIGINT)
    assert recorder.wait(LONG) == 0
    assert complaints([composed]) == []
    found = {name: hash_in(tmp_path / "run" / name) for name in SIDES}
    assert found == {name: ending.state_hash for name, ending in ends_of_two().items()}
    assert replay(read_recordings(tmp_path / "run")).state_hashes == found


@pytest.mark.slow
@pytest.mark.parametrize(
    "turns", [1, *(pytest.param(turns, marks=pytest.mark.nightly) for turns in (0, 2))]
)
def test_the_states_of_two_humanoids_do_not_depend_on_who_starts_first(
    processes: Processes, tmp_path: Path, turns: int
) -> None:
    file = "two_humanoids.yaml"
    order = [*NODES[file][turns:], *NODES[file][:turns]]

    found = record(processes, tmp_path, file, order)

    assert found == {name: ending.state_hash for name, ending in ends_of_two().items()}
