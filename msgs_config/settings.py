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
    """A field of `Settings` that reads a parameter which others declare."""
    value = declared.default
    default = tuple(value) if isinstance(value, list) else value
    return field(default=default, metadata={_PARAMETER: declared, _SHARED: True})


@dataclass_transform(frozen_default=True)
@dataclass(frozen=True)
class Settings:
    """Values of a node's parameters, each a field. A subclass is a frozen dataclass by itself.

    A field may be other settings, whose parameters are among these. All fields have defaults.
    """

    _prefix: ClassVar[str] = ""

    def __init_subclass__(cls, prefix: str = "") -> None:
        """`prefix` stands before the names of the fields in those of the parameters."""
        cls._prefix = prefix
        dataclass(frozen=True)(cls)

    @classmethod
    def declared(cls, **defaults: Value) -> list[Parameter]:
        """The parameters, in the order of the fields; some with other defaults, by the fields."""
        found = []
        for each in fields(cls):
            if isinstance(each.default, Settings):
                found += each.default.declared()
            elif _PARAMETER in each.metadata and _SHARED not in each.metadata:
                declared = cls._parameter(each)
                default = defaults.get(each.name, declared.default)
                found.append(replace(declared, default=default))
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
        read: dict[str, Any] = {}
        for each in fields(self):
            before = getattr(self, each.name)
            if isinstance(before, Settings):
                read[each.name] = before.changed(values, below)
            elif _PARAMETER in each.metadata:
                value = values[below + self._parameter(each).name]
                read[each.name] = tuple(value) if isinstance(value, list) else value
        return replace(self, **read)

    @classmethod
    def _parameter(cls, of: "Field[Any]") -> Parameter:
        """The parameter of a field."""
        assert type(of.default) is (get_origin(of.type) or of.type), of.name
        declared: Parameter = of.metadata[_PARAMETER]
        name = declared.name or cls._prefix + of.name
        return replace(declared, name=name, texts=of.type == tuple[str, ...])
