"""Parameters at the edge: taken from a node's command line, and declared on it."""

from collections.abc import Iterable

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from msgs_config.parameters import Parameter, Values


def given_parameters(node: Node) -> dict[str, object]:
    """What the command line and parameter files set for this node.

    rclpy has no public list of them, and silently ignores names that nobody declares; a user's
    misspelt parameter must not pass unseen.
    """
    overrides = node._parameter_overrides
    empty = RosParameter.Type.NOT_SET  # what an empty list arrives as
    return {name: [] if p.type_ is empty else p.value for name, p in overrides.items()}


def declare(node: Node, parameters: Iterable[Parameter], values: Values) -> None:
    """Declare each parameter on the node with its resolved value."""
    for parameter in parameters:
        node.declare_parameter(
            parameter.name, values[parameter.name], _descriptor(parameter), ignore_override=True
        )


def _descriptor(parameter: Parameter) -> ParameterDescriptor:
    unit = f" [{parameter.unit}]" if parameter.unit else ""
    descriptor = ParameterDescriptor(
        name=parameter.name,
        description=parameter.description + unit,
        additional_constraints=" | ".join(parameter.choices),
        read_only=not parameter.live,
    )
    bounds = {"from_value": parameter.minimum, "to_value": parameter.maximum}
    if type(parameter.default) is float and abs(parameter.maximum) != float("inf"):
        descriptor.floating_point_range = [FloatingPointRange(**bounds, step=0.0)]
    if type(parameter.default) is int:
        whole = {name: int(value) for name, value in bounds.items()}
        descriptor.integer_range = [IntegerRange(**whole, step=1)]
    return descriptor
