"""Single rotations agree with those of arrays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msgs_config.geometry import rotations
from msgs_config.geometry import single_rotations as single

coordinate = st.floats(-3.0, 3.0, allow_subnormal=False)
vectors = st.tuples(coordinate, coordinate, coordinate)


@given(vectors, vectors)
def test_product_rotation_and_logarithm_are_those_of_arrays(
    a: single.Vector, b: single.Vector
) -> None:
    p, q = single.exp(a), single.exp(b)

    np.testing.assert_allclose(p, rotations.exp(np.array(a)), atol=1e-14)
    product = rotations.multiply(np.array(p), np.array(q))
    np.testing.assert_allclose(single.multiply(p, q), product, atol=1e-14)
    turned = rotations.rotate(np.array(p), np.array(b))
    np.testing.assert_allclose(single.rotate(p, b), turned, atol=1e-13)
    np.testing.assert_allclose(
        rotations.exp(np.array(single.log(p))) * np.sign(p[3] or 1.0), p, atol=1e-12
    )
    assert single.norm(single.log(p)) <= np.pi + 1e-12


@given(vectors)
def test_axes_are_those_of_the_rotation(a: single.Vector) -> None:
    q = single.exp(a)
    x, y, z = (single.rotate(q, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))

    found = single.of_axes(x, y, z)

    assert abs(np.dot(found, q)) == pytest.approx(1.0, abs=1e-12)


@given(st.floats(-3.0, 3.0))
def test_a_turn_about_z_has_its_angle_as_yaw(angle: float) -> None:
    assert single.yaw(single.about_z(angle)) == pytest.approx(angle, abs=1e-12)


def test_turns_about_axes_are_right_handed() -> None:
    quarter = np.pi / 2

    assert single.rotate(single.about_x(quarter), (0, 1, 0)) == pytest.approx((0, 0, 1))
    assert single.rotate(single.about_y(quarter), (0, 0, 1)) == pytest.approx((1, 0, 0))
    assert single.rotate(single.about_z(quarter), (1, 0, 0)) == pytest.approx((0, 1, 0))
