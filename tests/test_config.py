"""The parameter files that ship: each starts its nodes, and says what it claims to say."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from ros import MODULES, Inbox, Process, Processes, SimulatorClient, stamp_ns

from controller_node import parameters as for_controller
from controller_node.controller import Controller
from controller_node.motion import make_motion
from experiment.plan import make_plan
from msgs_config import topics
from msgs_config.arrays import FloatArray
from msgs_config.character import Character
from msgs_config.character_loading import load_character
from msgs_config.parameters import Values, resolve
from msgs_config.shared_parameters import placed
from sim_node.parameters import Part, make_cast, make_role, make_settings
from sim_node.simulation import Simulation

CONFIG = Path(__file__).parents[1] / "config"
SIMULATOR, CONTROLLER = "/sim_node", "/controller_node"
SIDES = ("left", "right")
NODES = {  # full names of the nodes that each file is for
    "franka_panda_realtime.yaml": [SIMULATOR, CONTROLLER],
    "humanoid_balance.yaml": [SIMULATOR, CONTROLLER],
    "humanoid_walk.yaml": [SIMULATOR, CONTROLLER],
    "pendulum.yaml": [SIMULATOR, CONTROLLER],
    "two_humanoids.yaml": [SIMULATOR, *(f"/{side}{CONTROLLER}" for side in SIDES)],
}
SHARED = ("character", "rate", "gravity", "placement")  # must be the same on both sides
A_FEW_TICKS = 20
MEETING_TICKS = 240  # within which two humanoids have met
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
    declared = for_controller.PARAMETERS + for_controller.character_parameters(character)
    return character, resolve(declared, parameters)


def controllers(file: str) -> list[str]:
    return [node for node in NODES[file] if node.endswith(CONTROLLER)]


# What is in them


def test_no_file_is_forgotten_here() -> None:
    assert {path.name for path in CONFIG.iterdir()} == set(NODES)


@pytest.mark.parametrize("file", NODES)
def test_everything_in_a_file_is_for_one_of_its_nodes(file: str) -> None:
    keys = yaml.safe_load((CONFIG / file).read_text())

    assert all(any(matches(key, node) for node in NODES[file]) for key in keys)
    assert all(given(file, node) for node in NODES[file])


@pytest.mark.parametrize("file", NODES)
def test_both_sides_agree_on_what_they_must_agree_on(file: str) -> None:
    parts = make_cast(given(file, SIMULATOR)).parts

    for part, node in zip(parts, controllers(file), strict=True):
        character, values = controller_values(file, node)
        assert {name: part.values[name] for name in SHARED} == {
            name: values[name] for name in SHARED
        }
        commanded = for_controller.commanded_joints(character, values)
        assert set(part.values.texts("commanded_joints")) == set(commanded)


BEGIN_AS_A_RUN = ["humanoid_balance.yaml", "humanoid_walk.yaml", "two_humanoids.yaml"]


@pytest.mark.parametrize("file", BEGIN_AS_A_RUN)
def test_a_motion_begins_as_in_a_run_to_the_bit(file: str) -> None:
    parts = make_cast(given(file, SIMULATOR)).parts

    for part, node in zip(parts, controllers(file), strict=True):
        settings = given(file, node)
        character = settings.pop("character")
        run = make_plan(character, 1.0, {}, {}, settings).simulator
        for name in ("initial_position", "initial_velocity", "commanded_joints"):
            assert part.values[name] == run[name]


# What they do


def start(processes: Processes, file: str, node: str) -> Process:
    """Start a node, given by its full name, with a file."""
    namespace, _, name = node.rpartition("/")
    arguments = ["--ros-args", "--params-file", str(CONFIG / file)]
    arguments += ["-r", f"__ns:={namespace}"] if namespace else []
    return processes.python("-m", MODULES[name], *arguments)


WAITING = "[sim_node]: waiting for commands of"  # rightly, where controllers take long to start


def have_been_answered(states: Inbox) -> bool:
    """Whether some states have come, of a character that is moved by torques."""
    stamps = {stamp_ns(state) for state in states.messages}
    return len(stamps) >= A_FEW_TICKS and any(any(state.effort) for state in states.messages)


@pytest.mark.parametrize("file", NODES)
def test_the_nodes_start_with_a_file_and_run(
    processes: Processes, client: SimulatorClient, file: str
) -> None:
    spaces = [node.removesuffix(CONTROLLER)[1:] for node in controllers(file)]
    states = [client.listen(topics.JOINT_STATES.under(space)) for space in spaces]

    nodes = [start(processes, file, node) for node in NODES[file]]

    client.spin_until(lambda: all(map(have_been_answered, states)), "states that were answered")
    assert [node.exit_code for node in nodes] == [None] * len(nodes)
    said = [line for node in nodes for line in node.stderr.splitlines()]
    assert [line for line in said if WAITING not in line] == []


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


@pytest.mark.parametrize(
    ("file", "prefix"), [("humanoid_walk.yaml", ""), ("two_humanoids.yaml", "right.")]
)
def test_ros_reads_the_initial_state_to_the_bit(
    processes: Processes, client: SimulatorClient, file: str, prefix: str
) -> None:
    names = [prefix + name for name in ("initial_position", "initial_velocity")]

    start(processes, file, SIMULATOR)

    values = client.get_parameters("sim_node", names)
    assert [list(value) for value in values] == [given(file, SIMULATOR)[name] for name in names]


def end_of(parts: Sequence[Part]) -> dict[str, FloatArray]:
    """Positions to which characters of `two_humanoids.yaml` come together in one world."""
    file, drivers = "two_humanoids.yaml", list[Controller]()
    for part in parts:
        character, values = controller_values(file, f"/{part.name}{CONTROLLER}")
        reference = make_motion(character, values).reference
        drivers.append(for_controller.make_controller(character, reference, values))
    roles = [make_role(part.character, part.values, part.name) for part in parts]
    with Simulation(roles, make_settings(parts[0].values)) as simulation:
        begin_ns = simulation.stamp_ns
        for _ in range(MEETING_TICKS):
            simulation.step(
                [
                    driver.answer(actor.state, begin_ns)[0]
                    for driver, actor in zip(drivers, simulation.actors, strict=True)
                ]
            )
        return {actor.role.name: actor.state.position for actor in simulation.actors}


def test_two_humanoids_push_each_other() -> None:
    parts = make_cast(given("two_humanoids.yaml", SIMULATOR)).parts

    together = end_of(parts)
    alone = {part.name: end_of([part])[part.name] for part in parts}

    assert together.keys() == set(SIDES)
    for name, position in together.items():
        assert np.linalg.norm(position[:3] - alone[name][:3]) > A_PUSH
