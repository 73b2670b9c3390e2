"""One frame's rotation in plain numbers: to the bit what the arrays' functions give."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from msgs_config.geometry import fixed_order, frames, rotations

numbers = st.floats(-3.0, 3.0)
vectors = st.tuples(numbers, numbers, numbers)
turns = vectors.map(lambda vector: tuple(rotations.exp(np.array(vector)).tolist()))


@given(st.one_of(st.just((0.0, 0.0, 0.0)), vectors))
def test_quaternions_and_their_inverses_are_the_arrays(vector: frames.Triple) -> None:
    wanted = rotations.exp(np.array(vector))

    turn = frames.quaternion(vector)

    assert turn == tuple(wanted.tolist())
    assert frames.conjugate(turn) == tuple(rotations.conjugate(wanted).tolist())


@given(turns, turns)
def test_products_are_the_arrays(a: frames.Quaternion, b: frames.Quaternion) -> None:
    wanted = rotations.multiply(np.array(a), np.array(b))

    assert frames.product(a, b) == tuple(wanted.tolist())


@given(turns, vectors)
def test_vectors_are_turned_as_the_arrays_are(
    turn: frames.Quaternion, vector: tuple[float, float, float]
) -> None:
    matrix = rotations.matrix(np.array(turn))

    axes = frames.axes(turn)

    turned = frames.to_parent(axes, vector)
    back = frames.to_child(axes, vector)

    assert [list(row) for row in axes] == matrix.tolist()
    assert list(turned) == fixed_order.apply(matrix, np.array(vector)).tolist()
    assert list(back) == fixed_order.apply(matrix.T, np.array(vector)).tolist()
    np.testing.assert_allclose(frames.to_child(axes, turned), vector, rtol=0.0, atol=1e-14)


@given(vectors, vectors)
def test_vector_products_are_numpys(
    a: tuple[float, float, float], b: tuple[float, float, float]
) -> None:
    np.testing.assert_allclose(frames.cross(a, b), np.cross(a, b), rtol=0.0, atol=1e-14)


@given(turns)
def test_rotation_vectors_are_the_arrays(turn: frames.Quaternion) -> None:
    assert list(frames.rotation_vector(turn)) == rotations.log(np.array(turn)).tolist()


def test_no_turn_has_the_rotation_vector_zero() -> None:
    assert frames.rotation_vector((0.0, 0.0, 0.0, 1.0)) == (0.0, 0.0, 0.0)


@given(st.one_of(vectors, vectors.map(lambda v: tuple(1e-3 * part for part in v))))
def test_the_jacobian_is_the_arrays(vector: tuple[float, float, float]) -> None:
    expected = rotations.right_jacobian_inverse(np.array(vector))

    np.testing.assert_allclose(
        frames.right_jacobian_inverse(vector), expected, rtol=0.0, atol=1e-13
    )
