"""The time line at the bottom of a recorded run's page, in a real browser."""

import json
from pathlib import Path

import pytest

from actuated_characters.runs.plan import make_plan
from actuated_characters.runs.planned.inputs import PlannedInputs
from actuated_characters.runs.planned.wrenches import parse_push
from tests.actuated_characters.viewer.test_browser import SOON, address_of
from tests.support.browser import SHIFT, Browser, needs_chromium
from tests.support.ros import Process, Processes, wait_until
from tests.support.runs import run_plan_here

pytestmark = [pytest.mark.slow, pytest.mark.sharing, needs_chromium]

PUSH = "root:0,90,0@0.5"


def make_walk(directory: Path) -> Path:
    """One second, 240 ticks, with a push from 0.5 to 0.6 s."""
    reference, simulator = {"reference": "clip", "clip": "walk"}, {"wrench_duration": 0.1}
    plan = make_plan("humanoid", 1.0, reference, simulator, {"root_assistance": True})
    run_plan_here(plan, directory, PlannedInputs([parse_push(PUSH, plan)]))
    return directory


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_walk(tmp_path_factory.mktemp("runs") / "walk")


def open_bar(browser: Browser, viewer: Process) -> None:
    browser.open(address_of(viewer))
    shows = "Boolean(document.querySelector('#time-line:not([hidden]) .end'))"
    wait_until(lambda: browser.evaluate(shows), "the time line", SOON)


def time_of(browser: Browser) -> str:
    """The present time as the time line has it."""
    return str(browser.evaluate("document.querySelector('#time-line .time').innerText"))


def seconds_of(browser: Browser) -> float:
    """The present time as it is told to those who do not see the page, s."""
    value = "document.querySelector('#time-line [role=slider]').getAttribute('aria-valuenow')"
    return float(browser.evaluate(value))


def until_at(browser: Browser, time: str) -> None:
    wait_until(lambda: time_of(browser).startswith(f"{time} /"), f"{time} s", SOON)


def place_of(browser: Browser, selector: str) -> tuple[float, float]:
    """The pixel in the middle of a part of the time line."""
    x, y = browser.evaluate(f"""(() => {{
        const box = document.querySelector('#time-line {selector}').getBoundingClientRect();
        return [box.x + box.width / 2, box.y + box.height / 2];
    }})()""")
    return x, y


def click_on(browser: Browser, x: float, y: float) -> None:
    browser.press(x, y)
    browser.mouse("mouseReleased", x, y)


def tap(browser: Browser, key: str, *, keys: int = 0) -> None:
    browser.key(key, keys=keys)
    browser.release(key, keys=keys)


def row_of(browser: Browser) -> int:
    """The number of the present state, as the panel has it."""
    found = browser.evaluate("document.body.innerText.match(/state (\\d+) of/)?.[1]")
    return int(found)


@pytest.mark.nightly
def test_the_time_line_says_what_happened_and_goes_where_it_is_asked_to(
    viewer: Process, browser: Browser
) -> None:
    open_bar(browser, viewer)
    until_at(browser, "1.000")  # it has played by itself

    check_that_a_mark_says_what_it_is_and_a_click_goes_there(browser)
    check_that_a_drag_goes_along(browser)
    check_that_keys_play_stop_and_step(browser)
    check_that_a_field_keeps_its_keys(browser)
    check_that_a_reload_and_another_page_show_the_same(browser, viewer)
    assert not browser.console


def check_that_a_mark_says_what_it_is_and_a_click_goes_there(browser: Browser) -> None:
    x, y = place_of(browser, ".push")
    browser.mouse("mouseMoved", x, y)
    tip = "document.querySelector('#time-line .tip').innerText"
    wait_until(lambda: "push on root for 0.1 s: up to 90 N" in browser.evaluate(tip), "a tip", SOON)
    label = browser.evaluate("document.querySelector('#time-line .push').ariaLabel")
    assert label.startswith("0.50 s: push on root for 0.1 s")

    click_on(browser, x, y)

    until_at(browser, "0.500")
    assert row_of(browser) == 120


def check_that_a_drag_goes_along(browser: Browser) -> None:
    box = browser.evaluate(
        "JSON.stringify(document.querySelector('#time-line .track').getBoundingClientRect())"
    )
    track = json.loads(box)
    y = track["y"] + 0.9 * track["height"]
    browser.press(track["x"] + 0.1 * track["width"], y)
    wait_until(lambda: 0.09 < seconds_of(browser) < 0.11, "0.1 s", SOON)
    x = track["x"] + 0.75 * track["width"]
    browser.mouse("mouseMoved", x, y, pressed=True)
    browser.mouse("mouseReleased", x, y)

    wait_until(lambda: 0.74 < seconds_of(browser) < 0.76, "0.75 s", SOON)


def check_that_keys_play_stop_and_step(browser: Browser) -> None:
    for key, time in (("Home", "0.000"), ("End", "1.000")):
        tap(browser, key)
        until_at(browser, time)
    tap(browser, "Home")
    until_at(browser, "0.000")
    for key, time in (("ArrowRight", "0.004"), ("ArrowRight", "0.008"), ("ArrowLeft", "0.004")):
        tap(browser, key)
        until_at(browser, time)
    tap(browser, "ArrowRight", keys=SHIFT)
    until_at(browser, "0.104")
    tap(browser, "Home")
    until_at(browser, "0.000")
    tap(browser, "Space")
    until_at(browser, "1.000")


def check_that_a_field_keeps_its_keys(browser: Browser) -> None:
    assert browser.evaluate("""(() => {
        const field = [...document.querySelectorAll("input")].find(
            each => each.offsetParent && each.value === "1");
        field.focus();
        return document.activeElement === field;
    })()""")
    tap(browser, "Home")
    tap(browser, "ArrowLeft")
    assert time_of(browser).startswith("1.000 /")
    browser.evaluate("document.activeElement.blur()")


def check_that_a_reload_and_another_page_show_the_same(browser: Browser, viewer: Process) -> None:
    x, y = place_of(browser, ".push")
    click_on(browser, x, y)
    until_at(browser, "0.500")

    other = browser.another_page()
    other.call("Page.bringToFront")
    open_bar(other, viewer)
    until_at(other, "0.500")
    tap(other, "Home")
    until_at(other, "0.000")

    browser.call("Page.bringToFront")
    until_at(browser, "0.000")
    assert row_of(browser) == 0
    open_bar(browser, viewer)
    until_at(browser, "0.000")


NEVER_CAPTURED = """(() => {  // a made pointer cannot be captured
    const track = document.querySelector("#time-line .track");
    track.setPointerCapture = () => {};
    window.point = (kind, x) => track.dispatchEvent(new PointerEvent(kind, {clientX: x}));
})()"""


@pytest.mark.nightly
def test_a_drag_that_is_cancelled_leaves_the_next_click_its_mark(
    viewer: Process, browser: Browser
) -> None:
    open_bar(browser, viewer)
    until_at(browser, "1.000")
    browser.evaluate(NEVER_CAPTURED)
    x, _ = place_of(browser, ".push")
    for kind, at in (("down", x - 200), ("move", x - 150), ("cancel", x - 150)):
        browser.evaluate(f"point('pointer{kind}', {at})")
    wait_until(lambda: seconds_of(browser) < 0.45, "the drag", SOON)

    browser.evaluate(f"point('pointerdown', {x}), point('pointerup', {x})")

    until_at(browser, "0.500")
    browser.evaluate("new Promise(done => setTimeout(done, 500))")
    assert row_of(browser) == 120


# Two answers to what the page asks for, of which the first one comes last.
ANSWERS = """(async () => {
    const told = await (await fetch("/time_line.json")).json();
    const position = window.__viserMutable.nodePoseData["/time_line"].position;
    const answers = [];
    window.fetch = () => new Promise(done => answers.push(done));
    const turn = () => new Promise(done => setTimeout(done, 10));
    for (const later of [1, 2]) {
        position[2] = 2 * (told.version + later);
        while (answers.length < later) await turn();
    }
    const answer = (number, text) => answers[number]({json: async () => ({
        ...told, version: told.version + 1 + number,
        marks: [{...told.marks[0], kind: "push", text}],
    })});
    answer(1, "the newer one");
    await turn();
    answer(0, "the older one");
    await turn();
    return document.querySelector("#time-line .push").ariaLabel;
})()"""


@pytest.mark.nightly
def test_marks_that_come_late_replace_no_newer_ones(viewer: Process, browser: Browser) -> None:
    open_bar(browser, viewer)
    until_at(browser, "1.000")

    assert browser.evaluate(ANSWERS).endswith("the newer one")


def test_without_a_recorded_run_the_page_has_no_time_line(
    processes: Processes, browser: Browser
) -> None:
    browser.open(address_of(processes.command("view")))
    wait_until(
        lambda: "no simulator" in browser.evaluate("document.body.innerText"), "the panel", SOON
    )

    assert not browser.evaluate("Boolean(document.querySelector('#time-line'))")
