"""The page of a timeline that is made, without a browser: drags, buttons, forms and marks."""

import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from actuated_characters.timeline.document import Document
from actuated_characters.viewer.editor.page import EditorPage
from actuated_characters.viewer.editor.session import Session
from actuated_characters.viewer.web.server import serving
from tests.support.physics import character
from tests.support.ros import wait_until

HUMANOID = character("humanoid")
WRIST = [link.name for link in HUMANOID.links].index("right_wrist")

PUSH = {"at": 2.0, "link": "chest", "force": [0.0, 200.0, 0.0]}


@pytest.fixture
def session(tmp_path: Path) -> Session:
    return Session(HUMANOID, Document(tmp_path / "a.yaml", "character: humanoid\n"))


@pytest.fixture
def page(session: Session) -> Iterator[EditorPage]:
    with serving("127.0.0.1", 0) as (server, _, _):
        yield EditorPage(server, session)


def drag(page: EditorPage, way: tuple[float, float, float], *phases: str, client: int = 1) -> None:
    """Drag the right hand by a way in m, as a page's events say it."""
    handle = next(each for each in page._handles if each.row == WRIST)
    start = page._drawn.point(WRIST, np.array(handle.point))
    for phase in phases or ("start", "update", "end"):
        event: Any = SimpleNamespace(
            phase=phase,
            client_id=client,
            start_position=tuple(start),
            end_position=tuple(start + way),
        )
        page._dragged(handle, event)
    page.step(0.0)


def click(page: EditorPage, label: str) -> None:
    """Do what a button of the panel does."""
    for group in page._server.gui._gui_input_handle_from_uuid.values():
        if label in getattr(group, "options", ()):
            group._impl.value = label
            for change in group._impl.update_cb:
                _run(change)
            break
    else:
        raise AssertionError(f"no button {label}")
    page.step(0.0)


def _run(change: Any) -> None:
    """Run a callback of viser's to its end, as its server does for a client."""
    with suppress(StopIteration):
        change(SimpleNamespace(client_id=1, client=None)).send(None)


def told(page: EditorPage) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(page._bar._text)
    return found


def test_a_drag_poses_the_body_and_key_writes_it(page: EditorPage, session: Session) -> None:
    before = page._drawn.origins[WRIST].copy()

    drag(page, (0.3, -0.1, 0.3))
    assert page._drawn.origins[WRIST] == pytest.approx(
        before + np.array((0.3, -0.1, 0.3)), abs=2e-3
    )
    assert "posed by hand" in page._panel._state.content
    click(page, "Key")

    assert "key 1 of 1" in page._panel._state.content
    assert Document(session.document.file).content["keys"][0]["poses"][0]["at"] == 0.0
    assert [mark["kind"] for mark in told(page)["marks"]] == ["keyframe", "end"]


def test_a_drag_of_another_page_does_not_disturb_one(page: EditorPage) -> None:
    drag(page, (0.2, 0.0, 0.2), "start")
    pose = page._session.pose.position.copy()
    drag(page, (0.0, 0.0, 0.0), "update", "end", client=2)

    assert page._session.pose.position.tolist() == pose.tolist()


def test_buttons_undo_redo_mirror_and_say_what_is_wrong(page: EditorPage, session: Session) -> None:
    click(page, "Delete")
    assert "no key at 0 s" in page._panel._told.content
    drag(page, (0.3, 0.0, 0.3))
    click(page, "Key")
    assert not page._panel._told.visible
    newest = session.document.text

    click(page, "Mirror")
    assert session.document.text != newest
    click(page, "Undo")
    assert session.document.file.read_text() == newest
    click(page, "Undo")
    assert session.document.file.read_text() == "character: humanoid\n"
    click(page, "Redo")
    assert session.document.file.read_text() == newest


def test_an_event_of_a_form_is_added_marked_and_deleted(page: EditorPage, session: Session) -> None:
    form = page._panel._form
    session.playback.seek(2.0)
    form._track.value = "pushes"
    form._show("pushes")
    form._handles["pushes"]["link"].value = "chest"
    click(page, "Add event")
    assert session.document.content["pushes"] == [
        {"at": 2.0, "link": "chest", "force": [0.0, 200.0, 0.0]}
    ]
    assert "push" in [mark["kind"] for mark in told(page)["marks"]]
    assert page._panel._event.value == "pushes 1: 2 s, link chest, force 0 200 0"

    form._handles["pushes"]["link"].value = "neck"
    session.playback.seek(3.0)
    click(page, "Add event")
    assert page._panel._event.value == "pushes 2: 3 s, link neck, force 0 200 0"
    session.playback.seek(1.0)
    click(page, "Move here")  # the one that was added last, and is the first one now
    assert page._panel._event.value == "pushes 1: 1 s, link neck, force 0 200 0"
    assert [each["at"] for each in session.document.content["pushes"]] == [1.0, 2.0]
    session.playback.seek(4.0)
    click(page, "Copy here")
    click(page, "Delete event")
    click(page, "Go")
    click(page, "Delete event")
    click(page, "Delete event")
    assert "pushes" not in session.document.content


def test_the_list_may_be_redrawn_before_a_choice_in_it_is_heard(
    page: EditorPage, session: Session
) -> None:
    for track, event in (("limp", {"at": 1.0, "until": 2.0}), ("pushes", PUSH)):
        page._panel.chosen.add(track, event)
    page.step(0.0)
    listed = page._panel._event
    limp = next(line for line in listed.options if line.startswith("limp"))
    listed._impl.value = limp
    for update in listed._impl.update_cb:
        _run(update)
    page._panel.show()  # which has the push in the list, as it is still chosen

    session.playback.seek(3.0)
    click(page, "Move here")

    assert session.document.content["limp"] == [{"at": 3.0, "until": 4.0}]
    assert session.document.content["pushes"] == [PUSH]


def test_what_lasts_no_time_is_refused_once_it_is_added(page: EditorPage, session: Session) -> None:
    form = page._panel._form
    form._track.value = "limp"
    form._show("limp")
    form._handles["limp"]["until"].value = 0.0  # as 0.5 begins
    click(page, "Add event")

    assert "lasts (s) is 0; it must be 0.02 or more" in page._panel._told.content
    assert "limp" not in session.document.content


def test_a_length_of_two_digits_is_one_edit(page: EditorPage, session: Session) -> None:
    length = page._panel._take_panel
    for seconds in (1.0, 12.0):
        length._type_duration(seconds)
        page.step(0.0)
        assert "duration" not in session.document.content

    wait_until(lambda: "duration" in session.document.content, "it", step=lambda: page.step(0.0))

    assert session.document.content["duration"] == 12.0
    click(page, "Undo")
    assert "duration" not in session.document.content


def test_the_time_line_grows_with_what_is_on_it(page: EditorPage, session: Session) -> None:
    assert told(page)["last"] == pytest.approx(5.0)
    session.playback.seek(5.0)
    click(page, "Key")

    assert told(page)["last"] == pytest.approx(10.0)
    assert page._panel.time.slider.max == pytest.approx(10.0)


def test_a_joint_is_set_by_its_number_within_its_limits(page: EditorPage, session: Session) -> None:
    fields = page._panel._joint
    fields._joint.value = "right_elbow"
    page.step(0.0)
    assert fields._fields[0].label == "right_elbow (rad)"

    fields._set(0, 5.0)
    page.step(0.0)

    assert session.pose.position[HUMANOID.layout.joint("right_elbow").start] == 3.14
    assert fields._fields[0].value == 3.14


@pytest.mark.slow
@pytest.mark.parametrize("name", ["franka_panda", "laikago", "pendulum"])
def test_any_character_can_be_posed(name: str, tmp_path: Path) -> None:
    whole = character(name)
    session = Session(whole, Document(tmp_path / "a.yaml", f"character: {name}\n"))
    with serving("127.0.0.1", 0) as (server, _, _):
        page = EditorPage(server, session)
        handle = page._handles[-1]
        start = page._drawn.point(handle.row, np.array(handle.point))
        for phase in ("start", "end"):
            event: Any = SimpleNamespace(
                phase=phase,
                client_id=1,
                start_position=tuple(start),
                end_position=tuple(start + np.array((0.02, 0.0, 0.05))),
            )
            page._dragged(handle, event)
        page.step(0.0)
        click(page, "Key")

    named = Document(session.document.file).content["keys"][0]["poses"][0]["pose"]
    assert list(named) == list(whole.layout.dof_names)
    assert not np.allclose(list(named.values()), whole.rest_position, atol=1e-6)


def change(page: EditorPage, handle: Any, value: Any) -> None:
    """Do what a client does who sets a control of the panel."""
    handle._impl.value = value
    for update in handle._impl.update_cb:
        _run(update)
    page.step(0.0)


def test_a_layer_stays_until_it_is_told_to_give_way(page: EditorPage, session: Session) -> None:
    after = page._panel._after
    assert after.disabled
    click(page, "Key")
    assert (after.value, after.disabled) == ("it stays", False)

    change(page, after, "it gives way")
    assert "out" not in session.document.content["keys"][0]
    click(page, "Undo")
    assert after.value == "it stays"


def test_behaviour_and_duration_are_those_of_the_file(page: EditorPage, session: Session) -> None:
    takes = page._panel._take_panel
    change(page, takes._behaviour, "active_ragdoll")
    change(page, takes._length, 9.0)
    wait_until(lambda: "duration" in session.document.content, "it", step=lambda: page.step(0.0))
    assert session.document.content["run"] == {"behaviour": "active_ragdoll"}
    assert session.document.content["duration"] == 9.0

    session.document.file.write_text("run: {behaviour: state_machine, planner: none}\n")
    click(page, "Read again")
    assert (takes._behaviour.value, takes._length.value) == ("state_machine", 0.0)
    change(page, takes._behaviour, "reactive")
    assert session.document.content["run"] == {"behaviour": "reactive", "planner": "none"}


def test_an_event_lasts_from_the_time_at_which_it_is_added(
    page: EditorPage, session: Session
) -> None:
    form = page._panel._form
    form._track.value = "steering"
    form._show("steering")
    form._handles["steering"]["until"].value = 1.2
    session.playback.seek(2.4)
    click(page, "Add event")

    (event,) = session.document.content["steering"]
    assert (event["at"], event["until"]) == (2.4, 3.6)
