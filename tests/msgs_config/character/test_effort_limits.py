"""Prepared limits clip as the layout does, to the bit, whatever the efforts."""

import numpy as np
import pytest

from msgs_config.character.joints.effort_limits import EffortLimits
from msgs_config.character.layout import JointLayout, JointType

LAYOUT = JointLayout(
    [("root", JointType.FLOATING), ("ball", JointType.SPHERICAL), ("hinge", JointType.REVOLUTE)]
)
VALUES = np.array([np.inf, 50.0, 20.0, 0.0])  # root force, root torque, ball, hinge
LIMITS = EffortLimits(LAYOUT, VALUES)
SHARES = (0.0, 0.3, 1.0 / np.sqrt(3.0), 1.0 - 1e-15, 1.0, 1.0 + 1e-15, 2.0, 1e300)


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("direction", [(1.0, 1.0, 1.0), (1.0, 0.0, 0.0), (0.6, -0.8, 0.0)])
def test_efforts_near_a_limit_are_clipped_as_the_layout_clips_them(
    share: float, direction: tuple[float, ...]
) -> None:
    effort = np.zeros(LAYOUT.size)
    effort[6:9] = share * VALUES[2] * np.array(direction)

    clipped, expected = LIMITS.clipped(effort), LAYOUT.clipped(effort, VALUES)

    assert clipped.tobytes() == expected.tobytes()
    assert (clipped is effort) == (expected is effort)


def test_an_effort_far_within_the_limits_is_the_same_object() -> None:
    effort = np.array([1e6, 0.0, 0.0, 10.0, 10.0, 10.0, -5.0, 5.0, 5.0, 0.0])

    assert LIMITS.clipped(effort) is effort


def test_a_limit_of_zero_leaves_nothing() -> None:
    effort = np.zeros(LAYOUT.size)
    effort[9] = 1e-12

    assert LIMITS.clipped(effort)[9] == 0.0


@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_what_is_not_finite_is_as_the_layout_has_it(value: float) -> None:
    effort = np.zeros(LAYOUT.size)
    effort[0] = value

    np.testing.assert_array_equal(LIMITS.clipped(effort), LAYOUT.clipped(effort, VALUES))
