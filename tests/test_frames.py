"""One frame's rotation in plain numbers, against the arrays' own functions."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from msgs_config import rotations
from sim_node import frames

numbers = st.floats(-3.0, 3.0)
vectors = st.tuples(numbers, numbers, numbers)
turns = vectors.map(lambda vector: tuple(rotations.exp(np.array(vector)).tolist()))


@given(turns, turns)
def test_products_are_the_arrays(a: frames.Quaternion, b: frames.Quaternion) -> None:
    wanted = rotations.multiply(np.array(a), np.array(b))

    np.testing.assert_allclose(frames.product(a, b), wanted, rtol=0.0, atol=1e-15)


@given(turns, vectors)
def test_vectors_are_turned_as_the_arrays_are(
    turn: frames.Quaternion, vector: tuple[float, float, float]
) -> None:
    matrix = rotations.matrix(np.array(turn))

    axes = frames.axes(turn)

    np.testing.assert_allclose(axes, matrix, rtol=0.0, atol=1e-15)
    turned = frames.to_parent(axes, vector)
    np.testing.assert_allclose(turned, matrix @ np.array(vector), rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(frames.to_child(axes, turned), vector, rtol=0.0, atol=1e-14)


@given(vectors, vectors)
def test_vector_products_are_numpys(
    a: tuple[float, float, float], b: tuple[float, float, float]
) -> None:
    np.testing.assert_allclose(frames.cross(a, b), np.cross(a, b), rtol=0.0, atol=1e-14)
