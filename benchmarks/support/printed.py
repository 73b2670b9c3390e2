"""Tables as they are printed."""

from collections.abc import Sequence

from rich.table import Table


def make_table(title: str, heading: Sequence[str], *rows: Sequence[str]) -> Table:
    """A table whose first column is of words, and whose others are of numbers."""
    table = Table(title=title, title_justify="left")
    for number, column in enumerate(heading):
        table.add_column(column, justify="right" if number else "left")
    for row in rows:
        table.add_row(*row)
    return table
