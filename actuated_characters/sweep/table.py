"""The table of a sweep's results, as CSV and Parquet."""

import csv
import io
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

from actuated_characters.sweep.grid import Cell, Row, cell_text
from actuated_characters.sweep.journal import Done
from actuated_characters.sweep.row import FIGURES
from msgs_config.whole_files import write_whole, writing

TABLE, PARQUET = "table.csv", "table.parquet"

_TEXTS = ("fell_in_mode", "verdict", "state_hash", "error")

Record = dict[str, Cell]


def make_records(
    rows: Sequence[Row], done: Mapping[int, Done], figures: Sequence[str] = FIGURES
) -> list[Record]:
    """The rows that are done, in their order: what varies, figures, verdict, hash and error."""
    varies = list(dict.fromkeys(name for row in rows for name in row.cells))
    return [_record(row, done[row.number], varies, figures) for row in rows if row.number in done]


def _record(row: Row, done: Done, varies: Sequence[str], figures: Sequence[str]) -> Record:
    outcome = done.outcome
    return {
        "row": row.number,
        **{name: row.cells.get(name) for name in varies},
        **{name: outcome.figures.get(name) for name in figures},
        "verdict": outcome.verdict or None,
        "state_hash": outcome.state_hash or None,
        "error": outcome.error or None,
    }


def csv_text(records: Sequence[Record]) -> str:
    """The table as CSV; each number reads back to the same bits, and what is not known is empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    if records:
        writer.writerow(records[0])
    for record in records:
        writer.writerow(cell_text(cell) for cell in record.values())
    return text.getvalue()


def write_tables(directory: Path, records: Sequence[Record]) -> bool:
    """Write `table.csv` and, if there is pyarrow, `table.parquet`; returns whether there is.

    Raises:
        RecordingError: a file cannot be written.
    """
    write_whole(directory / TABLE, csv_text(records))
    if find_spec("pyarrow") is None:
        (directory / PARQUET).unlink(missing_ok=True)  # it would be of an earlier table
        return False
    import pyarrow
    from pyarrow import parquet

    names = list(records[0]) if records else []
    columns = {
        name: pyarrow.array(cells, None if _is_known(cells) else _usual_type(name))
        for name in names
        for cells in (_of_one_type([record[name] for record in records]),)
    }
    with writing(directory / PARQUET) as part:
        parquet.write_table(pyarrow.table(columns), part)
    return True


def _is_known(cells: Sequence[Cell]) -> bool:
    return any(cell is not None for cell in cells)


def _usual_type(name: str) -> str:
    """The type of a column without entries, so that tables go together."""
    if name == "fell":
        return "bool"
    return "string" if name in _TEXTS else "float64"


def _of_one_type(cells: Sequence[Cell]) -> list[Cell]:
    """A column of one type: as it is, numbers with a fraction among them, or texts."""
    kinds = {type(cell) for cell in cells if cell is not None}
    if len(kinds) <= 1:
        return list(cells)
    if kinds == {int, float}:
        return [None if cell is None else float(cell) for cell in cells]
    return [None if cell is None else cell_text(cell) for cell in cells]
