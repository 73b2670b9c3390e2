"""Wilson's interval against published values and its own equation."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from actuated_characters.trial.wilson import CONFIDENCE_95, wilson_interval

# Newcombe 1998, "Two-Sided Confidence Intervals for the Single Proportion", table I, method 3
PUBLISHED = {
    (81, 263): (0.2553, 0.3662),
    (15, 148): (0.0624, 0.1605),
    (0, 20): (0.0000, 0.1611),
    (1, 29): (0.0061, 0.1718),
}


@pytest.mark.parametrize(("seen", "interval"), PUBLISHED.items())
def test_published_intervals(seen: tuple[int, int], interval: tuple[float, float]) -> None:
    assert wilson_interval(*seen) == pytest.approx(interval, abs=5e-5)


@given(st.integers(1, 10_000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_both_ends_are_as_far_from_the_share_as_the_quantile(seen: tuple[int, int]) -> None:
    count, total = seen
    low, high = wilson_interval(count, total)

    assert 0.0 <= low <= count / total <= high <= 1.0
    for p in (low, high):
        square = CONFIDENCE_95**2 * p * (1.0 - p) / total
        if p not in (0.0, 1.0):
            assert (count / total - p) ** 2 == pytest.approx(square, rel=1e-6)


def test_nothing_is_known_without_samples() -> None:
    assert wilson_interval(0, 0) == (0.0, 1.0)
    with pytest.raises(ValueError, match="3 of 2"):
        wilson_interval(3, 2)
