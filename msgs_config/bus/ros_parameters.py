"""Parameters at the edge: taken from a node's command line, and declared on it."""

from array import array
from collections.abc import Iterable, Mapping
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
)
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from msgs_config.parameters import Parameter, Values


def given_parameters(node: Node) -> dict[str, object]:
    """The values that command line and parameter files set for this node.

    rclpy has no public list of them, and silently ignores names that are not declared; a user's
    misspelt parameter must not pass unseen.
    """
    overrides = node._parameter_overrides
    return {name: plain_value(parameter) for name, parameter in overrides.items()}


def set_request(values: Mapping[str, Any]) -> SetParametersAtomically.Request:
    """The request that sets parameters of a node, all or none."""
    parameters = [RosParameter(n, value=value).to_parameter_msg() for n, value in values.items()]
    return SetParametersAtomically.Request(parameters=parameters)


def declare(node: Node, parameters: Iterable[Parameter], values: Values) -> None:
    """Declare each parameter on the node with its resolved value."""
    for parameter in parameters:
        node.declare_parameter(
            parameter.name, values[parameter.name], _descriptor(parameter), ignore_override=True
        )


def plain_value(parameter: RosParameter) -> Any:
    """The value; a message brings lists of numbers as arrays, and an empty one without a type."""
    if parameter.type_ is RosParameter.Type.NOT_SET:
        return []
    return list(parameter.value) if isinstance(parameter.value, array) else parameter.value


def _descriptor(parameter: Parameter) -> ParameterDescriptor:
    unit = f" [{parameter.unit}]" if parameter.unit else ""
    descriptor = ParameterDescriptor(
        name=parameter.name,
        description=parameter.description + unit,
        additional_constraints=" | ".join(parameter.choices),
        read_only=not parameter.when_changed,
        # an empty list has no type of its own, and may become one of texts
        dynamic_typing=isinstance(parameter.default, list),
    )
    bounds = {"from_value": parameter.minimum, "to_value": parameter.maximum}
    if type(parameter.default) is float and abs(parameter.maximum) != float("inf"):
        descriptor.floating_point_range = [FloatingPointRange(**bounds, step=0.0)]
    if type(parameter.default) is int:
        whole = {name: int(value) for name, value in bounds.items()}
        descriptor.integer_range = [IntegerRange(**whole, step=1)]
    return descriptor
