"""What varies in a sweep, and the rows that follow from it."""

import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

Cell: TypeAlias = bool | int | float | str | None
"""An entry of a table; None is an empty one."""

PLACE = re.compile(r"\{([A-Za-z_]\w*)\}")
"""A place in a text that a value of that name takes."""


@dataclass(frozen=True)
class Choice:
    """One of the things that are chosen together for a row."""

    arguments: tuple[str, ...] = ()  # of the command `run`; may have places for values
    cells: Mapping[str, Cell] = field(default_factory=dict)  # by column
    values: Mapping[str, Cell] = field(default_factory=dict)  # for the places of their names


Axis: TypeAlias = Sequence[Choice]
"""What is chosen from independently of all else."""


@dataclass(frozen=True)
class Row:
    """A run of a sweep: what the command `run` is told, and what the table says of it."""

    number: int  # from 1 on
    arguments: tuple[str, ...]
    cells: Mapping[str, Cell]


def expand(axes: Sequence[Axis]) -> Iterator[Row]:
    """All rows, a choice of each axis in each; the last axis varies fastest."""
    for number, chosen in enumerate(itertools.product(*axes), start=1):
        values = {name: each for choice in chosen for name, each in choice.values.items()}
        arguments = (text for choice in chosen for text in choice.arguments)
        cells = {name: cell for choice in chosen for name, cell in choice.cells.items()}
        yield Row(number, tuple(_filled(text, values) for text in arguments), cells)


def count_rows(axes: Sequence[Axis]) -> int:
    """How many rows there are."""
    return math.prod(len(axis) for axis in axes)


def rows_to_check(axes: Sequence[Axis], rows: Sequence[Row], most: int) -> list[Row]:
    """Rows, at most so many, that have each choice of each axis at least once, as far as it goes.

    A mistake is mostly in one choice, not in how two of them go together.
    """
    strides = [math.prod(len(axis) for axis in axes[place + 1 :]) for place in range(len(axes))]
    longest = max((len(axis) for axis in axes), default=1)
    indices = (
        sum(stride * (turn % len(axis)) for axis, stride in zip(axes, strides, strict=True))
        for turn in range(min(longest, most))
    )
    return [rows[index] for index in indices]


def parameter_name(column: str) -> str:
    """A column's name as people read it: a parameter's without its node."""
    return column.partition(".")[2] or column


def cell_text(cell: Cell) -> str:
    """An entry as a text that reads back to the same bits."""
    if cell is None:
        return ""
    if isinstance(cell, bool):
        return str(cell).lower()
    return repr(cell) if isinstance(cell, float) else str(cell)


def _filled(text: str, values: Mapping[str, Cell]) -> str:
    return PLACE.sub(lambda place: cell_text(values[place[1]]), text) if values else text
