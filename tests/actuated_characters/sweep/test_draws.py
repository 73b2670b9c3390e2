"""Random values of a sweep: where they lie, and that they depend on nothing but their key."""

import math
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from actuated_characters.sweep.draws import Draw, is_chosen, read_draw
from msgs_config.errors import ConfigurationError
from msgs_config.mappings import MappingReader

SEEDS = st.integers(0, 2**53)
NUMBERS = st.integers(0, 10**6)
POSITIVE = st.floats(1e-300, 1e300)


@given(SEEDS, NUMBERS, POSITIVE, POSITIVE, st.sampled_from(["uniform", "log"]))
def test_a_value_lies_within_its_bounds(
    seed: int, number: int, one: float, other: float, kind: str
) -> None:
    least, largest = sorted((one, other))

    assert least <= Draw(kind, least, largest).value(seed, "force", number) <= largest


def test_whole_numbers_are_drawn_equally_often_with_both_ends() -> None:
    draw = Draw("integer", -1, 2)

    drawn = [draw.value(3, "delay", number) for number in range(4000)]

    counts = [drawn.count(value) for value in (-1, 0, 1, 2)]
    assert sum(counts) == 4000
    assert min(counts) > 1000 - 5 * math.sqrt(4000 * 0.25 * 0.75)


@pytest.mark.parametrize(
    ("draw", "quantile"),
    [
        (Draw("uniform", 2.0, 6.0), lambda share: 2.0 + 4.0 * share),
        (Draw("log", 0.1, 10.0), lambda share: 0.1 * 100.0**share),
        (Draw("normal", 1.0, 2.0), lambda share: NormalDist(1.0, 2.0).inv_cdf(share)),
    ],
)
def test_values_are_distributed_as_they_should_be(draw: Draw, quantile) -> None:  # type: ignore[no-untyped-def]
    drawn = np.array([draw.value(1, "x", number) for number in range(4000)])

    for share in (0.1, 0.5, 0.9):  # Kolmogorov's bound at one in a million: 2.7 / sqrt(n)
        assert abs((drawn <= quantile(share)).mean() - share) < 2.7 / math.sqrt(len(drawn))


def test_a_normal_value_lies_within_the_bounds_that_it_is_given() -> None:
    draw = Draw("normal", 0.0, 1.0, (0.5, 1.0))

    assert all(0.5 <= draw.value(0, "x", number) <= 1.0 for number in range(200))


def test_bounds_that_hold_no_normal_value_are_an_error() -> None:
    with pytest.raises(ConfigurationError, match=r"random\.x: of 1000 normal numbers none"):
        Draw("normal", 0.0, 1.0, (50.0, 51.0)).value(0, "x", 0)


def test_seed_name_and_number_each_make_another_value() -> None:
    draw = Draw("uniform", 0.0, 1.0)

    values = {draw.value(*key) for key in ((0, "a", 0), (1, "a", 0), (0, "b", 0), (0, "a", 1))}

    assert len(values) == 4


@given(SEEDS, NUMBERS, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_larger_share_has_the_rows_of_a_smaller_one(
    seed: int, number: int, one: float, other: float
) -> None:
    less, more = sorted((one, other))

    assert not is_chosen(seed, number, less) or is_chosen(seed, number, more)


@pytest.mark.parametrize(
    ("content", "error"),
    [
        ({}, "random.x must have one of uniform, log, normal, integer"),
        ({"uniform": [0, 1], "log": [1, 2]}, "random.x must have one of"),
        ({"uniform": [1, 0]}, r"random.x.uniform is a list; it must be \[LEAST, LARGEST\]"),
        ({"uniform": 3}, "random.x.uniform is 3; it must be a list of 2 finite numbers"),
        ({"log": [0, 1]}, "both above 0"),
        ({"normal": [0, -1]}, "the second at least 0"),
        ({"normal": [0, 1], "bounds": [2, 1]}, "random.x.bounds is a list"),
        ({"uniform": [0, 1], "bounds": [0, 1]}, "they are of normal alone"),
        ({"integer": [0, 1.5]}, "two whole numbers"),
        ({"unifrom": [0, 1]}, "did you mean 'uniform'"),
    ],
)
def test_a_wrong_distribution_is_one_line(content: dict[str, object], error: str) -> None:
    with pytest.raises(ConfigurationError, match=error):
        read_draw(MappingReader(Path("sweep.yaml"), content, ConfigurationError, "random.x."))
