"""Which values a search tries, and what it says of them, by runs whose failures are known."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from actuated_characters.boundary.bisection import (
    Boundary,
    Value,
    Way,
    find_boundary,
    most_tries,
    values_to_try,
)


def searched(way: Way, fails: Callable[[Value], bool]) -> dict[Value, bool]:
    """All that is tried until nothing is left to try."""
    tried: dict[Value, bool] = {}
    while values := values_to_try(way, tried):
        assert not set(values) & tried.keys()
        tried |= {value: fails(value) for value in values}
    return tried


@given(st.floats(0.0, 100.0, exclude_min=True), st.integers(1, 12), st.sampled_from([0.1, 3.0, 50]))
def test_a_boundary_is_found_as_near_as_is_asked(edge: float, steps: int, within: float) -> None:
    way = Way(0.0, 100.0, within, steps)
    tried = searched(way, lambda value: value >= edge)
    found = find_boundary(way, tried)

    assert found.holds is not None
    assert found.fails is not None
    assert found.holds < edge <= found.fails <= found.holds + within
    assert found.holes == ()
    assert len(tried) <= most_tries(way)


@given(st.integers(1, 40), st.integers(1, 50))
def test_of_whole_numbers_neighbours_are_found(edge: int, steps: int) -> None:
    way = Way(0, 40, 1, steps, whole=True)
    tried = searched(way, lambda value: value >= edge)

    assert find_boundary(way, tried) == Boundary(edge - 1, edge, ())
    assert all(type(value) is int for value in tried)
    assert len(tried) <= most_tries(way)


def test_a_way_may_lead_down() -> None:
    way = Way(1.0, 0.0, 0.01, 4)
    found = find_boundary(way, searched(way, lambda friction: friction < 0.3))

    assert found.holds is not None
    assert found.fails is not None
    assert found.fails < 0.3 <= found.holds <= found.fails + 0.01


def test_what_holds_beyond_the_first_failure_is_a_hole_and_not_the_boundary() -> None:
    way = Way(0, 80, 1, 8, whole=True)
    tried = searched(way, lambda value: 33 <= value <= 42 or value >= 61)

    assert find_boundary(way, tried) == Boundary(32, 33, (50, 60))


def test_a_failure_that_bisection_meets_before_is_the_boundary() -> None:
    way = Way(0, 16, 1, 1, whole=True)
    tried = searched(way, lambda value: value in (8, 3) or value >= 14)

    assert find_boundary(way, tried) == Boundary(7, 8, ())  # 3 was never tried
    assert 3 not in tried


def test_nothing_is_tried_twice_where_there_is_no_number_between() -> None:
    way = Way(1.0, 2.0, 1e-17, 4)
    tried = searched(way, lambda value: value >= 1.3)
    found = find_boundary(way, tried)

    assert found.holds is not None
    assert found.fails == 1.3
    assert found.fails - found.holds == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize(
    ("fails", "holds", "first"), [(False, 8.0, None), (True, None, 0.0)], ids=["none", "all"]
)
def test_where_nothing_changes_only_the_even_values_are_tried(
    fails: bool, holds: float | None, first: float | None
) -> None:
    way = Way(0.0, 8.0, 0.1, 4)
    tried = searched(way, lambda value: fails)

    assert list(tried) == [0.0, 2.0, 4.0, 6.0, 8.0]
    assert find_boundary(way, tried) == Boundary(holds, first, ())
