"""The table of a sweep: what it holds, and that it reads back to the bit."""

import csv
import io
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from actuated_characters.sweep import table
from actuated_characters.sweep.grid import Cell, Row
from actuated_characters.sweep.journal import Done
from actuated_characters.sweep.row import FIGURES, Outcome

ROWS = [Row(1, (), {"clip": "walk", "x": 1}), Row(2, (), {"clip": None, "x": 0.1 + 0.2})]
FELL = Outcome({**dict.fromkeys(FIGURES), "fell": True, "fell_at_s": 1 / 3}, "It fell.", "ab")
DONE = {
    2: Done(2, FELL, "here"),
    1: Done(1, Outcome({}, error='no "clip", no run'), "there"),
}


def read(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_rows_are_in_their_order_with_all_columns() -> None:
    first, second = read(table.csv_text(table.make_records(ROWS, DONE)))

    assert list(first) == ["row", "clip", "x", *FIGURES, "verdict", "state_hash", "error"]
    assert (first["row"], first["clip"], first["error"]) == ("1", "walk", 'no "clip", no run')
    assert (second["fell"], second["fell_at_s"]) == ("true", repr(1 / 3))
    assert (second["clip"], second["ticks"], second["x"]) == ("", "", "0.30000000000000004")


def test_rows_that_are_not_done_are_left_out() -> None:
    assert [each["row"] for each in table.make_records(ROWS, {2: DONE[2]})] == [2]


@given(st.lists(st.floats(allow_nan=False), min_size=1))
def test_numbers_read_back_to_the_bit(numbers: list[float]) -> None:
    records: list[dict[str, Cell]] = [{"x": number} for number in numbers]

    found = [float(record["x"]).hex() for record in read(table.csv_text(records))]

    assert found == [number.hex() for number in numbers]


def test_parquet_has_the_same_numbers_and_types_that_do_not_hang_on_the_rows(
    tmp_path: Path,
) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")

    assert table.write_tables(tmp_path, table.make_records(ROWS, DONE))

    found = parquet.read_table(tmp_path / table.PARQUET)
    assert found["x"].to_pylist() == [1.0, 0.1 + 0.2]
    assert found["fell_at_s"].to_pylist() == [None, 1 / 3]
    table.write_tables(tmp_path, table.make_records(ROWS, {1: DONE[1]}))
    few = parquet.read_table(tmp_path / table.PARQUET).schema
    assert [few.field(name).type for name in ("fell", "verdict", "error")] == [
        found.schema.field(name).type for name in ("fell", "verdict", "error")
    ]


def test_without_pyarrow_there_is_csv_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table, "find_spec", lambda name: None)
    (tmp_path / table.PARQUET).write_bytes(b"of an earlier table")

    assert not table.write_tables(tmp_path, table.make_records(ROWS, DONE))

    assert [path.name for path in tmp_path.iterdir()] == [table.TABLE]
