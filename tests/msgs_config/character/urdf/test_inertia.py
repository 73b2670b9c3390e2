"""Inertia tensors: principal axes as LAPACK has them; the nearest that a body can have."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msgs_config.character.urdf.inertia import nearest_physical, principal_axes

# LAPACK's own eigenvalues are wrong by a hundredth where one entry is 1e-81 of the others
_ENTRY = st.floats(-1.0, 1.0).filter(lambda entry: entry == 0.0 or abs(entry) > 1e-30)
ENTRIES = st.lists(_ENTRY, min_size=6, max_size=6)
MOMENTS = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3)


def tensor(entries: list[float]) -> np.ndarray:
    matrix = np.zeros((3, 3))
    matrix[np.triu_indices(3)] = entries
    return matrix + np.triu(matrix, 1).T


@given(ENTRIES)
def test_principal_moments_are_the_eigenvalues(entries: list[float]) -> None:
    matrix = tensor(entries)

    moments, axes = principal_axes(matrix)

    assert np.allclose(np.sort(moments), np.linalg.eigvalsh(matrix), rtol=0.0, atol=1e-14)
    assert np.allclose(axes @ np.diag(moments) @ axes.T, matrix, rtol=0.0, atol=1e-14)
    assert np.allclose(axes.T @ axes, np.eye(3), rtol=0.0, atol=1e-14)
    assert np.linalg.det(axes) > 0.0


@given(MOMENTS)
def test_the_nearest_are_those_of_a_body(moments: list[float]) -> None:
    x, y, z = nearest_physical(np.array(moments))

    assert min(x, y, z) >= 0.0
    assert x <= y + z
    assert y <= x + z
    assert z <= x + y


@given(MOMENTS)
def test_nearest_is_where_no_body_is_nearer(moments: list[float]) -> None:
    """The nearest point of a convex cone: what is left is at right angles, and points outwards."""
    found = np.array(nearest_physical(np.array(moments)))

    left = np.array(moments) - found

    assert abs(left @ found) < 1e-12
    edges = 1.0 - np.eye(3)  # of the cone: a thin rod along each axis
    assert (edges @ left < 1e-12).all()


@pytest.mark.parametrize(
    ("moments", "nearest"),
    [
        ((1.0, 2.0, 4.0), (4 / 3, 7 / 3, 11 / 3)),  # a third of the excess from each
        ((1.0, 2.0, 2.5), (1.0, 2.0, 2.5)),
        ((0.0, 0.0, 1.0), (1 / 3, 1 / 3, 2 / 3)),  # a plate
        ((-1.0, -1.0, -1.0), (0.0, 0.0, 0.0)),
    ],
)
def test_cases_by_hand(moments: tuple[float, ...], nearest: tuple[float, ...]) -> None:
    assert nearest_physical(np.array(moments)) == pytest.approx(nearest)
