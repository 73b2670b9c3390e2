"""Python's own values for those that programs have: numpy's numbers and arrays, paths, tuples."""

import math
import os
from collections.abc import Mapping, Sequence
from numbers import Integral, Real

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.errors import ActuatedCharactersError, ConfigurationError
from msgs_config.mappings import show_value


def as_plain(value: object) -> object:
    """A value as Python's own bool, int, float, str or list; what is none of these stays.

    Takes all whole and real numbers, sequences of them, arrays and numbers of a library with
    numpy's `tolist`, and paths. A sequence's items are made plain, but not what is in those.
    """
    value = _plain_item(value)
    if isinstance(value, Sequence) and not isinstance(value, (str, bytes, bytearray)):
        return [_plain_item(item) for item in value]
    return value


def _plain_item(value: object) -> object:
    if hasattr(value, "tolist") and not isinstance(value, type):
        value = value.tolist()
    if isinstance(value, bool):
        return value
    if isinstance(value, str):
        return str.__str__(value)  # a plain text of a subclass, such as an Enum's
    if isinstance(value, os.PathLike):
        return os.fsdecode(value)
    if isinstance(value, Integral):
        return int(value)
    try:
        return float(value) if isinstance(value, Real) else value
    except OverflowError:  # a fraction beyond all floats
        return value


def plain_parameters(*mappings: Mapping[str, object]) -> dict[str, object]:
    """Parameters by name, their values made plain; later mappings take precedence.

    Raises:
        ConfigurationError: one is no mapping, or a name is no text.
    """
    parameters: dict[str, object] = {}
    for mapping in mappings:
        if not isinstance(mapping, Mapping):
            raise ConfigurationError(
                f"the parameters are {show_value(mapping)}; they must be a mapping, such as "
                "{'gravity': 3.71}"
            )
        for name, value in mapping.items():
            if not isinstance(name, str):
                raise ConfigurationError(f"a parameter's name is {name!r}; it must be a text")
            parameters[name] = as_plain(value)
    return parameters


def finite_numbers(
    what: str, value: object, count: int, error: type[ActuatedCharactersError]
) -> FloatArray:
    """So many finite numbers (count,) of any sequence.

    Raises:
        error: they are not; it says so of `what`.
    """
    items = as_plain(value)
    if isinstance(items, list) and len(items) == count and all(map(_is_finite, items)):
        return np.array(items, dtype=float)
    shown = repr(items)[:200] if isinstance(items, list) and len(items) < 10 else show_value(items)
    raise error(f"{what} is {shown}; it must be {count} finite number{'s' * (count != 1)}")


def _is_finite(value: object) -> bool:
    try:
        return type(value) in (int, float) and math.isfinite(value)  # type: ignore[arg-type]
    except OverflowError:  # a whole number beyond all floats
        return False
