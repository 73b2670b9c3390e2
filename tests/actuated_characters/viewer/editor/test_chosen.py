"""What is chosen on the time line: moved, copied, mirrored and deleted, each in one undo step."""

from pathlib import Path
from typing import Any

import pytest

from actuated_characters.timeline import edits
from actuated_characters.timeline.document import Document
from actuated_characters.viewer.editor.chosen import Chosen
from actuated_characters.viewer.editor.items import Item, parse_item
from actuated_characters.viewer.editor.session import Session
from msgs_config.errors import MotionError
from tests.support.physics import character

HUMANOID = character("humanoid")
PUSH = {"at": 1.0, "link": "right_wrist", "force": [0.0, 200.0, 0.0]}
LATER = {"at": 3.0, "link": "chest", "force": [100.0, 0.0, 0.0]}
LIMP = {"at": 1.0, "until": 1.5}


@pytest.fixture
def session(tmp_path: Path) -> Session:
    session = Session(HUMANOID, Document(tmp_path / "a.yaml", "character: humanoid\n"))
    for track, event in (("pushes", PUSH), ("pushes", LATER), ("limp", LIMP)):
        session.edit(edits.add_event(track, event))
    for at, angle in ((0.5, 1.0), (1.5, 0.2)):
        session.edit(edits.add_pose(0, at, {"right_elbow": angle}))
    return session


@pytest.fixture
def chosen(session: Session) -> Chosen:
    return Chosen(session)


def content(session: Session) -> dict[str, Any]:
    return dict(session.document.content)


def test_an_event_that_is_moved_past_another_is_still_the_one_that_is_chosen(
    session: Session, chosen: Chosen
) -> None:
    before = content(session)

    chosen.move(Item("pushes", 0), 4.0)

    assert content(session)["pushes"] == [LATER, {**PUSH, "at": 4.0}]
    assert chosen.event == Item("pushes", 1)
    chosen.delete()
    assert content(session)["pushes"] == [LATER]
    session.undo()
    session.undo()
    assert content(session) == before


def test_the_end_of_an_event_moves_along(session: Session, chosen: Chosen) -> None:
    chosen.move(Item("limp", 0), 2.25)
    assert content(session)["limp"] == [{"at": 2.25, "until": 2.75}]


def test_an_event_ends_at_another_time_and_a_clip_is_cut_there(
    session: Session, chosen: Chosen
) -> None:
    session.edit(edits.add_event("clips", {"at": 5.0, "clip": "walk", "from": 0.5}))

    chosen.end(Item("limp", 0), 2.25)
    chosen.end(Item("clips", 0), 5.6)

    begin = LIMP["at"]
    assert content(session)["limp"] == [{"at": begin, "until": 2.25}]
    assert content(session)["clips"] == [{"at": 5.0, "clip": "walk", "from": 0.5, "to": 1.1}]
    assert chosen.event == Item("clips", 0)
    with pytest.raises(MotionError, match=f"it begins at {begin:g} s, and must end later than"):
        chosen.end(Item("limp", 0), begin)


def test_a_key_that_is_moved_is_gone_to_in_its_layer(session: Session, chosen: Chosen) -> None:
    session.add_layer("head")
    chosen.move(Item("keys", 0, 0), 2.0)

    assert [pose["at"] for pose in session.poses] == [1.5, 2.0]
    assert (session.layer, session.time, session.key) == (0, 2.0, 1)
    with pytest.raises(MotionError, match=r"there is a pose at 1.5 s already"):
        chosen.move(Item("keys", 1, 0), 1.5)


def test_copies_of_an_event_go_to_the_present_time(session: Session, chosen: Chosen) -> None:
    chosen.choose(Item("limp", 0))
    chosen.copy()
    chosen.delete()
    session.playback.seek(2.0)

    chosen.paste()

    assert content(session)["limp"] == [{"at": 2.0, "until": 2.5}]
    assert chosen.event == Item("limp", 0)


def test_an_event_is_mirrored_and_without_one_the_key_is(session: Session, chosen: Chosen) -> None:
    chosen.choose(Item("pushes", 0))
    chosen.mirror()
    assert content(session)["pushes"][0] == {
        "at": 1.0, "link": "left_wrist", "force": [0.0, -200.0, 0.0]
    }  # fmt: skip
    assert chosen.event == Item("pushes", 0)

    chosen.choose(None)
    session.playback.seek(0.5)
    chosen.mirror()
    assert content(session)["keys"][0]["poses"][0]["pose"] == {"left_elbow": 1.0}
    chosen.copy()
    session.playback.seek(2.0)
    chosen.paste()
    chosen.delete()
    assert [pose["at"] for pose in session.poses] == [0.5, 1.5]


def test_a_pose_by_hand_is_what_keys_are_of(session: Session, chosen: Chosen) -> None:
    chosen.choose(Item("pushes", 0))
    session.take_pose(session.pose)
    assert chosen.event is None


@pytest.mark.parametrize("item", [Item("pushes", 2), Item("keys", 2, 0), Item("keys", 0, 1)])
def test_what_is_not_there_any_more_is_said(chosen: Chosen, item: Item) -> None:
    with pytest.raises(MotionError, match="is not there any more"):
        chosen.move(item, 2.0)


@pytest.mark.parametrize("item", [Item("pushes", 12), Item("keys", 3, 1)])
def test_an_item_is_read_as_it_is_written(item: Item) -> None:
    assert parse_item(str(item)) == item


@pytest.mark.parametrize("text", ["", "keys/1", "pushes/-1", "pushes/1/2", "set/0", "pushes/1\n"])
def test_what_is_no_item_is_said(text: str) -> None:
    with pytest.raises(MotionError, match="is no key and no event"):
        parse_item(text)
