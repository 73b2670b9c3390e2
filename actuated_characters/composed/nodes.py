"""The nodes of the executable `composed`: a simulator, and a controller for each character."""

from typing import Any

from rclpy.parameter import Parameter

from controller_node.node import ControllerNode
from msgs_config.bus.composition import (
    ComposableNode,
    Composition,
    destroy_nodes,
    errors_of,
    ros_node,
)
from msgs_config.errors import ActuatedCharactersError, ConfigurationError
from msgs_config.messages import topics
from msgs_config.messages.session import SESSION
from sim_node.node import SimNode


def compose() -> Composition:
    """Make the simulator, and a controller in the namespace of each of its characters.

    Raises:
        ActuatedCharactersError: a node cannot be made with its parameters; names the node. Or two
            nodes have been given one name.
    """
    nodes: list[ComposableNode] = []
    try:
        with errors_of(topics.SIM_NODE):
            simulator = SimNode()
        nodes.append(simulator)
        for character in simulator.characters:
            with errors_of(f"{character}/{topics.CONTROLLER_NODE}".lstrip("/")):
                nodes.append(_make_controller(simulator, character))
        _check_names(nodes)
    except ActuatedCharactersError:
        destroy_nodes(nodes)
        raise
    return Composition(nodes)


def _make_controller(simulator: SimNode, character: str) -> ControllerNode:
    """A controller in a character's namespace, below that of the simulator, and for it alone."""
    options: dict[str, Any] = {
        "parameter_overrides": [Parameter(SESSION.name, value=simulator.session)]
    }
    if not character:
        return ControllerNode(ros_node(topics.CONTROLLER_NODE, **options))
    # a node's own rule precedes a `__ns` for the whole process, which precedes `namespace`
    namespace = f"{simulator.node.get_namespace().rstrip('/')}/{character}"
    arguments = ["--ros-args", "-r", f"__ns:={namespace}"]
    return ControllerNode(ros_node(topics.CONTROLLER_NODE, cli_args=arguments, **options))


def _check_names(nodes: list[ComposableNode]) -> None:
    """Raise ConfigurationError if a rule for the whole process has given nodes one name."""
    names = [each.node.get_fully_qualified_name() for each in nodes]
    for name in names:
        if names.count(name) > 1:
            raise ConfigurationError(
                f"two nodes of this process are called '{name}'; rename one of them alone, as in "
                f"-r {topics.SIM_NODE}:__node:=NAME"
            )
