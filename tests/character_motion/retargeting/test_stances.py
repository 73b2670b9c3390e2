"""Feet that swing are clear of the ground: as the captured ones, and a little more."""

from pathlib import Path

import numpy as np
import pytest

from character_motion.clips.importing import import_bvh
from character_motion.retargeting.stances import _swing_clearance
from character_motion.retargeting.target_body import TargetBody
from tests.support.capture_makers import MAKERS
from tests.support.captures import capture
from tests.support.physics import character

FRAME = 1.0 / 60.0  # s


@pytest.mark.parametrize(
    ("middle", "highest", "wanted"),
    [
        (0.015, 0.09, 0.035),  # 2 cm more than in the middle of the swing
        (0.002, 0.09, 0.03),  # 3 cm at least, where the captured foot clears more at some time
        (0.002, 0.025, 0.025),  # but no more than it clears at most
        (0.0, 0.0, 0.02),
        (0.2, 0.3, 0.08),
    ],
)
def test_a_swing_clears_what_the_captured_one_does(
    middle: float, highest: float, wanted: float
) -> None:
    stands = np.ones(60, dtype=np.bool_)
    stands[10:50] = False
    captured = np.where(stands, 0.0, middle)
    captured[12] = highest

    lifted = _swing_clearance(stands, captured, FRAME)

    assert lifted[30] == pytest.approx(wanted)
    assert (lifted[stands] == 0.0).all()
    assert np.abs(np.diff(lifted)).max() <= 0.4 * FRAME + 1e-9  # m, at 0.4 m/s


def test_the_feet_of_a_walk_clear_three_centimetres(tmp_path: Path) -> None:
    target = TargetBody(character("humanoid"))

    made = import_bvh(capture(tmp_path / "a.bvh", MAKERS["course"], "walk"), target)

    assert made.quality.swing_clearance_m is None or made.quality.swing_clearance_m >= 0.029
