"""Parameters at the edge: taken from a node's command line, and declared on it."""

from array import array
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from msgs_config.errors import ActuatedCharactersError
from msgs_config.parameters import Parameter, Values, resolve


def given_parameters(node: Node) -> dict[str, object]:
    """The values that command line and parameter files set for this node.

    rclpy has no public list of them, and silently ignores names that are not declared; a user's
    misspelt parameter must not pass unseen.
    """
    overrides = node._parameter_overrides
    return {name: _value(parameter) for name, parameter in overrides.items()}


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


class LiveParameters:
    """Changes of a node's parameters while it runs: checked before any is taken, all or none."""

    def __init__(
        self,
        node: Node,
        parameters: Iterable[Parameter],
        values: Values,
        take: Callable[[Values], None],
        check: Callable[[Values], object] = lambda values: None,
    ) -> None:
        """Hand all values, the changed ones among them, to `take` after each change.

        `check` may refuse them before, by an ActuatedCharactersError.
        """
        self._node = node
        self._check_values = check
        self._parameters = list(parameters)
        self._values = values
        self._take = take
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._changed)

    def declare(self, parameters: Iterable[Parameter], values: Values) -> None:
        """Declare parameters whose values were not known before."""
        late = list(parameters)
        self._values = Values(self._values | {each.name: values[each.name] for each in late})
        declare(self._node, late, values)

    def _check(self, changes: list[RosParameter]) -> SetParametersResult:
        try:
            self._check_values(self._with(changes))
        except ActuatedCharactersError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _changed(self, changes: list[RosParameter]) -> None:
        self._values = self._with(changes)
        self._take(self._values)

    def _with(self, changes: list[RosParameter]) -> Values:
        given = {change.name: _value(change) for change in changes}
        return resolve(self._parameters, {**self._values, **given})


def _value(parameter: RosParameter) -> Any:
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
