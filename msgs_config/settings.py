"""Settings: frozen dataclasses whose fields are parameters of a node, each declared once.

    @dataclass(frozen=True)
    class SteeringLimits(Settings, prefix="steering."):
        speed: float = parameter(2.5, "its largest speed ahead", unit="m/s", maximum=10.0)

`SteeringLimits.declared()` has the parameter `steering.speed`, `SteeringLimits.of(values).speed`
is its value in m/s.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, Self, TypeVar, get_origin

from msgs_config.parameters import MAX_NUMBER, Parameter, Value, resolve

_T = TypeVar("_T", bool, int, float, str, tuple[str, ...], tuple[float, ...])
_PARAMETER = "parameter"  # the key of a field's parameter among its metadata


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
    declared = Parameter(
        name,
        plain,
        description,
        unit=unit,
        minimum=minimum,
        maximum=maximum,
        choices=tuple(choices),
        live=live,
        at_reset=at_reset,
    )
    return field(default=default, metadata={_PARAMETER: declared})


def shared(declared: Parameter) -> Any:
    """A field of `Settings` that is a parameter which others declare, too."""
    value = declared.default
    default = tuple(value) if isinstance(value, list) else value
    return field(default=default, metadata={_PARAMETER: declared})


@dataclass(frozen=True)
class Settings:
    """Values of a node's parameters, each a field. A subclass is a frozen dataclass, too.

    Fields that are no parameters need a default.
    """

    _prefix: ClassVar[str] = ""

    def __init_subclass__(cls, prefix: str = "") -> None:
        """`prefix` stands before the names of the fields in those of the parameters."""
        cls._prefix = prefix

    @classmethod
    def declared(cls, **defaults: Value) -> list[Parameter]:
        """The parameters, in the order of the fields; some with other defaults, by the fields."""
        return [
            replace(each, default=defaults.get(name, each.default))
            for name, each in _parameters(cls).items()
        ]

    @classmethod
    def of(cls, values: Mapping[str, Value], below: str = "") -> Self:
        """The settings among checked values of all parameters, whose names begin with `below`."""
        return cls(**cls._read(values, below))

    @classmethod
    def given(cls, given: Mapping[str, object]) -> Self:
        """The settings that these values, unchecked, are all of: those given, or defaults.

        Raises:
            ConfigurationError: a value is wrong, or a name is none of the parameters'.
        """
        return cls.of(resolve(cls.declared(), given))

    def changed(self, values: Mapping[str, Value]) -> Self:
        """The same with the parameters as in checked values of all parameters."""
        return replace(self, **self._read(values))

    @classmethod
    def _read(cls, values: Mapping[str, Value], below: str = "") -> dict[str, Any]:
        """The values by the fields' names; lists are tuples."""
        read = {name: values[below + each.name] for name, each in _parameters(cls).items()}
        return {name: tuple(v) if isinstance(v, list) else v for name, v in read.items()}


def _parameters(kind: type[Settings]) -> dict[str, Parameter]:
    """The parameters by the fields' names."""
    found = {}
    for each in fields(kind):
        if _PARAMETER in each.metadata:
            declared: Parameter = each.metadata[_PARAMETER]
            assert type(each.default) is (get_origin(each.type) or each.type), each.name
            name = declared.name or kind._prefix + each.name
            texts = each.type == tuple[str, ...]
            found[each.name] = replace(declared, name=name, texts=texts)
    return found
