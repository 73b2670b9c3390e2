"""Events in the mirror y -> -y: of links, joints, sides and vectors the others."""

from typing import Any

import pytest

from actuated_characters.timeline.mirrored_events import mirrored_event
from msgs_config.errors import MotionError
from tests.support.physics import character

HUMANOID = character("humanoid")
IMAGES: list[tuple[str, dict[str, Any], dict[str, Any]]] = [
    (
        "pushes",
        {"at": 1.0, "link": "left_wrist", "force": [10.0, 200.0, 5.0], "for": 0.1},
        {"at": 1.0, "link": "right_wrist", "force": [10.0, -200.0, 5.0], "for": 0.1},
    ),
    (
        "steering",
        {"at": 1.0, "until": 2.0, "velocity": [0.8, 0.2, -0.5]},
        {"at": 1.0, "until": 2.0, "velocity": [0.8, -0.2, 0.5]},
    ),
    (
        "reach",
        {"at": 1.0, "until": 2.0, "link": "right_wrist", "point": [0.4, -0.2, 1.2]},
        {"at": 1.0, "until": 2.0, "link": "left_wrist", "point": [0.4, 0.2, 1.2]},
    ),
    (
        "strengths",
        {"at": 0.0, "until": 1.0, "joints": ["right_shoulder", "neck"], "strength": 0.3},
        {"at": 0.0, "until": 1.0, "joints": ["left_shoulder", "neck"], "strength": 0.3},
    ),
    (
        "pins",
        {"at": 0.0, "until": 1.0, "link": "left_wrist", "point": "here", "force": 300.0},
        {"at": 0.0, "until": 1.0, "link": "right_wrist", "point": "here", "force": 300.0},
    ),
    (
        "throws",
        {"at": 2.0, "mass": 2.0, "target": "right_knee", "from": "left"},
        {"at": 2.0, "mass": 2.0, "target": "left_knee", "from": "right"},
    ),
    ("throws", {"at": 2.0, "from": "45"}, {"at": 2.0, "from": -45.0}),
    ("throws", {"at": 2.0, "from": "front"}, {"at": 2.0, "from": "front"}),
    ("limp", {"at": 1.0, "until": 2.0}, {"at": 1.0, "until": 2.0}),
]


@pytest.mark.parametrize(("track", "event", "image"), IMAGES)
def test_an_event_is_what_a_mirror_shows(
    track: str, event: dict[str, Any], image: dict[str, Any]
) -> None:
    before = repr(event)

    assert mirrored_event(HUMANOID, track, event) == image
    assert repr(event) == before


@pytest.mark.parametrize(
    ("track", "event", "image"), [each for each in IMAGES if each[1].get("from") != "45"]
)
def test_the_image_of_the_image_is_the_event(
    track: str, event: dict[str, Any], image: dict[str, Any]
) -> None:
    assert mirrored_event(HUMANOID, track, image) == event


def test_what_is_no_value_of_its_kind_stays() -> None:
    event = {"at": 1.0, "link": 3, "force": [1.0, "a", 2.0], "joints": "neck", "from": None}
    assert mirrored_event(HUMANOID, "pushes", event) == event


def test_a_clip_is_mirrored_as_a_file() -> None:
    with pytest.raises(MotionError, match="motion mirror"):
        mirrored_event(HUMANOID, "clips", {"at": 0.0, "clip": "walk"})
