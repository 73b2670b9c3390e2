"""Rotations in plain numbers: to the bit what the arrays' functions give."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msgs_config.geometry import fixed_order, rotations, scalars

numbers = st.floats(-3.0, 3.0)
vectors = st.tuples(numbers, numbers, numbers)
turns = vectors.map(lambda vector: tuple(rotations.exp(np.array(vector)).tolist()))


@given(st.one_of(st.just((0.0, 0.0, 0.0)), vectors))
def test_quaternions_and_their_inverses_are_the_arrays(vector: scalars.Vector) -> None:
    wanted = rotations.exp(np.array(vector))

    turn = scalars.exp(vector)

    assert turn == tuple(wanted.tolist())
    assert scalars.conjugate(turn) == tuple(rotations.conjugate(wanted).tolist())


@given(turns, turns)
def test_products_are_the_arrays(a: scalars.Quaternion, b: scalars.Quaternion) -> None:
    wanted = rotations.multiply(np.array(a), np.array(b))

    assert scalars.multiply(a, b) == tuple(wanted.tolist())


@given(turns, vectors)
def test_vectors_are_turned_as_the_arrays_are(
    turn: scalars.Quaternion, vector: tuple[float, float, float]
) -> None:
    matrix = rotations.matrix(np.array(turn))

    axes = scalars.axes(turn)

    turned = scalars.to_parent(axes, vector)
    back = scalars.to_child(axes, vector)

    assert [list(row) for row in axes] == matrix.tolist()
    assert list(turned) == fixed_order.apply(matrix, np.array(vector)).tolist()
    assert list(back) == fixed_order.apply(matrix.T, np.array(vector)).tolist()
    np.testing.assert_allclose(scalars.to_child(axes, turned), vector, rtol=0.0, atol=1e-14)


@given(vectors, vectors)
def test_vector_products_are_numpys(
    a: tuple[float, float, float], b: tuple[float, float, float]
) -> None:
    np.testing.assert_allclose(scalars.cross(a, b), np.cross(a, b), rtol=0.0, atol=1e-14)


@given(turns)
def test_rotation_vectors_are_the_arrays(turn: scalars.Quaternion) -> None:
    assert list(scalars.log(turn)) == rotations.log(np.array(turn)).tolist()


def test_no_turn_has_the_rotation_vector_zero() -> None:
    assert scalars.log((0.0, 0.0, 0.0, 1.0)) == (0.0, 0.0, 0.0)


@given(st.one_of(vectors, vectors.map(lambda v: tuple(1e-3 * part for part in v))))
def test_the_jacobian_is_the_arrays(vector: tuple[float, float, float]) -> None:
    expected = rotations.right_jacobian_inverse(np.array(vector))

    np.testing.assert_allclose(
        scalars.right_jacobian_inverse(vector), expected, rtol=0.0, atol=1e-13
    )


@given(turns, vectors)
def test_a_vector_is_rotated_as_the_arrays_are(
    turn: scalars.Quaternion, vector: scalars.Vector
) -> None:
    turned = rotations.rotate(np.array(turn), np.array(vector))

    np.testing.assert_allclose(scalars.rotate(turn, vector), turned, atol=1e-13)


@given(vectors)
def test_axes_are_those_of_the_rotation(a: scalars.Vector) -> None:
    q = scalars.exp(a)
    x, y, z = (scalars.rotate(q, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))

    found = scalars.of_axes(x, y, z)

    assert abs(np.dot(found, q)) == pytest.approx(1.0, abs=1e-12)


@given(st.floats(-3.0, 3.0))
def test_a_turn_about_z_has_its_angle_as_yaw(angle: float) -> None:
    assert scalars.yaw(scalars.about_z(angle)) == pytest.approx(angle, abs=1e-12)


def test_turns_about_axes_are_right_handed() -> None:
    quarter = np.pi / 2

    assert scalars.rotate(scalars.about_x(quarter), (0, 1, 0)) == pytest.approx((0, 0, 1))
    assert scalars.rotate(scalars.about_y(quarter), (0, 0, 1)) == pytest.approx((1, 0, 0))
    assert scalars.rotate(scalars.about_z(quarter), (1, 0, 0)) == pytest.approx((0, 1, 0))
