"""What pages ask for on the time line, and what of it is refused; and the rows of the marks."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from actuated_characters.timeline.document import Document
from actuated_characters.viewer.editor.key_marks import find_key_marks
from actuated_characters.viewer.editor.page import EditorPage
from actuated_characters.viewer.editor.session import Session
from actuated_characters.viewer.web.server import serving
from tests.actuated_characters.viewer.editor.test_page import told
from tests.support.physics import character

TEXT = """\
pushes: [{at: 1.0, link: chest, force: [0, 200, 0]}]
keys: [{name: body, poses: [{at: 0.5, pose: {right_elbow: 1.0}}, {at: 1.5, pose: {neck_x: 0.1}}]}]
"""


@pytest.fixture
def page(tmp_path: Path) -> Iterator[EditorPage]:
    file = tmp_path / "a.yaml"
    file.write_text(TEXT)
    with serving("127.0.0.1", 0) as (server, _, _):
        yield EditorPage(server, Session(character("humanoid"), Document(file)))


def ask(page: EditorPage, *said: Any) -> str:
    """Do what a page asks for; returns what is said of it."""
    page._panel.act(lambda: page._edits._do(json.dumps([0.5, *said])))
    page.step(0.0)
    return str(page._panel._told.content)


def test_a_drag_moves_an_event_to_the_next_time_that_is_round(page: EditorPage) -> None:
    assert ask(page, told(page)["document"], "move", "pushes/0", 2.009) == ""

    assert page._session.document.content["pushes"][0]["at"] == 2.0
    assert told(page)["chosen"] == "pushes/0"
    assert "chosen: pushes 1: 2 s" in page._panel._state.content
    assert ask(page, told(page)["document"], "choose", "") == ""
    assert told(page)["chosen"] == ""


def test_a_key_of_another_page_that_has_gone_meanwhile_is_not_moved(page: EditorPage) -> None:
    seen, marks = told(page)["document"], told(page)["version"]
    page._session.playback.seek(0.5)
    ask(page, seen, "delete")

    assert "has changed meanwhile" in ask(page, seen, "move", "keys/0/0", 3.0)
    assert [pose["at"] for pose in page._session.poses] == [1.5]
    assert told(page)["version"] > marks + 1, "the page has its mark where it was"
    ask(page, seen, "undo")
    assert [pose["at"] for pose in page._session.poses] == [0.5, 1.5]


@pytest.mark.parametrize(
    "said",
    [
        [],
        ["burn"],
        [["x"]],
        ["move", "pushes/0", "later"],
        ["move", "pushes/0"],
        ["move", "", 1.0],
        ["end", "pushes/0", 2.0],
        ["end", "keys/0/0", 2.0],
        ["end", "", 2.0],
        ["move", "pushes/0", -1.0],
        ["burn", "pushes/0", 1.0],
        ["choose", "pushes/9"],
        ["choose", {"a": 1}],
    ],
)
def test_nonsense_changes_nothing(page: EditorPage, said: list[Any]) -> None:
    document = told(page)["document"]
    assert ask(page, document, *said) != ""
    assert page._session.document.file.read_text() == TEXT


def test_text_that_is_no_list_is_refused(page: EditorPage) -> None:
    for text in ("", "{}", "3", "[", "[" * 900):
        page._panel.act(lambda text=text: page._edits._do(text))
        assert "not understood" in page._panel._told.content


def test_events_of_one_time_stand_one_below_the_other() -> None:
    spans = [{"at": 1.0, "until": 2.0}, {"at": 1.5, "until": 2.5}, {"at": 2.0, "until": 3.0}]
    layers = [{"poses": [{"at": 1.0, "pose": {}}]}, {"poses": [{"at": 1.0, "pose": {}}]}]
    content = {"reach": spans, "limp": [{"at": 1.0, "until": 2.0}], "keys": layers}

    marks = {mark.item: mark.lane for mark in find_key_marks(content, 5.0) if mark.item}

    assert marks == {
        "reach/0": 0, "reach/1": 1, "reach/2": 0, "limp/0": 2, "keys/0/0": 0, "keys/1/0": 1,
    }  # fmt: skip
