"""Keys and events on the time line of `author`, by mouse and keyboard in a real browser."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from actuated_characters.timeline.document import Document
from tests.actuated_characters.viewer.editor.test_author import open_page
from tests.actuated_characters.viewer.recorded.test_page import text_of
from tests.actuated_characters.viewer.recorded.test_time_bar import (
    click_on,
    place_of,
    tap,
    until_at,
)
from tests.actuated_characters.viewer.test_browser import SOON
from tests.support.browser import CONTROL, Browser, needs_chromium, one_browser
from tests.support.ros import Processes, wait_until

pytestmark = [pytest.mark.slow, needs_chromium]

TEXT = """\
pushes: [{at: 1.0, link: right_wrist, force: [0, 200, 0]}]
limp: [{at: 3.0, until: 3.5}]
keys: [{name: body, poses: [{at: 0.5, pose: {right_elbow: 1.0}}]}]
"""
PUSH, KEY, LIMP = '[data-item="pushes/0"]', '[data-item="keys/0/0"]', '[data-item="limp/0"]'
WIDTH = "document.querySelector('#time-line .track').getBoundingClientRect().width / 5"


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    with one_browser(tmp_path) as browser:
        yield browser


def drag(
    browser: Browser, part: str, seconds: float, *, down: float = 0.0, aside: float = 0.0
) -> tuple[float, float]:
    """Hold a part of the time line, pixels aside of its middle, and move it.

    Returns where the mouse is then.
    """
    x, y = place_of(browser, part)
    x += aside
    browser.press(x, y)
    way = seconds * browser.evaluate(WIDTH)
    for step in range(1, 6):
        browser.mouse("mouseMoved", x + step / 5 * way, y + step / 5 * down, pressed=True)
    return x + way, y + down


def test_keys_and_events_are_dragged_chosen_and_edited_by_the_keyboard(
    processes: Processes, browser: Browser, tmp_path: Path
) -> None:
    file = tmp_path / "dance.yaml"
    file.write_text(TEXT)
    open_page(browser, processes.command("author", str(file)))
    shows = f"Boolean(document.querySelector('{PUSH}'))"
    wait_until(lambda: browser.evaluate(shows), "the marks", SOON)

    check_that_a_click_goes_to_the_nearest_time(browser)
    check_that_a_drag_that_is_given_up_moves_nothing(browser, file)
    check_that_a_drag_is_one_step_that_can_be_undone(browser, file)
    check_that_a_key_is_dragged(browser, file)
    check_that_an_end_is_dragged(browser, file)
    check_that_what_is_chosen_is_copied_and_deleted(browser, file)
    check_that_a_field_keeps_its_keys(browser, file)
    check_that_space_plays_after_a_button(browser, file)
    assert not browser.console


def times_of(file: Path, track: str) -> list[float]:
    return [event["at"] for event in Document(file).content.get(track, [])]


def until(file: Path, what: Any, wanted: Any) -> None:
    wait_until(lambda: what() == wanted, f"{wanted}, not {what()}: {file.read_text()}", SOON)


def until_shown_as_chosen(browser: Browser, part: str) -> None:
    shown = f"document.querySelector('{part}').classList.contains('chosen')"
    wait_until(lambda: browser.evaluate(shown), f"{part} as the one that is chosen", SOON)


def until_marked(browser: Browser, count: int) -> None:
    """Wait for so many marks of the track `limp`: before, the page knows of the last edit not."""
    shown = "document.querySelectorAll('[data-item^=limp]').length"
    wait_until(lambda: browser.evaluate(shown) == count, f"{count} marks", SOON)


def until_drawn_anew(browser: Browser) -> None:
    held = "document.querySelectorAll('#time-line .held').length"
    wait_until(lambda: browser.evaluate(held) == 0, "the marks after a drag", SOON)


def check_that_a_click_goes_to_the_nearest_time(browser: Browser) -> None:
    """Of each pixel of a range, on a time line whose times are 0.02 s apart."""
    rests = """new Promise(done => {
        const before = timeLine.track.clientWidth;
        setTimeout(() => done(timeLine.track.clientWidth === before), 600);
    })"""
    wait_until(lambda: browser.evaluate(rests), "the time line beside the panel", SOON)
    left, y = place_of(browser, ".track")
    width = browser.evaluate(WIDTH)
    left -= 2.5 * width
    for pixels in range(6):
        at = 2.0 + pixels / width
        click_on(browser, left + width * at, y)
        until_at(browser, f"{round(at / 0.02) * 0.02:.3f}")


def check_that_a_drag_that_is_given_up_moves_nothing(browser: Browser, file: Path) -> None:
    before = place_of(browser, PUSH)
    x, y = drag(browser, PUSH, 0.6)
    assert place_of(browser, PUSH)[0] == pytest.approx(x, abs=4.0)
    tap(browser, "Escape")
    assert place_of(browser, PUSH) == before
    browser.mouse("mouseReleased", x, y)

    x, y = drag(browser, PUSH, 0.6, down=-150.0)
    assert place_of(browser, PUSH) == before
    browser.mouse("mouseReleased", x, y)
    assert file.read_text() == TEXT


def check_that_a_drag_is_one_step_that_can_be_undone(browser: Browser, file: Path) -> None:
    before = place_of(browser, PUSH)
    browser.mouse("mouseReleased", *drag(browser, PUSH, 0.6))
    wait_until(lambda: "chosen: pushes 1: 1.6 s" in text_of(browser), "it is chosen", SOON)
    assert times_of(file, "pushes") == [1.6]
    until_shown_as_chosen(browser, PUSH)

    tap(browser, "z", keys=CONTROL)

    until(file, file.read_text, TEXT)
    wait_until(lambda: place_of(browser, PUSH) == before, "its mark where it was", SOON)


def check_that_a_key_is_dragged(browser: Browser, file: Path) -> None:
    browser.mouse("mouseReleased", *drag(browser, KEY, 1.0))
    until_at(browser, "1.500")
    assert "key 1 of 1" in text_of(browser)
    assert Document(file).content["keys"][0]["poses"][0]["at"] == 1.5
    until_shown_as_chosen(browser, KEY)


def check_that_an_end_is_dragged(browser: Browser, file: Path) -> None:
    shown = f"document.querySelector('{LIMP}').getBoundingClientRect()"
    half = browser.evaluate(f"{shown}.width / 2")
    left = place_of(browser, LIMP)[0] - half
    for way, end in ((0.3, 3.8), (-3.0, 3.02)):  # no less than a step after it begins
        browser.mouse("mouseReleased", *drag(browser, LIMP, way, aside=half - 3.0))
        until(file, lambda: Document(file).content["limp"], [{"at": 3.0, "until": end}])
        until_drawn_anew(browser)
        box = browser.evaluate(f"(({{x, width}}) => [x, width])({shown})")
        assert box == pytest.approx([left, browser.evaluate(WIDTH) * (end - 3.0)], abs=2.0)
        half = box[1] / 2
    tap(browser, "z", keys=CONTROL)
    until(file, lambda: Document(file).content["limp"], [{"at": 3.0, "until": 3.8}])
    tap(browser, "z", keys=CONTROL)
    until(file, lambda: Document(file).content["limp"], [{"at": 3.0, "until": 3.5}])
    least = 0.4 * browser.evaluate(WIDTH)
    wait_until(lambda: browser.evaluate(f"{shown}.width") > least, "its mark as before", SOON)


def check_that_what_is_chosen_is_copied_and_deleted(browser: Browser, file: Path) -> None:
    click_on(browser, *place_of(browser, LIMP))
    wait_until(lambda: "chosen: limp 1" in text_of(browser), "it is chosen", SOON)
    tap(browser, "c", keys=CONTROL)
    x, y = place_of(browser, ".track")
    click_on(browser, x - 0.5 * browser.evaluate(WIDTH), y)
    until_at(browser, "2.000")
    wait_until(lambda: "chosen" not in text_of(browser), "nothing is chosen", SOON)
    tap(browser, "v", keys=CONTROL)
    until(file, lambda: times_of(file, "limp"), [2.0, 3.0])
    until_marked(browser, 2)

    tap(browser, "Delete")

    until(file, lambda: times_of(file, "limp"), [3.0])
    until_marked(browser, 1)
    click_on(browser, *place_of(browser, PUSH))
    wait_until(lambda: "chosen: pushes 1" in text_of(browser), "it is chosen", SOON)
    browser.click("Mirror")
    until(file, lambda: Document(file).content["pushes"][0]["link"], "left_wrist")


def check_that_a_field_keeps_its_keys(browser: Browser, file: Path) -> None:
    before = file.read_text()
    browser.evaluate("document.querySelector('input[type=text]').focus()")
    tap(browser, "Delete")
    tap(browser, "z", keys=CONTROL)
    browser.evaluate("new Promise(done => setTimeout(done, 500))")
    assert file.read_text() == before


def check_that_space_plays_after_a_button(browser: Browser, file: Path) -> None:
    """A button that was clicked has the keyboard, but no use for it."""
    button = """[...document.querySelectorAll("button, label")].find(
        each => each.innerText.trim() === "Copy").getBoundingClientRect()"""
    box = browser.evaluate(f"(({{x, y, width, height}}) => [x, y, width, height])({button})")
    click_on(browser, box[0] + box[2] / 2, box[1] + box[3] / 2)
    before = file.read_text()
    plays = "document.querySelector('#time-line .play').getAttribute('aria-label')"
    assert browser.evaluate(plays) == "Play"

    tap(browser, "Space")

    wait_until(lambda: browser.evaluate(plays) == "Pause", "it plays", SOON)
    tap(browser, "Space")
    wait_until(lambda: browser.evaluate(plays) == "Play", "it stands", SOON)
    assert file.read_text() == before
