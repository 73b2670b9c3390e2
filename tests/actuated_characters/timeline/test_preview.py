"""What an editor shows of a timeline: its reference, and what is wrong with it."""

from pathlib import Path

import numpy as np
import pytest

from actuated_characters.timeline.preview import Preview
from controller_node.references.clip import ClipReference
from msgs_config.clips.reading import read_clip
from tests.support.physics import character

HUMANOID = character("humanoid")
ELBOW = HUMANOID.layout.joint("right_elbow").start
KEYS = [
    {"poses": [{"at": 1.0, "pose": {"right_elbow": 1.0}}, {"at": 2.0, "pose": {"right_elbow": 2}}]}
]


def test_it_is_at_a_key_what_the_key_says_over_the_clip_beneath() -> None:
    preview = Preview(HUMANOID, Path("a.yaml"))

    preview.take({"clips": [{"at": 0.0, "clip": "walk"}], "keys": KEYS})

    walk = ClipReference(HUMANOID.layout, read_clip(HUMANOID, "walk"))
    for time, elbow in ((1.0, 1.0), (2.0, 2.0)):
        position, beneath = preview.at(time).position, walk.sample(time).configuration.position
        assert position[ELBOW] == pytest.approx(elbow)
        np.testing.assert_allclose(
            np.delete(position[6:], ELBOW - 6), np.delete(beneath[6:], ELBOW - 6), atol=1e-9
        )
    assert preview.errors == ()


def test_what_cannot_be_played_is_said_and_the_motion_stays() -> None:
    preview = Preview(HUMANOID, Path("a.yaml"))
    rest = np.array(HUMANOID.rest_position)
    np.testing.assert_allclose(preview.at(1.0).position, rest, atol=1e-12)
    preview.take({"keys": KEYS})

    preview.take({"keys": KEYS, "clips": [{"at": 0.0, "clip": "wlak"}]})

    (error,) = preview.errors
    assert error.startswith("clips 1: ") and "wlak" in error
    assert preview.at(1.0).position[ELBOW] == pytest.approx(1.0)
    preview.take({"reach": [{"at": 0, "until": 1, "link": "left_wrist", "point": [5, 0, 1]}]})
    assert "short of its point" in preview.errors[0]


def test_it_is_over_once_the_character_stands_after_steering() -> None:
    preview = Preview(HUMANOID, Path("a.yaml"))
    preview.take({"steering": [{"at": 1.0, "until": 2.2, "velocity": [0.8, 0.0, 0.0]}]})

    assert preview.end > 2.2
    there = preview.at(preview.end).position
    np.testing.assert_allclose(there, preview.at(preview.end + 5.0).position, atol=2e-3)
    knees = [HUMANOID.layout.joint(name).start for name in ("left_knee", "right_knee")]
    np.testing.assert_allclose(there[knees], 0.0, atol=0.01)
