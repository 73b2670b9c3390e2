"""Where runs begin to fail on the way from one value to another, and which values are tried.

Physics is not monotone: what fells a walk at 40 N s may let it stand at 45. So a few values are
tried all along the way, and bisection goes on between the first of them that fails and its
neighbour before. What stands beyond that is a hole.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

Value: TypeAlias = float | int
Tried: TypeAlias = Mapping[Value, bool]
"""Whether a run failed, by the value that it was tried with."""


@dataclass(frozen=True)
class Way:
    """The values that are searched, from where runs hold to where they fail."""

    first: Value
    last: Value  # above the first or below it
    within: Value  # how near to the boundary the search comes
    steps: int = 8  # even ones, along which all values are tried
    whole: bool = False  # whether there are whole numbers alone


@dataclass(frozen=True)
class Boundary:
    """Where runs begin to fail."""

    holds: Value | None  # the last value up to which all that were tried hold; None: not one
    fails: Value | None  # the next one that was tried, which fails; None: all hold
    holes: tuple[Value, ...]  # beyond, those that hold all the same


def values_to_try(way: Way, tried: Tried) -> list[Value]:
    """The values that are to be tried next; none when the boundary is near enough."""
    missing = [value for value in _even(way) if value not in tried]
    if missing:
        return missing
    boundary = find_boundary(way, tried)
    if boundary.holds is None or boundary.fails is None:
        return []
    if abs(boundary.fails - boundary.holds) <= way.within:
        return []
    middle = _between(boundary.holds, boundary.fails, way.whole)
    return [] if middle in tried else [middle]  # there may be no number between


def find_boundary(way: Way, tried: Tried) -> Boundary:
    """The boundary, as far as it is known by what was tried."""
    values = sorted(tried, reverse=way.last < way.first)
    count = next((place for place, value in enumerate(values) if tried[value]), len(values))
    return Boundary(
        values[count - 1] if count else None,
        values[count] if count < len(values) else None,
        tuple(value for value in values[count:] if not tried[value]),
    )


def most_tries(way: Way) -> int:
    """How many values are tried at most."""
    tries, step = len(_even(way)), abs(way.last - way.first) / way.steps
    while step > way.within:
        tries, step = tries + 1, step / 2.0
    return tries


def _even(way: Way) -> list[Value]:
    """The values all along the way, with both ends."""
    shares = [step / way.steps for step in range(way.steps)]
    values = [way.first + share * (way.last - way.first) for share in shares]
    if way.whole:
        return list(dict.fromkeys([*map(round, values), way.last]))
    return [*dict.fromkeys(map(_short, values)), way.last]


def _between(a: Value, b: Value, whole: bool) -> Value:
    return (int(a) + int(b)) // 2 if whole else _short(0.5 * (a + b))


def _short(value: float) -> float:
    """A number without the tail of digits that sums leave."""
    return float(f"{value:.12g}")
