"""The command `author` in a real browser: a drag, a key, and a kill that loses nothing."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from actuated_characters.timeline.document import Document
from tests.actuated_characters.viewer.recorded.test_page import text_of
from tests.actuated_characters.viewer.test_browser import (
    LEAST_PIXELS,
    SOON,
    address_of,
    body_of,
    drag,
    grip_of,
)
from tests.support.browser import Browser, needs_chromium, one_browser
from tests.support.ros import Process, Processes, wait_until

pytestmark = [pytest.mark.slow, needs_chromium]


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    with one_browser(tmp_path) as browser:
        yield browser


def open_page(browser: Browser, author: Process) -> None:
    browser.open(address_of(author))
    wait_until(lambda: body_of(browser.pixels()).sum() > LEAST_PIXELS, "the body", SOON)


def test_a_dragged_pose_is_a_key_that_outlives_the_process(
    processes: Processes, browser: Browser, tmp_path: Path
) -> None:
    file = tmp_path / "dance.yaml"
    author = processes.command("author", str(file))
    open_page(browser, author)
    x, y = grip_of(body_of(browser.pixels()))
    drag(browser, x, y, steps=8)
    browser.mouse("mouseReleased", x + 64, y)
    wait_until(lambda: "posed by hand" in text_of(browser), "a pose by hand", SOON)

    browser.click("Key")
    wait_until(lambda: "key 1 of 1" in text_of(browser), "a key", SOON)
    author.send(signal.SIGKILL)
    author.wait()
    browser.open("about:blank")  # a page that is open meets the next one on this port

    written = Document(file).content["keys"][0]["poses"]
    assert [pose["at"] for pose in written] == [0.0]
    again = processes.command("author", str(file))
    open_page(browser, again)
    wait_until(lambda: "key 1 of 1" in text_of(browser), "the key again", SOON)
    marks = "document.querySelectorAll('#time-line .keyframe').length"
    wait_until(lambda: browser.evaluate(marks) == 1, "its mark", SOON)
    browser.click("Delete")
    wait_until(lambda: "no keys yet" in text_of(browser), "no key any more", SOON)
    browser.click("Undo")
    wait_until(lambda: "key 1 of 1" in text_of(browser), "the key once more", SOON)
    assert not browser.console
    again.send(signal.SIGINT)
    assert again.wait() == 130


def test_mistakes_are_one_line(processes: Processes, tmp_path: Path) -> None:
    file = tmp_path / "push.yaml"
    file.write_text("character: kuka\npushes: 3\n")
    wrong = processes.command("author", str(file))
    assert wrong.wait() == 1
    assert wrong.stderr == f"error: {file}: pushes must be a list\n"
    file.write_text("character: kuka\n")
    other = processes.command("author", str(file), "--character", "humanoid")
    assert other.wait() == 1
    assert "is of the character 'kuka'; leave --character out" in other.stderr
