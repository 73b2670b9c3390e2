"""The fewest and smallest inputs, by predicates whose answers were worked out by hand."""

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import TypeVar

import pytest

from actuated_characters.shrink.minimal import (
    SHARE,
    First,
    Sizes,
    ddmin,
    fewest,
    shrunk,
    smallest_size,
)

C = TypeVar("C")


def first_of(fails: Callable[[C], bool]) -> First[C]:
    """Asks about one choice after the other."""

    def first(choices: Sequence[C]) -> int | None:
        return next((place for place, each in enumerate(choices) if fails(each)), None)

    return first


class Asked:
    """A predicate that keeps what it was asked."""

    def __init__(self, answer: Callable[[frozenset[int]], bool]) -> None:
        self._answer = answer
        self.asked: list[frozenset[int]] = []

    def __call__(self, items: Sequence[int]) -> bool:
        self.asked.append(frozenset(items))
        return self._answer(frozenset(items))


def test_ddmin_finds_the_two_of_eight_as_in_the_paper() -> None:
    # Zeller and Hildebrandt 2002, figure 5: changes 1, 7 and 8 fail together
    assert sorted(ddmin(range(1, 9), first_of(lambda some: {1, 7, 8} <= set(some)))) == [1, 7, 8]


@pytest.mark.parametrize("culprit", range(10))
def test_ddmin_finds_one_by_halves(culprit: int) -> None:
    fails = Asked(lambda some: culprit in some)

    assert list(ddmin(range(10), first_of(fails))) == [culprit]
    assert len(fails.asked) <= 8  # two for each of four halvings


@pytest.mark.parametrize("seed", range(5))
def test_of_what_ddmin_leaves_nothing_can_be_left_out(seed: int) -> None:
    def fails(some: Sequence[int]) -> bool:  # not monotone: it depends on a sum
        return sum(item * item + seed for item in some) % 5 == sum(range(12)) % 5 or len(some) == 12

    left = list(ddmin(range(12), first_of(fails)))

    assert fails(left)
    assert len(left) == 1 or not any(fails([i for i in left if i != each]) for each in left)


def test_nothing_is_fewer_than_one() -> None:
    assert list(fewest(range(4), first_of(lambda some: True))) == []


def test_one_is_preferred_to_two_that_halves_would_find() -> None:
    # the first half fails by 0 and 1 together; 7 alone fails as well
    def fails(some: Sequence[int]) -> bool:
        return {0, 1} <= set(some) or 7 in some

    assert sorted(ddmin(range(8), first_of(fails))) == [0, 1]
    assert list(fewest(range(8), first_of(fails))) == [7]


def test_two_are_preferred_to_three_that_halves_would_find() -> None:
    def fails(some: Sequence[int]) -> bool:
        return {0, 1, 2} <= set(some) or {3, 7} <= set(some)

    assert sorted(ddmin(range(8), first_of(fails))) == [0, 1, 2]
    assert sorted(fewest(range(8), first_of(fails))) == [3, 7]


def test_two_next_to_each_other_are_tried_before_two_that_are_not() -> None:
    fails = Asked(lambda some: {0, 1, 2} <= some or some == {5, 6})

    assert sorted(fewest(range(8), first_of(fails))) == [5, 6]
    assert frozenset((0, 3)) not in fails.asked


def test_three_are_left_where_no_two_fail() -> None:
    fails = Asked(lambda some: {1, 4, 6} <= some)

    assert sorted(fewest(range(8), first_of(fails))) == [1, 4, 6]
    assert {frozenset(pair) for pair in combinations(range(8), 2)} <= set(fails.asked)


@pytest.mark.parametrize("least", [0.95, 0.9, 0.5, 0.3, 0.11, 0.02])
def test_a_size_is_the_least_to_five_percent(least: float) -> None:
    size = smallest_size(first_of(lambda size: size >= least), 1.0)

    assert least <= size
    assert (1.0 - SHARE) * size < least


def test_what_cannot_be_smaller_was_tried_at_thirds_and_so_on() -> None:
    asked: list[float] = []

    def fails(size: float) -> bool:
        asked.append(size)
        return False

    assert smallest_size(first_of(fails), 1.0) == 1.0
    assert asked == [0.3333, 0.6667, 0.7778, 0.8889, 0.9259, 1.0 - SHARE]


def test_a_smaller_size_is_found_where_five_percent_less_does_not_fail() -> None:
    # fails from 0.3 to 0.9, and at 1
    size = smallest_size(first_of(lambda size: 0.3 <= size <= 0.9 or size == 1.0), 1.0)

    assert 0.3 <= size < 0.3 / (1.0 - SHARE)


def test_a_size_is_that_of_a_hole_where_less_fails_again() -> None:
    # fails from 0.2 to 0.4, and from 0.7 on
    def fails(size: float) -> bool:
        return 0.2 <= size <= 0.4 or size >= 0.7

    size = smallest_size(first_of(fails), 1.0)

    assert fails(size)
    assert not fails((1.0 - SHARE) * size)


def test_what_always_fails_ends_at_a_thousandth() -> None:
    assert 0.0 < smallest_size(first_of(lambda size: True), 1.0) <= 1e-3


def test_both_inputs_are_as_small_as_they_can_be_together() -> None:
    # 3 newtons of the one or of the other, in all, fell it; each is 2 as it was
    def fails(sizes: Sizes) -> bool:
        return 2.0 * sizes.get(3, 0.0) + 2.0 * sizes.get(5, 0.0) >= 3.0

    found = shrunk(range(8), range(8), first_of(fails))

    assert found.keys() == {3, 5}
    assert fails(found)
    for number in found:
        assert not fails({**found, number: (1.0 - SHARE) * found[number]})
        assert not fails({each: size for each, size in found.items() if each != number})


def test_what_a_smaller_one_does_not_need_any_more_is_left_out() -> None:
    # not monotone: 2 falls by itself at a half, and at its whole only with 5
    def fails(sizes: Sizes) -> bool:
        return 0.4 <= sizes.get(2, 0.0) <= 0.6 or (sizes.get(2, 0.0) > 0.6 and 5 in sizes)

    found = shrunk(range(8), [2], first_of(fails))

    assert found.keys() == {2}
    assert 0.4 <= found[2] < 0.4 / (1.0 - SHARE)


def test_what_has_no_size_stays_as_it_was() -> None:
    assert shrunk(range(3), [], first_of(lambda sizes: 1 in sizes)) == {1: 1.0}
