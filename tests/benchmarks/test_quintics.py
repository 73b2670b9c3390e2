"""Bounds of what quintics can do, against Chebyshev's."""

import numpy as np
import pytest
from numpy.polynomial import Chebyshev, Polynomial

from benchmarks.quintics import fewest_quintics, least_error

TIMES = np.linspace(0.0, 2.0, 201)


def test_a_quintic_has_no_error() -> None:
    quintic = Polynomial([0.3, -1.0, 2.0, -1.5, 0.7, 0.2])

    assert least_error(TIMES, quintic(TIMES)) == pytest.approx(0.0, abs=1e-9)
    assert least_error(TIMES[:6], np.random.default_rng(1).normal(size=6)) == 0.0


def test_of_the_sixth_chebyshev_polynomial_all_is_left() -> None:
    quintic = Polynomial([0.3, -1.0, 2.0, -1.5, 0.7, 0.2])
    times = 1.0 - np.cos(np.linspace(0.0, np.pi, 61))  # every tenth is one of its seven extremes

    values = 0.4 * Chebyshev.basis(6)(times - 1.0) + quintic(times)

    assert least_error(times, values) == pytest.approx(0.4, rel=1e-6)


def test_no_quintic_is_below_the_bound() -> None:
    rng = np.random.default_rng(2)
    values = np.cumsum(rng.normal(size=len(TIMES)))

    bound = least_error(TIMES, values)

    fitted = Polynomial.fit(TIMES, values, 5).convert()
    assert 0.0 < bound <= np.abs(fitted(TIMES) - values).max()
    for _ in range(50):
        other = fitted + Polynomial(rng.normal(scale=bound, size=6))
        assert bound <= np.abs(other(TIMES) - values).max()


def test_pieces_are_counted_side_by_side() -> None:
    one, other = Polynomial([0.0, 3.0, 0.0, 40.0]), Polynomial([5.0, -20.0, 9.0])
    joined = np.where(TIMES < 0.7, one(TIMES), other(TIMES))
    still = np.zeros_like(TIMES)

    assert fewest_quintics(TIMES, np.stack((one(TIMES), still), axis=1)) == 1
    assert fewest_quintics(TIMES, np.stack((still, joined), axis=1)) == 2
