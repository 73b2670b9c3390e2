"""The file of a search: that of a sweep, and the value whose boundary is searched in each row."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from actuated_characters.boundary.bisection import Value, Way
from actuated_characters.sweep.axes import (
    MAX_ROWS,
    OWN_COLUMNS,
    check_axes,
    check_parameter,
    check_value_name,
    read_axes,
)
from actuated_characters.sweep.file import PARTS, open_file
from actuated_characters.sweep.grid import Axis, Cell, Choice, Row, cell_text, count_rows, expand
from actuated_characters.sweep.row import Outcome
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.mappings import MappingReader

FELL = "fell"
BAGS = ["all", "none"]
_KEYS = ("value", "from", "to", "within", "steps", "fails", "around")
_OWN_COLUMNS = (*OWN_COLUMNS, "point", "holds", "fails", "holes", "tries")
_DEFAULT_STEPS, _MOST_STEPS = 8, 1000
_NO_NUMBERS = (FELL, "fell_in_mode")


@dataclass(frozen=True)
class Search:
    """What a file says: a way of values, which is searched at each point of a grid."""

    axes: tuple[Axis, ...]  # whose choices are the points
    value: str  # what is searched: a parameter, or a value for places in texts
    way: Way
    figure: str  # fails if this is true, or above the limit
    limit: float
    around: str  # the column that is an angle in degrees; empty: none
    bags: str  # of BAGS: whether the run at each point's boundary is kept

    def points(self) -> list[tuple[int, Mapping[str, Cell]]]:
        """All points by their numbers, from 1 on, with what the table says of each."""
        numbers = range(1, count_rows(self.axes) + 1)
        chosen = ((number, self._chosen(number)) for number in numbers)
        return [
            (number, {name: cell for choice in choices for name, cell in choice.cells.items()})
            for number, choices in chosen
        ]

    def row(self, point: int, value: Value, number: int) -> Row:
        """The run at a point with a value."""
        axes = [[choice] for choice in (*self._chosen(point), _choice(self.value, value))]
        (row,) = expand(axes)
        return replace(row, number=number)

    def has_failed(self, outcome: Outcome) -> bool | None:
        """Whether a run has failed; None if it was refused, or has not the figure that says so.

        One that could not go on has failed, such as one that diverged.
        """
        if outcome.is_refused:
            return None
        figure = outcome.figures.get(self.figure)
        if outcome.error:
            return True
        if self.figure == FELL:
            return None if figure is None else figure is True
        return figure > self.limit if isinstance(figure, (int, float)) else None

    def describe_failure(self) -> str:
        """What counts as a failure, in a few words."""
        return (
            "the character fell"
            if self.figure == FELL
            else f"{self.figure} is above {self.limit:g}"
        )

    def _chosen(self, point: int) -> list[Choice]:
        index, chosen = point - 1, list[Choice]()
        for axis in reversed(self.axes):
            index, place = divmod(index, len(axis))
            chosen.append(axis[place])
        return chosen[::-1]


def read_search(path: Path, options: Mapping[str, bool], figures: Sequence[str]) -> Search:
    """Read a file.

    Args:
        path: Of the file.
        options: Those of the command `run` that `run:` may have, and whether they may be repeated.
        figures: Those by which a run can fail.

    Raises:
        ConfigurationError: something in it is wrong; names the place, and what would be right.
    """
    reader = open_file(path, "a search", (*PARTS, "bags", "search"))
    if "search" not in reader.content:
        raise ConfigurationError(f"{path} has no 'search:'; docs/search.md says what it holds")
    axes = read_axes(reader, options, [*figures, *_OWN_COLUMNS])
    part = reader.part("search")
    part.check_keys(_KEYS)
    value, way = _read_value(part, {*figures, *options, *_OWN_COLUMNS}), _read_way(part)
    figure, limit = _read_failure(part, figures)
    check_axes(path, [*axes, [_choice(value, way.first), _choice(value, way.last)]])
    if count_rows(axes) > MAX_ROWS:
        raise ConfigurationError(
            f"{path}: these are {count_rows(axes):,} points; there may be {MAX_ROWS:,}"
        )
    bags = reader.choice("bags", BAGS)
    return Search(axes, value, way, figure, limit, _read_angle(part, axes), bags)


def _choice(name: str, value: Value) -> Choice:
    """The choice of a value, which is a parameter or has places in texts."""
    if "." in name:
        return Choice((f"--set={name}:={cell_text(value)}",), {name: value})
    return Choice((), {name: value}, {name: value})


def _read_value(reader: MappingReader, taken: set[str]) -> str:
    name = reader.text("value")
    if "." in name:
        check_parameter(reader, name)
    else:
        check_value_name(reader, name, taken)
    return name


def _read_way(reader: MappingReader) -> Way:
    first, last = reader.number("from"), reader.number("to")
    if first == last:
        raise reader.wrong("to", last, "another number than 'from'")
    within = reader.number("within")
    if not 0.0 < within <= abs(last - first):
        raise reader.wrong("within", within, f"above 0, and {abs(last - first):g} at most")
    steps = reader.content.get("steps", _DEFAULT_STEPS)
    if type(steps) is not int or not 1 <= steps <= _MOST_STEPS:
        raise reader.wrong("steps", steps, f"a whole number from 1 to {_MOST_STEPS}")
    if all(type(reader.content[key]) is int for key in ("from", "to", "within")):
        return Way(int(first), int(last), int(within), steps, whole=True)
    return Way(first, last, within, steps)


def _read_failure(reader: MappingReader, figures: Sequence[str]) -> tuple[str, float]:
    """The figure by which a run fails, and the limit above which it does."""
    given = reader.content.get("fails", FELL)
    if given == FELL:
        return FELL, 0.0
    part = reader.part("fails") if isinstance(given, dict) else None
    if part is None or len(part.content) != 1:
        raise reader.wrong(
            "fails", given, f"'{FELL}', or a figure and its limit: {{root_error_max_m: 0.5}}"
        )
    (figure,) = part.content
    known = [each for each in figures if each not in _NO_NUMBERS]
    if figure not in known:
        sentence = one_of("figure", figure, known, part.prefix)
        raise ConfigurationError(f"{reader.place}: {sentence}")
    return figure, part.number(figure)


def _read_angle(reader: MappingReader, axes: Sequence[Axis]) -> str:
    """The column around which the picture is drawn."""
    if "around" not in reader.content:
        return ""
    name = reader.text("around")
    cells: dict[str, list[Cell]] = {}
    for axis in axes:
        for choice in axis:
            for column, cell in choice.cells.items():
                cells.setdefault(column, []).append(cell)
    if name not in cells:
        raise ConfigurationError(
            f"{reader.place}: {one_of('column', name, sorted(cells), reader.prefix)}"
        )
    if not all(isinstance(cell, (int, float)) for cell in cells[name]):
        raise reader.wrong("around", name, "a value whose entries are angles in degrees")
    return name
