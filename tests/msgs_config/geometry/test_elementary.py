"""Elementary functions of arrays are those of the C library, on every processor."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from msgs_config.arrays import FloatArray
from msgs_config.geometry import elementary

ANGLES = hnp.arrays(float, hnp.array_shapes(max_dims=3, min_side=0), elements=st.floats(-1e3, 1e3))
OF_ONE = {
    elementary.sin: math.sin,
    elementary.cos: math.cos,
    elementary.tan: math.tan,
}


@pytest.mark.parametrize("function", OF_ONE)
@given(angles=ANGLES)
@settings(deadline=None)
def test_each_value_is_that_of_the_c_library_to_the_bit(
    function: Callable[[FloatArray], FloatArray], angles: FloatArray
) -> None:
    values = function(angles)

    assert values.shape == angles.shape
    assert values.ravel().tolist() == [OF_ONE[function](angle) for angle in angles.ravel()]


@given(st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), max_size=8))
@settings(deadline=None)
def test_angles_of_points_and_cosines_are_those_of_the_c_library(
    points: list[tuple[float, float]],
) -> None:
    y, x = np.array(points).reshape(-1, 2).T

    assert elementary.arctan2(y, x).tolist() == [math.atan2(*point) for point in points]
    assert elementary.arccos(x).tolist() == [math.acos(point[1]) for point in points]


def test_what_is_outside_the_domain_is_not_a_number_and_spoils_nothing_else() -> None:
    sines = elementary.sin(np.array([math.inf, 0.5, math.nan]))

    assert math.isnan(sines[0]) and math.isnan(sines[2])
    assert sines[1] == math.sin(0.5)
    assert math.isnan(elementary.arccos(np.array(1.5)))
