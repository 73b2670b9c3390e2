"""Takes on the page of a timeline: made, seen, compared, posed from; and what goes wrong."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.bags.whole import read_whole
from actuated_characters.timeline import edits
from actuated_characters.timeline.document import Document
from actuated_characters.timeline.takes import takes_of
from actuated_characters.viewer.editor.items import Item
from actuated_characters.viewer.editor.page import EditorPage
from actuated_characters.viewer.editor.session import Session
from actuated_characters.viewer.editor.shown_takes import NO_TAKE
from actuated_characters.viewer.web.server import serving
from msgs_config.errors import MotionError
from tests.actuated_characters.viewer.editor.test_page import click, drag
from tests.support.physics import character

HUMANOID = character("humanoid")
TEXT = "duration: 0.6\nrun: {planner: none}\nclips: [{at: 0.0, clip: walk}]\n"
DEADLINE = 120.0  # s


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "moves.yaml"
    path.write_text(TEXT, encoding="utf-8")
    return path


@pytest.fixture
def page(file: Path) -> Iterator[EditorPage]:
    session = Session(HUMANOID, Document(file))
    with serving("127.0.0.1", 0) as (server, _, _):
        page = EditorPage(server, session)
        yield page
        page.takes.close()


def finish(page: EditorPage) -> set[str]:
    """Go on until the take is there; returns what was said meanwhile."""
    end, said = time.monotonic() + DEADLINE, set[str]()
    while page.takes.making is not None and time.monotonic() < end:
        page.step(0.0)
        said.add(page._panel._told.content)
        time.sleep(0.05)
    assert page.takes.making is None
    page.step(0.0)
    return said


@pytest.mark.slow
def test_a_take_is_made_seen_and_compared_with_another(page: EditorPage, file: Path) -> None:
    click(page, "Simulate")
    said = finish(page)
    assert any(line.startswith("simulated 0.") and "of 0.6 s" in line for line in said)
    assert page.takes.chosen == "1"
    assert "take 1: 0.6 s from the beginning" in page._panel._told.content
    page._session.playback.seek(0.4)
    page.step(0.0)
    (recording,) = read_whole(file.with_suffix(".takes") / "1")
    row = int(np.searchsorted(recording.times, page._session.time))
    np.testing.assert_allclose(page._drawn.origins[0], recording.position[row, :3], atol=1e-6)

    file.write_text(TEXT + "pushes: [{at: 0.3, link: chest, force: [0, 400, 0]}]\n")
    click(page, "Read again")
    page._panel._take_panel._title.value = "pushed"
    click(page, "Simulate")
    finish(page)

    assert page.takes.chosen == "2, of 1: pushed"
    assert [take.since for take in takes_of(str(file)).all()] == [0.0, 0.3]
    page._session.playback.seek(0.6)
    assert np.abs(page.takes.position(0.6) - recording.position[-1]).max() > 0.01
    page.takes.compare("1")
    sample = page.takes.sample(0.6)
    assert sample is not None and sample.reference is not None
    np.testing.assert_array_equal(sample.reference, recording.position[-1])


@pytest.mark.slow
def test_what_is_edited_is_seen_and_the_next_take_goes_on_from_the_one_before(
    page: EditorPage,
) -> None:
    session, push = page._session, {"at": 0.5, "link": "chest", "force": [0.0, 300.0, 0.0]}
    seen = page._panel._take_panel._take
    click(page, "Simulate")
    finish(page)
    session.edit(edits.add_event("pushes", push))
    page.step(0.0)
    assert (page.takes.chosen, page.takes.run, seen.value) == (NO_TAKE, None, NO_TAKE)
    click(page, "Simulate")
    finish(page)
    assert page.takes.chosen == "2, of 1"

    page.takes.choose("1")
    page.step(0.0)
    page._panel.chosen.move(Item("pushes", 0), 0.4)
    page.step(0.0)
    click(page, "Simulate")
    page.step(0.0)
    page._panel.chosen.move(Item("pushes", 0), 0.3)
    finish(page)

    assert [take.parent for take in takes_of(str(session.document.file)).all()] == ["", "1", "1"]
    assert page.takes.chosen == NO_TAKE, "it was edited meanwhile"
    assert "choose it in Seen" in page._panel._told.content


@pytest.mark.slow
def test_a_key_has_the_pose_of_the_take_that_is_seen(page: EditorPage) -> None:
    click(page, "Simulate")
    finish(page)
    page._session.playback.seek(0.4)
    page.step(0.0)
    seen = page.takes.position(page._session.time)
    assert seen is not None

    click(page, "Key")

    assert page.takes.chosen == NO_TAKE
    assert list(page._session.poses[0]["pose"].values()) == pytest.approx(seen, abs=2e-6)


@pytest.mark.slow
def test_a_pose_is_taken_from_a_take(page: EditorPage) -> None:
    click(page, "Simulate")
    finish(page)
    page._session.playback.seek(0.4)
    page.step(0.0)
    seen = page.takes.position(page._session.time)
    assert seen is not None

    drag(page, (0.0, 0.0, 0.0))

    assert page.takes.chosen == NO_TAKE and page._session.is_posed
    assert page._session.pose.position[0] == pytest.approx(seen[0], abs=1e-6)
    np.testing.assert_allclose(page._session.pose.position[6:], seen[6:], atol=0.02)


@pytest.mark.slow
def test_what_cannot_be_simulated_is_said(page: EditorPage, file: Path) -> None:
    file.write_text(TEXT.replace("walk", "wlak"))

    click(page, "Simulate")
    with pytest.raises(MotionError, match="a take is being made"):
        page.takes.simulate("")
    finish(page)

    assert "wlak" in page._panel._told.content
    assert page.takes.chosen == NO_TAKE
    assert not takes_of(str(file)).all()


def test_a_cancelled_take_leaves_nothing(page: EditorPage, file: Path) -> None:
    click(page, "Simulate")
    click(page, "Cancel")

    assert page.takes.making is None
    folder = file.with_suffix(".takes")
    assert not folder.exists() or not list(folder.iterdir())
