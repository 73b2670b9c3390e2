"""The launch files, read but not run: `launch` is only in a full ROS install.

What they name must exist: executables, parameters, files, arguments. With the files that they hand
to the nodes, `test_config.py` starts them.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache, cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from actuated_characters.recorder import parameters as for_recorder
from controller_node import parameters as for_controller
from msgs_config.character.loading import load_character
from sim_node import parameters as for_simulator

PROJECT = Path(__file__).parents[2]
PACKAGE = "actuated_characters"
SEVERAL_NODES = "composed"
"""The executable that has several nodes."""
FILES = sorted(path.name for path in (PROJECT / "launch").glob("*.py"))


class LaunchFile:
    """A launch file's text: what it declares, uses and starts."""

    def __init__(self, name: str) -> None:
        self._tree = ast.parse((PROJECT / "launch" / name).read_text(encoding="utf-8"))

    def calls(self, function: str) -> list[ast.Call]:
        """All calls of a function, by its name."""
        return [
            node
            for node in ast.walk(self._tree)
            if isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id == function
        ]

    def constant(self, name: str) -> Any:
        """The value of a constant of the module; an empty tuple if there is none."""
        for node in self._tree.body:
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name:
                return ast.literal_eval(node.value)
        return ()

    @cached_property
    def imported(self) -> set[str]:
        """The packages that it imports from."""
        modules = [node.module for node in ast.walk(self._tree) if isinstance(node, ast.ImportFrom)]
        return {str(module).split(".")[0] for module in modules}

    @cached_property
    def declared(self) -> dict[str, dict[str, Any]]:
        """Its own arguments with what is said of each."""
        return {
            text(call.args[0]): {str(k.arg): ast.literal_eval(k.value) for k in call.keywords}
            for call in self.calls("DeclareLaunchArgument")
        }

    @cached_property
    def used(self) -> set[str]:
        """The arguments whose values it uses."""
        texts = [call.args[0] for call in self.calls("LaunchConfiguration")]
        named = {text(node) for node in texts if isinstance(node, ast.Constant)}
        return named | set(self.constant("OVERRIDES"))

    @cached_property
    def included(self) -> list["LaunchFile"]:
        """The launch files that it includes."""
        names = [
            text(node)
            for node in ast.walk(self._tree)
            if isinstance(node, ast.Constant) and str(node.value).endswith(".launch.py")
        ]
        assert len(names) == len(self.calls("IncludeLaunchDescription"))
        return [launch_file(name) for name in names]

    @cached_property
    def arguments(self) -> set[str]:
        """The arguments that it takes: its own, and those of the files that it includes."""
        return set(self.declared).union(*(file.arguments for file in self.included))

    @cached_property
    def nodes(self) -> list[dict[str, ast.expr]]:
        """What each of its nodes is given, by keyword."""
        return [{str(k.arg): k.value for k in call.keywords} for call in self.calls("Node")]

    def dictionary_keys(self, node: ast.AST) -> Iterator[str]:
        """The names in dictionaries below a node."""
        for inner in ast.walk(node):
            if isinstance(inner, ast.Dict):
                yield from (text(key) for key in inner.keys if key is not None)


def text(node: ast.expr) -> str:
    return str(ast.literal_eval(node))


@cache
def launch_file(name: str) -> LaunchFile:
    assert name in FILES, f"{name} does not exist"
    return LaunchFile(name)


@cache
def parameters_of(executable: str) -> set[str]:
    if executable == SEVERAL_NODES:  # what is set for the process is set for all its nodes
        return parameters_of("sim_node") & parameters_of("controller_node")
    humanoid = load_character("humanoid")
    parameters = {
        "sim_node": for_simulator.PARAMETERS + for_simulator.character_parameters(humanoid),
        "controller_node": for_controller.PARAMETERS,
        "recorder": for_recorder.PARAMETERS,
    }
    return {parameter.name for parameter in parameters[executable]}


@cache
def executables() -> set[str]:
    """The executables that setup.py installs."""
    setup = (PROJECT / "setup.py").read_text(encoding="utf-8")
    return set(re.findall(r'"(\w+) = [\w.]+:main"', setup))


def package_xml() -> ElementTree.Element:
    return ElementTree.fromstring((PROJECT / "package.xml").read_bytes())


def test_there_is_a_launch_file_for_each_set_of_nodes() -> None:
    started = {
        name: [text(node["executable"]) for node in launch_file(name).nodes] for name in FILES
    }

    assert started == {  # beside what they include
        "composed.launch.py": ["composed"],
        "everything.launch.py": ["recorder"],
        "simulator.launch.py": ["sim_node"],
        "simulator_controller.launch.py": ["controller_node"],
        "two_humanoids.launch.py": ["sim_node", "controller_node"],
    }
    assert launch_file("everything.launch.py").included == [
        launch_file("simulator_controller.launch.py")
    ]
    assert launch_file("simulator_controller.launch.py").included == [
        launch_file("simulator.launch.py")
    ]


def test_what_launch_files_import_is_a_dependency() -> None:
    declared = {element.text for element in package_xml().iter("exec_depend")}

    assert set.union(*(launch_file(name).imported for name in FILES)) <= declared


@pytest.mark.parametrize("name", FILES)
def test_every_node_is_an_executable_of_this_package_under_its_own_name(name: str) -> None:
    file = launch_file(name)

    assert file.constant("PACKAGE") == package_xml().findtext("name") == PACKAGE
    for node in file.nodes:
        assert ast.unparse(node["package"]) == "PACKAGE"
        assert text(node["executable"]) in executables()
        if text(node["executable"]) == SEVERAL_NODES:
            assert "name" not in node  # all nodes of the process would have it
        else:
            assert text(node["name"]) == text(node["executable"])


@pytest.mark.parametrize("name", FILES)
def test_all_nodes_end_when_one_ends(name: str) -> None:
    for node in launch_file(name).nodes:
        assert ast.unparse(node["on_exit"]).startswith("Shutdown(")


@pytest.mark.parametrize("name", FILES)
def test_every_argument_has_a_description_and_a_default(name: str) -> None:
    for declaration in launch_file(name).declared.values():
        assert declaration["description"]
        assert isinstance(declaration["default_value"], str)


@pytest.mark.parametrize("name", FILES)
def test_every_argument_that_is_used_is_declared_and_none_is_for_nothing(name: str) -> None:
    file = launch_file(name)

    assert file.used <= file.arguments
    assert set(file.declared) <= file.used


def test_the_arguments_are_there_that_a_user_looks_for() -> None:
    expected = {"config", "character", "reference", "clip", "namespace", "max_ticks", "directory"}

    assert launch_file("everything.launch.py").arguments >= expected


@pytest.mark.parametrize("name", FILES)
def test_every_parameter_that_is_set_exists(name: str) -> None:
    file = launch_file(name)

    for node in file.nodes:
        known = parameters_of(text(node["executable"]))
        assert set(file.constant("OVERRIDES")) <= known
        assert set(file.dictionary_keys(node.get("parameters", ast.Tuple()))) <= known


@pytest.mark.parametrize("name", FILES)
def test_what_is_handed_to_an_included_file_is_an_argument_of_it(name: str) -> None:
    file = launch_file(name)

    for call, included in zip(file.calls("IncludeLaunchDescription"), file.included, strict=True):
        assert set(file.dictionary_keys(call)) <= included.arguments


@pytest.mark.parametrize("name", FILES)
def test_the_parameter_file_ships(name: str) -> None:
    for argument, declaration in launch_file(name).declared.items():
        if argument == "config":
            assert (PROJECT / "config" / declaration["default_value"]).is_file()


def test_controllers_stand_in_the_namespaces_of_the_two_characters() -> None:
    file = launch_file("two_humanoids.launch.py")
    config = yaml.safe_load(
        (PROJECT / "config" / file.declared["config"]["default_value"]).read_text()
    )

    characters = config["/**/sim_node"]["ros__parameters"]["characters"]

    assert list(file.constant("CHARACTERS")) == characters
