"""Parameters declared with type, unit, bounds and description, and resolved without ROS.

A node, the run of both nodes in one process and the check of a command line all resolve the same
specifications by the same function, so that a value is right or wrong in the same way everywhere.
"""

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from msgs_config.errors import ConfigurationError, one_of
from msgs_config.mappings import show_value
from msgs_config.plain_values import as_plain

Scalar: TypeAlias = bool | int | float | str
Value: TypeAlias = Scalar | list[str] | list[float]

MAX_NUMBER = 1e12
_LARGEST_FLOAT = sys.float_info.max


@dataclass(frozen=True)
class Parameter:
    """One parameter of a node; the type of its default is its type."""

    name: str
    default: Value
    description: str
    unit: str = ""
    minimum: float = 0.0
    maximum: float = MAX_NUMBER
    choices: tuple[str, ...] = ()
    texts: bool = False  # an empty list as the default is one of texts, not of numbers
    live: bool = False  # may be changed while the node runs
    at_reset: bool = False  # may be changed while the node runs, and counts from the next episode

    @property
    def when_changed(self) -> str:
        """When a change counts: "live", "next reset", or empty for what cannot change."""
        return "live" if self.live else "next reset" if self.at_reset else ""

    def checked(self, value: object) -> Value:
        """The value in the parameter's type; an integer is a fine float, an array a list.

        Raises:
            ConfigurationError: wrong type, out of bounds, or none of the choices.
        """
        value = as_plain(value)
        if isinstance(self.default, list):
            return self._checked_list(value, self.default)
        return self._checked_scalar(value, self.default)

    def _checked_list(self, value: object, default: list[str] | list[float]) -> Value:
        if not isinstance(value, list):
            raise self._wrong(value, "a list")
        if self.texts or (default and isinstance(default[0], str)):
            return [str(self._checked_scalar(item, "")) for item in value]
        return [float(self._checked_scalar(item, 0.0)) for item in value]

    def _checked_scalar(self, value: object, like: Scalar) -> Scalar:
        if isinstance(like, float) and type(value) is int and abs(value) <= _LARGEST_FLOAT:
            value = float(value)
        if type(value) is not type(like):
            raise self._wrong(value, _TYPE_NAMES[type(like)])
        if self.choices and value not in self.choices:
            raise ConfigurationError(
                one_of(f"value of parameter '{self.name}':", value, list(self.choices))
            )
        assert isinstance(value, (bool, int, float, str))
        if isinstance(value, (bool, str)):
            return value
        if not self.minimum <= value <= self.maximum:  # NaN is not within
            unit = f" {self.unit}" if self.unit else ""
            raise self._wrong(value, f"{self.minimum:g} to {self.maximum:g}{unit}")
        return value

    def _wrong(self, value: object, right: str) -> ConfigurationError:
        return ConfigurationError(
            f"parameter '{self.name}' is {show_value(value)}; it must be {right}"
        )


class Values(dict[str, Value]):
    """The checked values of a node's parameters by name; `Settings` take them out, typed."""

    def number(self, name: str) -> float:
        """The value of a floating-point parameter whose name depends on the character."""
        value = self[name]
        assert isinstance(value, float)
        return value


_TYPE_NAMES: dict[type, str] = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a text",
}


def resolve(parameters: Iterable[Parameter], given: Mapping[str, object]) -> Values:
    """The value of every parameter: the one given, checked, or else its default.

    Raises:
        ConfigurationError: a value is wrong, or a name is none of the parameters'.
    """
    by_name = {parameter.name: parameter for parameter in parameters}
    for name in given:
        if name not in by_name and name not in _OF_EVERY_NODE:
            raise ConfigurationError(one_of("parameter", name, sorted(by_name)))
    return Values(
        {
            name: parameter.checked(given[name]) if name in given else parameter.default
            for name, parameter in by_name.items()
        }
    )


_OF_EVERY_NODE = ("use_sim_time", "start_type_description_service")
"""Parameters that rclpy itself declares for every node."""
