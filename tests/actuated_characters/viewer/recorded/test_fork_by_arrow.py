"""An arrow that is drawn on the body of a recorded run, in a real browser, becomes a fork."""

from pathlib import Path

import numpy as np
import pytest

from actuated_characters.bags.recording import read_recording
from actuated_characters.viewer.drawing.framing import EYE, LOOK_AT
from tests.actuated_characters.viewer.recorded.test_page import open_folder, text_of
from tests.actuated_characters.viewer.recorded.test_time_bar import (
    make_walk,
    open_bar,
    row_of,
    tap,
    until_at,
)
from tests.actuated_characters.viewer.test_browser import (
    LEAST_PIXELS,
    SOON,
    body_of,
    drag,
    grip_of,
)
from tests.support.browser import SHIFT, Browser, needs_chromium
from tests.support.ros import Process, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.sharing, needs_chromium]

ROW = 48  # of the state of 0.2 s, in which the arrow is drawn


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    return make_walk(tmp_path / "walk")


def go_to_the_row(browser: Browser) -> None:
    tap(browser, "Home")
    until_at(browser, "0.000")
    for time in ("0.100", "0.200"):
        tap(browser, "ArrowRight", keys=SHIFT)
        until_at(browser, time)
    assert row_of(browser) == ROW


def field(label: str) -> str:
    """An expression of JavaScript for the text field beside a label."""
    return f"""(() => {{
        let box = [...document.querySelectorAll("label")].find(
            each => each.innerText.trim() === {label!r});
        while (!box.querySelector("input")) box = box.parentElement;
        return box.querySelector("input");
    }})()"""


def type_into(browser: Browser, label: str, value: str) -> None:
    browser.evaluate(f"""(input => {{
        const set = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set;
        set.call(input, {value!r});
        input.dispatchEvent(new Event("input", {{bubbles: true}}));
    }})({field(label)})""")


def draw_arrow(browser: Browser, then: str = "Fork from here") -> str:
    """Drag the body to the right, let go, and wait; what the field of the push says then."""
    wait_until(lambda: body_of(browser.pixels()).sum() > LEAST_PIXELS, "the walker", SOON)
    x, y = grip_of(body_of(browser.pixels()))
    drag(browser, x, y, steps=8)
    wait_until(lambda: "push on " in text_of(browser), "what the arrow means", SOON)
    assert not browser.click("Fork from here")  # the arrow is still being drawn
    browser.mouse("mouseReleased", x + 64, y)
    wait_until(lambda: then in text_of(browser), then, SOON)
    return str(browser.evaluate(f"{field('Push')}.value"))


@pytest.mark.nightly
def test_an_arrow_on_the_paused_body_becomes_a_push_of_a_fork_that_plays_beside(
    viewer: Process, browser: Browser, walk: Path
) -> None:
    open_bar(browser, viewer)
    until_at(browser, "1.000")
    go_to_the_row(browser)
    open_folder(browser, "Fork")

    check_that_a_mistake_is_one_line(browser)
    check_that_an_arrow_goes_with_its_moment(browser)
    check_that_a_fork_can_be_cancelled(browser, walk)
    check_that_the_fork_at_once_has_the_push_of_the_arrow(browser, walk)
    assert not browser.console


def check_that_a_mistake_is_one_line(browser: Browser) -> None:
    type_into(browser, "Push", "nose:1,2,3")
    wait_until(lambda: browser.click("Fork"), "the button", SOON)
    wait_until(lambda: "error: push: unknown link 'nose'" in text_of(browser), "the fault", SOON)
    assert "Traceback" not in text_of(browser)
    type_into(browser, "Push", "")


def check_that_an_arrow_goes_with_its_moment(browser: Browser) -> None:
    assert draw_arrow(browser) != ""
    tap(browser, "ArrowRight")
    wait_until(lambda: "Fork from here" not in text_of(browser), "no arrow any more", SOON)
    assert browser.evaluate(f"{field('Push')}.value") == ""
    tap(browser, "ArrowLeft")
    until_at(browser, "0.200")


def check_that_a_fork_can_be_cancelled(browser: Browser, walk: Path) -> None:
    draw_arrow(browser)
    browser.click("Fork from here")
    wait_until(lambda: "forking at 0.2 s" in text_of(browser), "the fork begins", SOON)
    wait_until(lambda: browser.click("Cancel"), "the button", SOON)
    wait_until(lambda: "the fork is cancelled" in text_of(browser), "its end", SOON)
    assert not (walk.with_name("walk-fork") / "summary.json").exists()
    wait_until(lambda: "Forking" not in text_of(browser), "nothing to be cancelled", SOON)
    wait_until(lambda: "Fork from here" in text_of(browser), "the offer for the arrow", SOON)
    wait_until(lambda: browser.click("Discard"), "the button", SOON)
    wait_until(lambda: "Fork from here" not in text_of(browser), "no arrow any more", SOON)


def check_that_the_fork_at_once_has_the_push_of_the_arrow(browser: Browser, walk: Path) -> None:
    assert browser.click("At once")
    asked = draw_arrow(browser, "forking at 0.2 s")
    wait_until(lambda: "the ghost" in text_of(browser), "the fork", SOON)

    (fork,) = (each for each in walk.parent.glob("walk-fork*") if (each / "summary.json").exists())
    wait_until(lambda: f"walk\u2003▬ {fork.name}" in text_of(browser), "the legend", SOON)
    until_at(browser, "1.000")  # it has played on
    link, _, numbers = asked.partition(":")
    force = np.array([float(number) for number in numbers.split(",")])
    recording = read_recording(fork)
    original = read_recording(walk)
    shift = int(np.searchsorted(original.stamps_ns, recording.stamps_ns[0]))
    pushes = recording.applied_wrench[ROW - shift]
    before = recording.applied_wrench[ROW - shift - 1]
    assert pushes is not None and pushes.links == (link,)
    np.testing.assert_allclose(pushes.wrenches[0, :3], force)
    assert before is None or not before.links
    # half a metre of the page is some 100 pixels, of which 64 were dragged
    assert 20.0 < np.linalg.norm(force) < 400.0
    right = np.cross(np.subtract(LOOK_AT, EYE), (0.0, 0.0, 1.0))
    assert force @ (right / np.linalg.norm(right)) > 0.5 * np.linalg.norm(force)
    # the push of the run, which is repeated, and the new one, in the time line's lane of the ghost
    marks = "document.querySelectorAll('#time-line .ghost.push').length"
    wait_until(lambda: browser.evaluate(marks) == 2, "the pushes of the ghost", SOON)
