"""Euler angles give their turns back, and go through gimbal lock without a jump."""

from functools import reduce
from itertools import permutations

import numpy as np
import pytest
from numpy.typing import NDArray

from character_motion.bvh.euler_angles import euler_angles
from msgs_config.geometry import rotations

Floats = NDArray[np.float64]
ORDERS = ["".join(axes) for axes in permutations("XYZ")]
every_order = pytest.mark.parametrize("order", ORDERS)


def about(axis: str, angle: Floats) -> Floats:
    """The quaternions (..., 4) of turns about an axis, by half angles."""
    turns = np.zeros((*angle.shape, 4))
    turns[..., "XYZ".index(axis)], turns[..., 3] = np.sin(angle / 2), np.cos(angle / 2)
    return turns


def turns_of(angles: Floats, order: str) -> Floats:
    """The turns (..., 4) of angles (..., 3) in rad: the first axis is the parent's."""
    parts = (about(axis, angles[..., number]) for number, axis in enumerate(order))
    return reduce(rotations.multiply, parts)


@every_order
def test_any_turns_are_given_back(order: str) -> None:
    rng = np.random.default_rng(2)
    turns = rotations.normalised(rng.normal(size=(500, 3, 4)))

    angles = euler_angles(turns, order)

    assert rotations.angle_between(turns_of(angles, order), turns).max() < 1e-7
    assert np.abs(angles[0, :, 1]).max() <= np.pi / 2  # it begins with the usual triple


@every_order
@pytest.mark.parametrize("beside", [0.0, 1e-12, 1e-7, 1e-4, 1e-2])
def test_a_swing_through_gimbal_lock_and_back_has_no_jump(order: str, beside: float) -> None:
    # the second angle goes through 90 degrees, at a frame or between two, while the others drift
    second = np.pi / 2 + np.concatenate((np.linspace(-1.2, 1.2, 61), np.linspace(1.2, -1.2, 61)))
    drift = np.linspace(0.3, 0.5, len(second))
    swing = np.stack((drift, second + beside, -2.0 * drift), axis=-1)

    angles = euler_angles(turns_of(swing, order), order)

    np.testing.assert_allclose(angles, swing, atol=1e-2)  # while locked, the sum alone is known
    assert np.abs(np.diff(angles, axis=0)).max() < 0.05
    turned = rotations.angle_between(turns_of(angles, order), turns_of(swing, order))
    assert turned.max() < 2e-5


@every_order
def test_what_stays_locked_stays_still(order: str) -> None:
    rng = np.random.default_rng(3)
    angles = np.tile((0.4, np.pi / 2, -0.2), (50, 1)) + rng.normal(scale=1e-9, size=(50, 3))

    found = euler_angles(turns_of(angles, order), order)

    assert np.abs(np.diff(found, axis=0)).max() < 1e-7


@every_order
def test_turns_go_on_beyond_a_full_circle(order: str) -> None:
    for axis in range(3):
        spin = np.zeros((100, 3))
        spin[:, axis] = np.linspace(0.0, 6.0 * np.pi, 100) * (-1.0) ** axis

        np.testing.assert_allclose(euler_angles(turns_of(spin, order), order), spin, atol=1e-7)
