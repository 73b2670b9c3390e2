"""The tables that the commands print."""

from collections.abc import Iterable, Mapping, Sequence

from rich.markup import escape
from rich.table import Table
from rich.text import Text


def make_table(
    title: str, columns: Sequence[str], rows: Iterable[Sequence[object]], *, right: bool = True
) -> Table:
    """A table of rows of texts; all columns but the first are aligned to the right, or none."""
    table = Table(title=escape(title), title_justify="left")
    for number, column in enumerate(columns):
        table.add_column(column, justify="right" if right and number else "left", overflow="fold")
    _add_rows(table, rows)
    return table


def make_facts_table(title: str, facts: Iterable[tuple[str, str]]) -> Table:
    """A table of names and what they stand for, without a header."""
    table = Table(title=escape(title), title_justify="left", show_header=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    _add_rows(table, facts)
    return table


def _add_rows(table: Table, rows: Iterable[Sequence[object]]) -> None:
    for row in rows:
        table.add_row(*(cell if isinstance(cell, Text) else escape(str(cell)) for cell in row))


def show(value: object, digits: int = 4) -> str:
    """A value as a table has it: a number with so many digits, `-` for None and NaN."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name}: {part}" for name, part in value.items()) or "none"
    if value is None or value != value:
        return "-"
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value)
