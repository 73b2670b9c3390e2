"""Forms of events: every track has one, and what is typed becomes what a file has."""

import pytest

from actuated_characters.timeline.content import TRACKS
from actuated_characters.viewer.editor.event_forms import FORMS, describe_event, read_form
from actuated_characters.viewer.editor.key_marks import find_key_marks
from msgs_config.errors import MotionError


def test_every_track_has_a_form() -> None:
    assert set(FORMS) == set(TRACKS)


def test_what_is_typed_becomes_numbers_and_names() -> None:
    push = read_form("pushes", 2.0, {"link": "chest", "force": "0, 200, 0"})
    weak = read_form(
        "strengths", 1.0, {"until": 2.0, "joints": "neck, right_knee", "strength": 0.3}
    )

    held = {"until": 3.0, "link": "neck", "force": 90.0}
    here = read_form("pins", 2.0, {**held, "point": "here"})
    there = read_form("pins", 2.0, {**held, "point": "0.1, 0, 2"})
    thrown = {"mass": 2.0, "speed": 3.0, "target": "chest", "from": "left"}
    ball = read_form("throws", 2.0, {**thrown, "size": " "})
    box = read_form("throws", 2.0, {**thrown, "size": "0.4, 0.6, 0.2"})

    assert here == {"at": 2.0, **held, "point": "here"}
    assert there["point"] == [0.1, 0.0, 2.0]
    assert push == {"at": 2.0, "link": "chest", "force": [0.0, 200.0, 0.0]}
    assert weak["joints"] == ["neck", "right_knee"]
    assert ball == {"at": 2.0, **thrown}
    assert box == {**ball, "size": [0.4, 0.6, 0.2], "shape": "box", "slide": True}


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"until": 1.0, "point": "0, 0, 1"}, "until is 1 s; it must be after 2 s"),
        ({"until": 3.0, "point": "0, 0"}, "point is '0, 0'; it must be three numbers"),
        ({"until": 3.0, "point": "a, b, c"}, "three numbers"),
        ({"until": 3.0, "point": "[1"}, "not valid YAML"),
    ],
)
def test_what_cannot_be_read_is_said(given: dict[str, object], reason: str) -> None:
    with pytest.raises(MotionError, match=reason):
        read_form("look", 2.0, given)


def test_keys_and_events_are_marked_where_they_are() -> None:
    content = {
        "keys": [{"name": "arm", "poses": [{"at": 1.0, "pose": {"right_elbow": 1.0}}]}],
        "pushes": [{"at": 2.0, "link": "chest", "force": [0.0, 200.0, 0.0]}],
        "limp": [{"at": 3.0, "until": 4.0}],
        "clips": [{"at": 0.5, "clip": "walk", "from": 0.2, "to": 1.2}],
    }

    marks = {mark.kind + mark.label: mark for mark in find_key_marks(content, 5.0)}

    assert marks["keyframe"].text == "key of arm: right_elbow"
    assert marks["push"].text == "pushes 1: 2 s, link chest, force 0 200 0"
    assert (marks["modelimp"].start, marks["modelimp"].end) == (3.0, 4.0)
    assert (marks["modeclips"].start, marks["modeclips"].end) == (0.5, 1.5)
    assert marks["modelimp"].lane != marks["modeclips"].lane
    assert marks["end"].start == 5.0
    assert describe_event("limp", 0, content["limp"][0]) == "limp 1: 3 s to 4 s"
