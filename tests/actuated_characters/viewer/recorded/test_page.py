"""A recorded run in a real browser: it plays, and what is seen can be saved and forked."""

import io
import signal
from pathlib import Path

import av
import numpy as np
import pytest

from actuated_characters.runs.plan import make_plan
from tests.actuated_characters.viewer.test_browser import SOON, address_of, body_of
from tests.support.browser import Browser, Pixels, needs_chromium
from tests.support.ros import Process, wait_until
from tests.support.runs import run_plan_here

pytestmark = [pytest.mark.slow, pytest.mark.sharing, needs_chromium]

LEAST_PIXELS = 100


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("runs") / "walk"
    plan = make_plan("humanoid", 1.0, {"reference": "clip", "clip": "walk"}, {}, {})
    run_plan_here(plan, directory)
    return directory


def load(browser: Browser, viewer: Process) -> Pixels:
    browser.open(address_of(viewer))
    wait_until(
        lambda: body_of(browser.pixels()).sum() > LEAST_PIXELS, "the walker on the page", SOON
    )
    return browser.pixels()


def text_of(browser: Browser) -> str:
    return str(browser.evaluate("document.body.innerText"))


def set_number(browser: Browser, label: str, value: str) -> None:
    """Type into the number beside a label."""
    browser.evaluate(f"""(() => {{
        const label = [...document.querySelectorAll("label")].find(
            each => each.innerText.trim() === {label!r});
        let box = label; let input = null;
        while (!input) {{ box = box.parentElement; input = box.querySelector("input"); }}
        const set = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set;
        set.call(input, {value!r});
        input.dispatchEvent(new Event("input", {{bubbles: true}}));
    }})()""")


def open_folder(browser: Browser, label: str) -> None:
    browser.evaluate(f"""(() => {{
        const found = [...document.querySelectorAll("*")].filter(
            each => each.innerText && each.innerText.trim() === {label!r}
                && !["BUTTON", "SPAN"].includes(each.tagName));
        found[found.length - 1].click();
    }})()""")


def test_a_run_plays_is_saved_and_is_forked(viewer: Process, browser: Browser, walk: Path) -> None:
    load(browser, viewer)
    wait_until(lambda: "state 240 of 240" in text_of(browser), "it has played by itself", SOON)
    browser.click("Start")
    wait_until(lambda: "state 0 of 240" in text_of(browser), "the start", SOON)
    before = browser.pixels()

    check_that_what_is_seen_is_saved_as_a_picture_and_as_a_film(browser, walk)
    check_that_it_plays_stops_and_steps(browser, before)
    check_that_a_fork_from_here_becomes_the_ghost(browser, walk)

    viewer.send(signal.SIGINT)
    assert viewer.wait() == 130


def check_that_it_plays_stops_and_steps(browser: Browser, before: Pixels) -> None:
    browser.click("Start")
    wait_until(lambda: "state 0 of 240" in text_of(browser), "the start", SOON)
    browser.click("+1")
    wait_until(lambda: "0.004 s, state 1 of 240" in text_of(browser), "the next state", SOON)
    browser.click("Play")
    wait_until(lambda: "state 240 of 240" in text_of(browser), "the end", SOON)
    moved = wait_until(
        lambda: (body_of(browser.pixels()) ^ body_of(before)).sum() > LEAST_PIXELS,
        "another pose",
        SOON,
    )
    assert moved
    browser.click("Start")
    wait_until(lambda: "state 0 of 240" in text_of(browser), "the start", SOON)


def check_that_what_is_seen_is_saved_as_a_picture_and_as_a_film(
    browser: Browser, walk: Path
) -> None:
    open_folder(browser, "Export")
    wait_until(lambda: browser.click("PNG"), "the button", SOON)
    picture = walk / "view-0.000s.png"
    wait_until(picture.exists, "the picture", SOON)

    from PIL import Image

    saved = np.asarray(Image.open(io.BytesIO(picture.read_bytes())).convert("RGB"))
    seen = browser.pixels()
    assert saved.shape[0] >= seen.shape[0] - 1
    ours, theirs = (body_of(each[: seen.shape[0] - 1]) for each in (saved, seen))
    assert (ours & theirs[:, : ours.shape[1]]).sum() > 0.8 * theirs.sum()

    set_number(browser, "To (s)", "0.1")
    browser.click("MP4")
    film = walk / "view-0.00-0.10s.mp4"
    wait_until(film.exists, "the film", 2.0 * SOON)
    with av.open(str(film)) as video:
        frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    assert len(frames) == 4  # 0, 1/30, 2/30 and 3/30 s
    assert body_of(frames[0]).sum() > LEAST_PIXELS
    assert (body_of(frames[0]) ^ body_of(frames[-1])).any()


def check_that_a_fork_from_here_becomes_the_ghost(browser: Browser, walk: Path) -> None:
    browser.click("+1")
    open_folder(browser, "Fork")
    fork = walk.with_name("walk-fork")
    wait_until(lambda: browser.click("Fork") and "fork" in text_of(browser), "the button", SOON)

    wait_until(lambda: f"forked: {fork}" in text_of(browser).replace("\\", ""), "the fork", SOON)
    assert (fork / "summary.json").exists()
    assert (fork / "summary.json").read_text() != ""
