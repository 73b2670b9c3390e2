"""Commands and options that several commands have, and what `--set NODE.NAME:=VALUE` sets."""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from msgs_config import files
from msgs_config.errors import ConfigurationError, one_of

if TYPE_CHECKING:  # it takes a while to import
    from actuated_characters.bags.recording import Recording
    from actuated_characters.bags.robots.reading import RobotSource
    from msgs_config.character.model import Character
    from msgs_config.parameters import Parameter

Commands = argparse._SubParsersAction
NODES = ("sim_node", "controller_node")
CHARACTER = "humanoid"
_PUSH = "LINK:FX,FY,FZ@S"


def add_command(
    commands: "Commands[argparse.ArgumentParser]",
    function: Callable[[argparse.Namespace], object],
    name: str,
    about: str,
    description: str,
    examples: Sequence[str],
) -> argparse.ArgumentParser:
    """Add a command that a function runs; each example is a line without the program's name."""
    lines = "; ".join(f"actuated_characters {example}" for example in examples)
    epilog = f"example{'s' * (len(examples) > 1)}: {lines}" if examples else None
    command = commands.add_parser(name, help=about, description=description, epilog=epilog)
    command.set_defaults(command=function)
    return command


def add_bag(command: argparse.ArgumentParser) -> None:
    """Add the positional argument that names a recording."""
    command.add_argument("bag", type=Path, metavar="BAG", help="a run's directory, or a bag")


def add_robot(command: argparse._ActionsContainer, of_run: str) -> None:
    """Add the options that say whose a bag of any robot is; `of_run` is said of runs."""
    command.add_argument(
        "--character",
        metavar="NAME",
        help=f"{of_run}; of a bag of any other ROS 2 robot: its .urdf or .yaml file, or a shipped "
        "character's name (what is on robot_description)",
    )
    command.add_argument(
        "--topic",
        metavar="TOPIC",
        help="of a bag of any robot: its sensor_msgs/JointState (/joint_states, or the only one)",
    )
    command.add_argument(
        "--base",
        metavar="TOPIC",
        help="of a bag of any robot: where its base is, tf, an odometry or poses; none: at rest "
        "(what there is, in this order)",
    )


def robot_source(options: argparse.Namespace) -> "RobotSource":
    """What the options of `add_robot` say."""
    from actuated_characters.bags.robots.reading import RobotSource

    return RobotSource(options.character, options.topic, options.base)


def print_remarks(recordings: "Sequence[Recording]") -> None:
    """Print what a bag of a robot lacks, and what was taken from it, to the standard error."""
    for recording in recordings:
        for remark in getattr(recording, "remarks", ()):
            print(f"note: {remark}", file=sys.stderr)


def add_character(
    command: argparse.ArgumentParser, default: str | None = CHARACTER, about: str = CHARACTER
) -> None:
    """Add the option that names a character; `about` says which one it is without it."""
    command.add_argument(
        "--character",
        default=default,
        metavar="NAME",
        help=f"name, or path of a .yaml, .urdf, .xacro or .xml file ({about})",
    )


def add_repeated(command: argparse._ActionsContainer, name: str, metavar: str, about: str) -> None:
    """Add an option whose values are a list, empty by default."""
    about = f"{about}; may be repeated"
    command.add_argument(name, action="append", default=[], metavar=metavar, help=about)


def add_inputs(command: argparse._ActionsContainer, push: str, example: str = "") -> None:
    """Add `--push`, with what is to be said of it, and `--set`."""
    about = (
        "a force in N, world axes, on a link at a time in s, or an impulse in N s from a side, "
        f"'impulse=NS from=SIDE at=S target=LINK', {push}"
    )
    add_repeated(command, "--push", _PUSH, about)
    about = f"a parameter of sim_node or controller_node{example}"
    add_repeated(command, "--set", "NODE.NAME:=VALUE", about)


def node_settings(texts: Sequence[str], nodes: Sequence[str]) -> dict[str, dict[str, object]]:
    """The parameters that `--set NODE.NAME:=VALUE` sets, by node; values are YAML.

    Raises:
        ConfigurationError: a text is not of that form, its node is none of these, or its value is
            no YAML.
    """
    node_name = nodes[0] if len(nodes) == 1 else "NODE"
    settings: dict[str, dict[str, object]] = {node: {} for node in nodes}
    for text in texts:
        name, assigns, value = text.partition(":=")
        node, dot, parameter = name.partition(".")
        if not (assigns and dot and parameter):
            raise ConfigurationError(f"--set {text}: write it as {node_name}.NAME:=VALUE")
        if node not in settings:
            raise ConfigurationError(f"--set {text}: {one_of('node', node, list(nodes))}")
        settings[node][parameter] = files.parse_yaml(f"--set {text}", value, ConfigurationError)
    return settings


def parameters_of(node: str, character: "Character") -> "list[Parameter]":
    """The parameters of a node by its name; `recorder` has the same for all characters."""
    from actuated_characters.recorder import parameters as recorder
    from controller_node import parameters as controller
    from sim_node import parameters as simulator

    if node == "recorder":
        return recorder.PARAMETERS
    if node == "sim_node":
        own = simulator.character_parameters(character)
        return [simulator.CHARACTERS, *simulator.PARAMETERS, *own]
    return controller.PARAMETERS + controller.character_parameters(character)
