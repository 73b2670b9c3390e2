"""The path of a camera that follows: smooth, without delay, cut where an episode begins."""

from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from actuated_characters.render.camera_path import smoothed


@given(
    st.integers(1, 300),
    st.integers(0, 200),
    st.tuples(*(st.floats(-1e3, 1e3) for _ in range(4))),
)
def test_a_straight_and_even_path_stays_what_it_is(
    count: int, reach: int, line: tuple[float, ...]
) -> None:
    x, y, vx, vy = line
    path = np.array((x, y)) + np.outer(np.arange(count), (vx, vy))

    np.testing.assert_allclose(smoothed(path, reach), path, atol=1e-8 * (1.0 + np.abs(path).max()))


def test_a_slow_sway_passes_and_a_fast_one_does_not_and_neither_is_late() -> None:
    rows = np.arange(2400)
    slow, fast = (np.sin(2.0 * pi * rows / period) for period in (2400.0, 24.0))

    smooth = smoothed(np.column_stack((slow, fast)), 144)[300:-300]

    np.testing.assert_allclose(smooth[:, 0], slow[300:-300], atol=0.02)
    assert np.abs(smooth[:, 1]).max() < 0.02


def test_a_step_becomes_a_ramp_within_its_reach() -> None:
    path = np.zeros((400, 1))
    path[200:] = 1.0

    smooth = smoothed(path, 60)[:, 0]

    assert (np.diff(smooth) >= -1e-12).all() and np.diff(smooth).max() < 0.05
    np.testing.assert_allclose(smooth[:140], 0.0, atol=1e-12)
    np.testing.assert_allclose(smooth[260:], 1.0, atol=1e-12)
    assert smooth[199] + smooth[200] == pytest.approx(1.0)
