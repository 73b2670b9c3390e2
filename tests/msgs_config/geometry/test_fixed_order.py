"""Sums and products are those of exact arithmetic, and their additions have one order."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msgs_config.arrays import FloatArray
from msgs_config.geometry import fixed_order

SEEDS = st.integers(0, 10_000)


def arrays(seed: int, *shapes: tuple[int, ...]) -> list[FloatArray]:
    rng = np.random.default_rng(seed)
    return [rng.normal(size=shape) * 10.0 ** rng.integers(-8, 9, shape) for shape in shapes]


@given(SEEDS, st.integers(0, 40))
def test_a_total_adds_from_the_first_to_the_last(seed: int, length: int) -> None:
    (values,) = arrays(seed, (5, length))
    expected = []
    for row in values.tolist():
        partial = row[0] if row else 0.0
        for value in row[1:]:
            partial += value
        expected.append(partial)

    assert fixed_order.total(values).tolist() == expected
    assert fixed_order.total(values.T, axis=0).tolist() == expected
    assert fixed_order.total(np.asfortranarray(values)).tolist() == expected


@given(SEEDS)
def test_the_same_numbers_give_the_same_bits_alone_and_in_a_batch(seed: int) -> None:
    matrices, vectors = arrays(seed, (6, 3, 5), (6, 5))
    together = fixed_order.apply(matrices, vectors)

    alone = [
        fixed_order.apply(matrix, vector) for matrix, vector in zip(matrices, vectors, strict=True)
    ]
    assert together.tolist() == [row.tolist() for row in alone]


@given(SEEDS)
def test_products_are_those_of_linear_algebra(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b, u, v = rng.normal(size=(2, 3, 4)), rng.normal(size=(4, 5)), *rng.normal(size=(2, 7, 3))

    assert fixed_order.product(a, b) == pytest.approx(a @ b)
    assert fixed_order.apply(a, b.T[0]) == pytest.approx(a @ b[:, 0])
    assert fixed_order.cross(u, v) == pytest.approx(np.cross(u, v))
    assert fixed_order.cross(u[0], v) == pytest.approx(np.cross(u[0], v))
    assert fixed_order.dot(u, v) == pytest.approx(np.einsum("ij,ij->i", u, v))
    assert fixed_order.norm(u) == pytest.approx([math.dist(row, (0, 0, 0)) for row in u])
    assert fixed_order.mean(u, axis=0) == pytest.approx(u.mean(axis=0))


@given(st.floats(-3.0, 3.0), st.integers(1, 16))
def test_powers_are_repeated_products(base: float, count: int) -> None:
    powers = fixed_order.powers(np.array([base, 1.0]), count)

    assert powers.shape == (2, count)
    assert powers[0] == pytest.approx([base**exponent for exponent in range(count)])
    assert powers[1].tolist() == [1.0] * count


def test_equations_are_solved() -> None:
    rng = np.random.default_rng(1)
    matrix, right = rng.normal(size=(6, 6)), rng.normal(size=(6, 3))
    matrix[0, 0] = 0.0  # so that rows must be exchanged

    solved = fixed_order.solve(matrix, right)

    np.testing.assert_allclose(solved, np.linalg.solve(matrix, right), rtol=1e-9, atol=1e-12)


def test_equations_without_an_inverse_are_refused() -> None:
    with pytest.raises(ZeroDivisionError):
        fixed_order.solve(np.zeros((2, 2)), np.ones((2, 1)))
