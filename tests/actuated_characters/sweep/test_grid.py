"""The rows that follow from what varies."""

import itertools

from hypothesis import given
from hypothesis import strategies as st

from actuated_characters.sweep.grid import (
    Axis,
    Cell,
    Choice,
    cell_text,
    count_rows,
    expand,
    rows_to_check,
)


def axis(number: int, length: int) -> Axis:
    return [Choice((f"--{number}={each}",), {f"c{number}": each}) for each in range(length)]


LENGTHS = st.lists(st.integers(1, 5), max_size=4)


@given(LENGTHS)
def test_rows_are_all_combinations_in_the_order_of_nested_loops(lengths: list[int]) -> None:
    rows = list(expand([axis(number, length) for number, length in enumerate(lengths)]))

    wanted = list(itertools.product(*map(range, lengths)))
    assert [tuple(row.cells.values()) for row in rows] == wanted
    assert [row.number for row in rows] == list(range(1, len(wanted) + 1))
    assert all(
        row.arguments == tuple(f"--{n}={value}" for n, value in enumerate(values))
        for row, values in zip(rows, wanted, strict=True)
    )


@given(LENGTHS)
def test_the_rows_to_check_have_each_choice(lengths: list[int]) -> None:
    axes = [axis(number, length) for number, length in enumerate(lengths)]
    rows = list(expand(axes))

    checked = rows_to_check(axes, rows, 50)

    assert count_rows(axes) == len(rows)
    assert {text for row in checked for text in row.arguments} == {
        text for row in rows for text in row.arguments
    }
    assert len(checked) <= max(lengths, default=1)


def test_no_more_rows_are_checked_than_asked_for() -> None:
    axes = [axis(0, 30)]

    assert len(rows_to_check(axes, list(expand(axes)), 7)) == 7


def test_a_value_takes_its_places_in_all_texts() -> None:
    axes = [
        [Choice(("--push=chest:{force},0,0@{at}", "--set=sim_node.gravity:={force}"))],
        [Choice(values={"force": 12.5}), Choice(values={"force": 80})],
        [Choice(values={"at": 0.1})],
    ]

    first, second = expand(axes)

    assert first.arguments == ("--push=chest:12.5,0,0@0.1", "--set=sim_node.gravity:=12.5")
    assert second.arguments[0] == "--push=chest:80,0,0@0.1"


@given(st.floats(allow_nan=False))
def test_a_number_reads_back_to_the_bit(number: float) -> None:
    assert float(cell_text(number)).hex() == number.hex()


def test_other_entries_are_texts_that_tables_know() -> None:
    cells: list[Cell] = [None, True, False, 3, "walk"]

    assert list(map(cell_text, cells)) == ["", "true", "false", "3", "walk"]
