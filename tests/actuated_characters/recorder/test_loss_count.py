"""What never came is counted, by the numbers of what came; numbers are as the middleware has them.

A run of the middleware with messages that are really lost is in `test_recorder.py`.
"""

from collections.abc import Iterable

from hypothesis import given, settings
from hypothesis import strategies as st

from actuated_characters.recorder.loss_count import LossCount


def count_lost(numbers: Iterable[int | None], publishers: int = 1) -> int:
    count = LossCount(lambda: publishers)
    for number in numbers:
        count.take(number)
    return count.lost_messages


@given(
    first=st.integers(1, 1000),
    came=st.lists(st.booleans(), max_size=60),
)
def test_of_one_publisher_every_gap_between_what_came_is_counted(
    first: int, came: list[bool]
) -> None:
    numbers = [first, *(first + i for i, here in enumerate(came, start=1) if here)]

    assert count_lost(numbers) == numbers[-1] - first + 1 - len(numbers)


@settings(deadline=None)
@given(sizes=st.lists(st.integers(1, 20), min_size=2, max_size=4), data=st.data())
def test_several_publishers_lose_nothing_however_theirs_are_mixed(
    sizes: list[int], data: st.DataObject
) -> None:
    left = [list(range(1, size + 1)) for size in sizes]
    mixed = []
    while any(left):
        mixed.append(data.draw(st.sampled_from([numbers for numbers in left if numbers])).pop(0))

    assert count_lost(mixed, publishers=len(sizes)) == 0


def test_a_gap_is_found_beside_another_publisher_too() -> None:
    assert count_lost([1, 1, 2, 2, 3, 7, 3, 8, 4], publishers=2) == 3


def test_what_was_published_before_the_first_is_not_missed() -> None:
    assert count_lost([500, 501]) == 0


def test_a_publisher_that_begins_anew_has_lost_nothing() -> None:
    assert count_lost([1, 2, 3, 1, 2, 4]) == 1


def test_a_middleware_without_numbers_counts_nothing() -> None:
    assert count_lost([None, None]) == 0
