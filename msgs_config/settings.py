"""Settings: frozen dataclasses whose fields are parameters of a node, each declared once.

    class SteeringLimits(Settings, prefix="steering."):
        speed: float = parameter(2.5, "its largest speed ahead", unit="m/s", maximum=10.0)

`SteeringLimits.declared()` has the parameter `steering.speed`, `SteeringLimits.of(values).speed`
is its value in m/s.
"""

from collections.abc import Collection, Mapping
from dataclasses import Field, dataclass, field, fields, replace
from typing import Any, ClassVar, Self, TypeVar, dataclass_transform, get_origin

from msgs_config.parameters import MAX_NUMBER, Parameter, Value, resolve

_T = TypeVar("_T", bool, int, float, str, tuple[str, ...], tuple[float, ...])
_PARAMETER, _SHARED = "parameter", "shared"  # keys of a field's metadata


def parameter(
    default: _T,
    description: str,
    *,
    name: str = "",
    unit: str = "",
    minimum: float = 0.0,
    maximum: float = MAX_NUMBER,
    choices: Collection[str] = (),
    live: bool = False,
    at_reset: bool = False,
) -> _T:
    """A field of `Settings` that is a parameter; its annotation is the parameter's type.

    The name is the field's own below the class's prefix, unless a whole one is given. The rest is
    as in `Parameter`.
    """
    plain: Any = list(default) if isinstance(default, tuple) else default
    facts = (unit, minimum, maximum, tuple(choices))
    declared = Parameter(name, plain, description, *facts, live=live, at_reset=at_reset)
    return field(default=default, metadata={_PARAMETER: declared})


def shared(declared: Parameter) -> Any:
    """A field of `Settings` that reads a parameter, no list, which others declare."""
    return field(default=declared.default, metadata={_PARAMETER: declared, _SHARED: True})


@dataclass_transform(frozen_default=True)
@dataclass(frozen=True)
class Settings:
    """Values of a node's parameters, each a field. A subclass is a frozen dataclass by itself.

    A field may be other settings, whose parameters are among these. All fields have defaults.
    """

    _parameters: ClassVar[dict[str, Parameter]] = {}  # by the fields' names

    def __init_subclass__(cls, prefix: str = "") -> None:
        """`prefix` stands before the names of the fields in those of the parameters."""
        dataclass(frozen=True)(cls)
        declared = [each for each in fields(cls) if _PARAMETER in each.metadata]
        cls._parameters = {each.name: _parameter_of(each, prefix) for each in declared}

    @classmethod
    def declared(cls, **defaults: Value) -> list[Parameter]:
        """The parameters, in the order of the fields; some with other defaults, by the fields."""
        found = []
        for each in fields(cls):
            if isinstance(each.default, Settings):
                found += each.default.declared()
            elif each.name in cls._parameters and _SHARED not in each.metadata:
                parameter = cls._parameters[each.name]
                default = defaults.get(each.name, parameter.default)
                found.append(replace(parameter, default=default))
        return found

    @classmethod
    def of(cls, values: Mapping[str, Value], below: str = "") -> Self:
        """The settings among checked values of all parameters, whose names begin with `below`."""
        return cls().changed(values, below)

    @classmethod
    def given(cls, given: Mapping[str, object]) -> Self:
        """The settings that these values, unchecked, are all of: those given, or defaults.

        Raises:
            ConfigurationError: a value is wrong, or a name is none of the parameters'.
        """
        return cls.of(resolve(cls.declared(), given))

    def changed(self, values: Mapping[str, Value], below: str = "") -> Self:
        """The same with the parameters of checked values; what is no parameter stays."""
        now: dict[str, Any] = {}
        for name, before in vars(self).items():
            if isinstance(before, Settings):
                now[name] = before.changed(values, below)
            elif name in self._parameters:
                value = values[below + self._parameters[name].name]
                now[name] = tuple(value) if isinstance(value, list) else value
        return replace(self, **now)


def _parameter_of(declared: "Field[Any]", prefix: str) -> Parameter:
    """The parameter of a field, whose default must have the field's type."""
    kind, parameter = declared.type, declared.metadata[_PARAMETER]
    assert type(declared.default) is (get_origin(kind) or kind), declared.name
    name = parameter.name or prefix + declared.name
    complete: Parameter = replace(parameter, name=name, texts=kind == tuple[str, ...])
    return complete
