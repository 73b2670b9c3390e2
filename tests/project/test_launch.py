"""The launch files, with stand-ins for `launch`, which is only in a full ROS install.

What they name must exist: executables, parameters, files, arguments. With the files that they hand
to the nodes, `test_config.py` starts them.
"""

import ast
import re
import runpy
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from actuated_characters.recorder import parameters as for_recorder
from actuated_characters.ros2_control import parameters as for_bridge
from controller_node import parameters as for_controller
from msgs_config.character.loading import load_character
from sim_node import parameters as for_simulator

PROJECT = Path(__file__).parents[2]
PACKAGE = "actuated_characters"
SEVERAL_NODES = "composed"
"""The executable that has several nodes."""
FILES = sorted(path.name for path in (PROJECT / "launch").glob("*.py"))
NAMES = {
    "launch": ["LaunchDescription"],
    "launch.actions": [
        *("DeclareLaunchArgument", "IncludeLaunchDescription", "OpaqueFunction", "Shutdown")
    ],
    "launch.launch_context": ["LaunchContext"],
    "launch.launch_description_sources": ["PythonLaunchDescriptionSource"],
    "launch.substitutions": ["LaunchConfiguration", "PathJoinSubstitution"],
    "launch_ros": [],
    "launch_ros.actions": ["Node"],
    "launch_ros.parameter_descriptions": ["ParameterValue"],
    "launch_ros.substitutions": ["FindPackageShare"],
}
"""What the files use of `launch` and `launch_ros`, by module."""


class Made:
    """Something of `launch`, with what it was made of."""

    def __init__(self, *given: Any, **named: Any) -> None:
        self.given, self.named = given, named
        self.kind = type(self).__name__

    def perform(self, context: Mapping[str, str]) -> str:
        """The value of an argument."""
        return context.get(self.given[0], "")


@dataclass
class LaunchFile:
    """What a launch file declares, includes and starts, with some values of its arguments."""

    values: Mapping[str, str]
    declared: dict[str, dict[str, Any]] = field(default_factory=dict)
    included: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    nodes: list[dict[str, Any]] = field(default_factory=list)  # of this package
    others: list[dict[str, Any]] = field(default_factory=list)

    def add(self, entity: Made) -> None:
        if entity.kind == "DeclareLaunchArgument":
            self.declared[entity.given[0]] = entity.named
        elif entity.kind == "IncludeLaunchDescription":
            share, *path = entity.given[0].given[0].given[0]
            assert share.given == (PACKAGE,) and path[0] == "launch"
            self.included.append((path[1], dict(entity.named["launch_arguments"])))
        elif entity.kind == "OpaqueFunction":
            for inner in entity.named["function"](self.values):
                self.add(inner)
        else:
            assert entity.kind == "Node"
            own = entity.named["package"] == PACKAGE
            (self.nodes if own else self.others).append(entity.named)

    @property
    def arguments(self) -> set[str]:
        """The arguments that it takes: its own, and those of the files that it includes."""
        return set(self.declared).union(*(read(name).arguments for name, _ in self.included))

    @property
    def used(self) -> set[str]:
        """The arguments whose values its nodes use."""
        return {
            each.given[0]
            for each in parts([self.nodes, self.others])
            if each.kind == "LaunchConfiguration"
        }


def parts(value: Any) -> Iterator[Made]:
    """All that something is made of."""
    if isinstance(value, Made):
        yield value
        yield from parts((value.given, value.named))
    elif isinstance(value, Mapping):
        yield from parts(list(value.values()))
    elif isinstance(value, list | tuple):
        for each in value:
            yield from parts(each)


def read(name: str, **values: str) -> LaunchFile:
    """A launch file; every argument has the value given, or "1"."""
    assert name in FILES, f"{name} does not exist"
    with pytest.MonkeyPatch.context() as patch:
        for module, names in NAMES.items():
            stand_in = ModuleType(module)
            for each in names:
                setattr(stand_in, each, type(each, (Made,), {}))
            patch.setitem(sys.modules, module, stand_in)
        patch.delitem(sys.modules, f"{PACKAGE}.launching", raising=False)
        made = runpy.run_path(str(PROJECT / "launch" / name))["generate_launch_description"]()
        patch.delitem(sys.modules, f"{PACKAGE}.launching", raising=False)
    file = LaunchFile(values or dict.fromkeys(PARAMETERS, "1"))
    for entity in made.given[0]:
        file.add(entity)
    return file


@cache
def parameters_of(executable: str) -> set[str]:
    if executable == SEVERAL_NODES:  # what is set for the process is set for all its nodes
        return parameters_of("sim_node") & parameters_of("controller_node")
    humanoid = load_character("humanoid")
    parameters = {
        "sim_node": for_simulator.PARAMETERS + for_simulator.character_parameters(humanoid),
        "controller_node": for_controller.PARAMETERS,
        "recorder": for_recorder.PARAMETERS,
        "ros2_control_bridge": for_bridge.PARAMETERS,
    }
    return {parameter.name for parameter in parameters[executable]}


PARAMETERS = parameters_of("sim_node") | parameters_of("controller_node")


@cache
def executables() -> set[str]:
    """The executables that setup.py installs."""
    setup = (PROJECT / "setup.py").read_text(encoding="utf-8")
    return set(re.findall(r'"(\w+) = [\w.]+:main"', setup))


def package_xml() -> ElementTree.Element:
    return ElementTree.fromstring((PROJECT / "package.xml").read_bytes())


def test_there_is_a_launch_file_for_each_set_of_nodes() -> None:
    started = {name: [node["executable"] for node in read(name).nodes] for name in FILES}

    assert started == {  # beside what they include
        "composed.launch.py": ["composed"],
        "everything.launch.py": ["recorder"],
        "ros2_control.launch.py": ["sim_node", "ros2_control_bridge"],
        "simulator.launch.py": ["sim_node"],
        "simulator_controller.launch.py": ["controller_node"],
        "two_humanoids.launch.py": ["sim_node", "controller_node", "controller_node"],
    }
    assert [name for name, _ in read("everything.launch.py").included] == [
        "simulator_controller.launch.py"
    ]
    assert [name for name, _ in read("simulator_controller.launch.py").included] == [
        "simulator.launch.py"
    ]


def test_what_launch_files_import_is_a_dependency() -> None:
    declared = {element.text for element in package_xml().iter("exec_depend")}
    sources = [*(PROJECT / "launch").glob("*.py"), PROJECT / PACKAGE / "launching.py"]
    imported = {
        str(node.module).split(".")[0]
        for source in sources
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom)
    }

    assert imported <= declared | {PACKAGE}


@pytest.mark.parametrize("name", FILES)
def test_every_node_is_an_executable_of_this_package_under_its_own_name(name: str) -> None:
    for node in read(name).nodes:
        assert node["package"] == package_xml().findtext("name") == PACKAGE
        assert node["executable"] in executables()
        if node["executable"] == SEVERAL_NODES:
            assert node["name"] is None  # all nodes of the process would have it
        else:
            assert node["name"] == node["executable"]


@pytest.mark.parametrize("name", FILES)
def test_all_nodes_end_when_one_ends(name: str) -> None:
    for node in read(name).nodes:
        assert node["on_exit"].kind == "Shutdown" and node["on_exit"].named["reason"]


@pytest.mark.parametrize("name", FILES)
def test_every_argument_has_a_description_and_a_default(name: str) -> None:
    for declaration in read(name).declared.values():
        assert declaration["description"]
        assert isinstance(declaration["default_value"], str)


@pytest.mark.parametrize("name", FILES)
def test_every_argument_that_is_used_is_declared_and_none_is_for_nothing(name: str) -> None:
    file = read(name)

    assert file.used <= file.arguments
    assert set(file.declared) <= file.used


def test_the_arguments_are_there_that_a_user_looks_for() -> None:
    expected = {"config", "character", "reference", "clip", "namespace", "max_ticks", "directory"}

    assert read("everything.launch.py").arguments >= expected


@pytest.mark.parametrize("name", FILES)
def test_every_parameter_that_is_set_exists(name: str) -> None:
    for node in read(name).nodes:
        (given,) = node["parameters"]
        assert set(given) <= parameters_of(node["executable"])


@pytest.mark.parametrize("name", FILES)
def test_an_argument_sets_the_parameter_of_its_name_unless_it_is_empty(name: str) -> None:
    for value in ("max_ticks", "character", "none"):
        for node in read(name, **{value: "1"}).nodes:
            (given,) = node["parameters"]
            if node["executable"] != "recorder":
                assert set(given) <= {value}
                assert all(it.given == (parameter,) for parameter, it in given.items())


@pytest.mark.parametrize("name", FILES)
def test_what_is_handed_to_an_included_file_is_an_argument_of_it(name: str) -> None:
    for included, given in read(name).included:
        assert set(given) <= read(included).arguments


@pytest.mark.parametrize("name", FILES)
def test_the_parameter_file_ships(name: str) -> None:
    declared = read(name).declared
    if "config" in declared:
        assert (PROJECT / "config" / declared["config"]["default_value"]).is_file()


def test_the_controller_manager_and_its_controllers_are_those_of_the_config() -> None:
    file = read("ros2_control.launch.py")
    config = yaml.safe_load(
        (PROJECT / "config" / file.declared["config"]["default_value"]).read_text()
    )
    manager, *spawners = file.others
    known = config["/**/controller_manager"]["ros__parameters"]

    assert manager["executable"] == "ros2_control_node" and manager["on_exit"].kind == "Shutdown"
    assert manager["parameters"] == [{"use_sim_time": True}]
    assert {each["arguments"][0] for each in spawners} == {
        name for name, value in known.items() if isinstance(value, dict)
    }
    assert all("on_exit" not in each for each in spawners)  # they end when it is active
    bridge = config["/**/ros2_control_bridge"]["ros__parameters"]
    assert bridge["update_rate"] == known["update_rate"]
    (simulator,) = (each for each in file.nodes if each["executable"] == "sim_node")
    assert simulator["remappings"] == [("/clock", "sim_clock")]


def test_controllers_stand_in_the_namespaces_of_the_two_characters() -> None:
    file = read("two_humanoids.launch.py")
    config = yaml.safe_load(
        (PROJECT / "config" / file.declared["config"]["default_value"]).read_text()
    )

    characters = config["/**/sim_node"]["ros__parameters"]["characters"]

    namespaces = [node["namespace"] for node in file.nodes]
    assert namespaces == ["", *characters]
