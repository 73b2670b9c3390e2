"""Random values that depend on seed, name and number alone, whatever else is drawn before."""

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass

from msgs_config.errors import ConfigurationError
from msgs_config.mappings import MappingReader
from msgs_config.random_words import random_words

_STEP = 2.0**-53
_MOST_ATTEMPTS = 1000  # of a normal number to lie within its bounds
_LARGEST_WHOLE = 2**53
KINDS = ("uniform", "log", "normal", "integer")


@dataclass(frozen=True)
class Draw:
    """Where random values come from."""

    kind: str  # of KINDS
    first: float  # the least value; of `normal` the mean
    second: float  # the largest value; of `normal` the standard deviation
    bounds: tuple[float, float] = (-math.inf, math.inf)  # of `normal`

    def value(self, seed: int, name: str, number: int) -> float | int:
        """The value of a name in a draw of a number.

        Raises:
            ConfigurationError: a normal number hardly ever lies within its bounds.
        """
        if self.kind == "normal":
            return self._normal(seed, name, number)
        (word, _) = next(_words(seed, name, number))
        if self.kind == "integer":
            count = int(self.second) - int(self.first) + 1
            return int(self.first) + (word * count >> 53)
        share = word * _STEP
        if self.kind == "uniform":
            return self.first + share * (self.second - self.first)
        low, high = math.log(self.first), math.log(self.second)
        # the sum's last bit may lie beyond the bounds
        return min(max(math.exp(low + share * (high - low)), self.first), self.second)

    def _normal(self, seed: int, name: str, number: int) -> float:
        """A normal number, drawn again until it lies within the bounds.

        Source: Box and Muller 1958, "A Note on the Generation of Random Normal Deviates".
        """
        for a, b in _words(seed, name, number):
            radius = math.sqrt(-2.0 * math.log((a + 1.0) * _STEP))
            drawn = self.first + self.second * radius * math.cos(2.0 * math.pi * _STEP * b)
            if self.bounds[0] <= drawn <= self.bounds[1]:
                return drawn
        raise ConfigurationError(
            f"random.{name}: of {_MOST_ATTEMPTS} normal numbers none lies within its bounds; "
            "they must hold more of them"
        )


def read_draw(reader: MappingReader) -> Draw:
    """What a mapping such as `{uniform: [0.4, 1.0]}` says.

    Raises:
        ConfigurationError: it says nothing, or too much, or its numbers are no bounds.
    """
    reader.check_keys((*KINDS, "bounds"))
    kinds = [kind for kind in KINDS if kind in reader.content]
    if len(kinds) != 1:
        key = reader.prefix.removesuffix(".")
        raise ConfigurationError(
            f"{reader.place}: {key} must have one of {', '.join(KINDS)}, such as "
            "{uniform: [0.4, 1.0]}"
        )
    (kind,) = kinds
    first, second = reader.numbers(kind, 2)
    given = reader.content[kind]
    if kind == "normal":
        if second < 0.0:
            raise reader.wrong(kind, given, "[MEAN, DEVIATION], the second at least 0")
        return Draw(kind, first, second, _bounds(reader))
    if "bounds" in reader.content:
        raise reader.wrong("bounds", reader.content["bounds"], "left out: they are of normal alone")
    if kind == "integer" and not all(
        isinstance(each, int) and abs(each) <= _LARGEST_WHOLE for each in given
    ):
        raise reader.wrong(kind, given, "[LEAST, LARGEST], two whole numbers up to 2^53")
    if first > second or (kind == "log" and first <= 0.0):
        positive = ", both above 0" if kind == "log" else ""
        raise reader.wrong(
            kind, given, f"[LEAST, LARGEST], the first not above the second{positive}"
        )
    return Draw(kind, first, second)


def is_chosen(seed: int, number: int, share: float) -> bool:
    """Whether a row of a number is among a share of all; a larger share has those of a less."""
    return _words_of(seed, "verify", number, 0)[0] * _STEP < share


def _bounds(reader: MappingReader) -> tuple[float, float]:
    if "bounds" not in reader.content:
        return (-math.inf, math.inf)
    least, largest = reader.numbers("bounds", 2)
    if least > largest:
        raise reader.wrong("bounds", reader.content["bounds"], "[LEAST, LARGEST]")
    return (least, largest)


def _words(seed: int, name: str, number: int) -> Iterator[tuple[int, int]]:
    return (_words_of(seed, name, number, attempt) for attempt in range(_MOST_ATTEMPTS))


def _words_of(seed: int, name: str, number: int, attempt: int) -> tuple[int, int]:
    """Two whole numbers from 0 to 2^53 - 1."""
    key = (seed, int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little"))
    a, b = (word >> 11 for word in random_words(key, (0, 0, number, attempt), 2).tolist())
    return a, b
