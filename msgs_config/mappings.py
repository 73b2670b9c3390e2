"""Typed values out of a mapping that a user has written, with errors that name place and key."""

import sys
from collections.abc import Iterable
from typing import Any

from msgs_config.errors import ActuatedCharactersError, one_of

LARGEST = sys.float_info.max
_MAX_SHOWN = 200  # characters


class MappingReader:
    """Takes checked values out of a mapping, such as the content of a YAML or JSON file.

    Every error is one line: the place, the key with those that lead to it, the value, and what
    would be right.
    """

    def __init__(
        self,
        place: object,
        content: dict[str, Any],
        error: type[ActuatedCharactersError],
        prefix: str = "",
    ) -> None:
        """Read a mapping.

        Args:
            place: Where it comes from, such as a file's path: an error begins with it.
            content: The mapping.
            error: The class of the errors.
            prefix: The keys that lead to the mapping, such as `joints.chest.`.
        """
        self.content = content
        self.place = place
        self._error = error
        self.prefix = prefix

    def wrong(self, key: str, value: object, right: str) -> ActuatedCharactersError:
        """The error for a value; `right` is what it must be."""
        name = f"{self.prefix}{key}"[:_MAX_SHOWN]
        return self._error(f"{self.place}: {name} is {show_value(value)}; it must be {right}")

    def check_keys(self, known: Iterable[str]) -> None:
        """Raise the error if there is a key that is not known."""
        for key in self.content:
            if key not in known:
                sentence = one_of("key", key, list(known), self.prefix)
                raise self._error(f"{self.place}: {sentence}")

    def part(self, key: str) -> "MappingReader":
        """The mapping under a key; one that is absent is empty."""
        value = self.content.get(key)
        value = {} if value is None else value
        if not isinstance(value, dict) or not all(isinstance(name, str) for name in value):
            raise self.wrong(key, value, "a mapping")
        return MappingReader(self.place, value, self._error, f"{self.prefix}{key}.")

    def parts(self, key: str, known: Iterable[str]) -> dict[str, "MappingReader"]:
        """The mappings in the mapping under a key, each with no keys but those known."""
        part = self.part(key)
        parts = {name: part.part(name) for name in part.content}
        for each in parts.values():
            each.check_keys(known)
        return parts

    def text(self, key: str) -> str:
        """A text that is not empty."""
        value = self.content.get(key)
        if not isinstance(value, str) or not value:
            raise self.wrong(key, value, "a text")
        return value

    def choice(self, key: str, choices: list[str]) -> str:
        """One of some texts; the first one if the key is absent."""
        value = self.content.get(key, choices[0])
        if value not in choices:
            raise self.wrong(key, value, " or ".join(f"'{choice}'" for choice in choices))
        return str(value)

    def flag(self, key: str, default: bool = False) -> bool:
        """True or false."""
        value = self.content.get(key, default)
        if not isinstance(value, bool):
            raise self.wrong(key, value, "true or false")
        return value

    def number(
        self,
        key: str,
        default: float | None = None,
        minimum: float = -LARGEST,
        maximum: float = LARGEST,
    ) -> float:
        """A finite number; without a default it must be there."""
        value: Any = self.content.get(key, default)
        if _is_number(value, minimum, maximum):
            return float(value)
        raise self.wrong(key, value, f"a finite number{_say_bounds(minimum, maximum)}")

    def numbers(
        self,
        key: str,
        count: int,
        bounds: tuple[float, float] = (-LARGEST, LARGEST),
        default: list[float] | None = None,
    ) -> tuple[float, ...]:
        """A list of so many finite numbers within bounds; without a default it must be there."""
        value = self.content.get(key, default)
        items = value if isinstance(value, list) else []
        if len(items) == count and all(_is_number(item, *bounds) for item in items):
            return tuple(map(float, items))
        raise self.wrong(key, value, f"a list of {count} finite numbers{_say_bounds(*bounds)}")

    def names(self, key: str, what: str, default: list[str] | None = None) -> tuple[str, ...]:
        """A list of names; without a default it must be there."""
        value = self.content.get(key, default)
        if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
            raise self.wrong(key, value, f"a list of {what}")
        return tuple(value)


def show_value(value: object) -> str:
    """A value as an error shows it: a few lines of YAML can stand for millions of entries."""
    if isinstance(value, (list, dict)):
        return f"a {type(value).__name__}"
    if isinstance(value, int) and abs(value) > LARGEST:
        return "a number of too many digits"
    return repr(value)[:_MAX_SHOWN]


def _say_bounds(least: float, most: float) -> str:
    if most != LARGEST:
        return f" from {least:g} to {most:g}"
    return "" if least == -LARGEST else f" of at least {least:g}"


def _is_number(value: object, least: float, most: float) -> bool:
    # compared, not converted: a whole number may be larger than every float
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_number and least <= value <= most  # type: ignore[operator]
