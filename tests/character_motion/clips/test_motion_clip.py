"""Clips with what is known of them: written, read again, and refused in one line."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from character_motion.clips.motion_clip import MotionClip, read_motion_clip
from character_motion.clips.quality import measure_quality
from character_motion.retargeting.target_body import TargetBody
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.clips.reading import read_clip
from msgs_config.errors import ClipError
from tests.support.physics import character


@pytest.fixture
def walk() -> MotionClip:
    return read_motion_clip(character("humanoid"), "walk")


def test_what_is_known_is_kept(tmp_path: Path, walk: MotionClip) -> None:
    known = replace(
        walk,
        contacts={"left_heel": ((0.1, 0.4), (0.9, 1.2))},
        source={"file": "a.bvh", "licence": "CC0"},
        quality={"feet_in_ground_m": 0.001},
    )

    known.write(tmp_path / "a.json")
    again = read_motion_clip(walk.character, str(tmp_path / "a.json"))

    assert again.contacts == known.contacts and again.source == known.source
    assert again.quality == known.quality and again.wraps
    assert again.touching("left_heel").sum() > 10 and not again.touching("left_toe").any()
    frames = read_clip(walk.character, str(tmp_path / "a.json"))  # the reader of the motion alone
    np.testing.assert_allclose(frames.times, walk.times, atol=1e-5)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("Source", "me", r'Source is "me"; it must be a JSON object'),
        ("Contacts", [1], "Contacts is .1.; it must be a JSON object"),
        (
            "Contacts",
            {"left_heel": [[0.3, 0.1]]},
            r"Contacts: left_heel is .*rising from 0 to 1\.2",
        ),
        ("Contacts", {"left_heel": [[0.3, 9.0]]}, "Contacts: left_heel is"),
        ("Contacts", {"left_heel": "now"}, "Contacts: left_heel is"),
        ("Contacts", {"left_heel": [[0.1, "b"]]}, "Contacts: left_heel is"),
        ("Quality", 3, "Quality is 3"),
    ],
)
def test_what_is_wrong_is_one_clear_line(
    tmp_path: Path, walk: MotionClip, key: str, value: Any, message: str
) -> None:
    content = json.loads(walk.text())
    content[key] = value
    file = tmp_path / "a.json"
    file.write_text(json.dumps(content))

    with pytest.raises(ClipError, match=message) as caught:
        read_motion_clip(walk.character, str(file))

    assert "\n" not in str(caught.value) and str(file) in str(caught.value)


def test_quality_is_that_of_a_body_moved_by_hand(walk: MotionClip) -> None:
    """A body that stands still, 4 mm in the ground, and slides ahead at 0.1 m/s."""
    whole = character("humanoid")
    target = TargetBody(whole)
    times = np.linspace(0.0, 1.0, 31)
    positions = np.tile(np.array(whole.rest_position), (31, 1))
    positions[:, 2] = target.leg_length + target.ankle_height - 0.004
    positions[:, 0] = 0.1 * times
    clip = MotionClip(
        whole,
        times,
        whole.layout.configuration(positions),
        contacts={"left_heel": ((0.0, 1.0),)},
    )

    quality = measure_quality(target, clip)

    assert quality.feet_in_ground_m == pytest.approx(0.004, abs=1e-6)
    assert quality.deepest_link in ("left_ankle", "right_ankle")
    assert quality.skating_mean_m_s == pytest.approx(0.1, abs=1e-6)
    assert quality.standing_share == 1.0 and quality.fastest_joint_rad_s == 0.0
    assert set(quality.limits_touched) == {
        "left_knee", "right_knee", "left_elbow", "right_elbow"
    }  # fmt: skip


def test_a_clip_without_contacts_does_not_skate(walk: MotionClip) -> None:
    quality = measure_quality(TargetBody(walk.character), walk)

    assert quality.skating_mean_m_s is None and quality.standing_share == 0.0
    assert isinstance(walk.motion, GeneralizedPosition)
