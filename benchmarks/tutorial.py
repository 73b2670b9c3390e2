"""Does in a browser what docs/timeline_tutorial.md says: `python -m benchmarks.tutorial`.

By drags, clicks and typed numbers alone a character waves, steps, is hit, falls and gets up. It
needs Chromium, takes some minutes, prints what it measured, and writes the pictures of that page.
"""

import argparse
import json
import signal
import sys
import time
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from actuated_characters.bags.whole import read_whole
from benchmarks.scenes import _CLOSE, _PLACE, QUALITY, SIZE
from tests.support.browser import Browser, one_browser
from tests.support.ros import Process, wait_until

PATIENCE = 60.0  # s that a page may take
SIMULATED = 400.0  # s that a take may take
RIGHT_HAND = (661.0, 453.0)  # pixels of the page, as it opens
RAISED, OUT, IN = (-75.0, -270.0), (-50.0, 0.0), (60.0, -10.0)  # pixels of the drags of the hand
FALLEN, STANDS = 0.3, 0.75  # m: heights of the pelvis, below and above

# the least part of the page that has a text, and what is beside it
_FIND = """(label => {
    const found = [...document.querySelectorAll("button, label, div, p")].filter(
        each => each.innerText?.trim() === label && each.offsetParent !== null);
    const least = found[found.length - 1];
    if (!least) return null;
    least.scrollIntoView({block: "center"});
    return least;
})"""
_MIDDLE = """(part => {
    if (!part) return null;
    const box = part.getBoundingClientRect();
    return [box.x + box.width / 2, box.y + box.height / 2];
})"""
_INPUT = """(label => {
    let part = FIND(label);
    while (part && !part.querySelector("input")) part = part.parentElement;
    return part ? part.querySelector("input") : null;
})""".replace("FIND", _FIND)
_OPTION = """(label => [...document.querySelectorAll("[role=option]")].find(
    each => each.innerText.trim().startsWith(label) && each.offsetParent !== null))"""

_TIME_LINE = """(() => {
    const box = document.querySelector("#time-line .track").getBoundingClientRect();
    const text = document.querySelector("#time-line .time").innerText;
    return [box.x, box.y, box.width, box.height, parseFloat(text.split("/")[1])];
})()"""


class Hands:
    """Who has a mouse and a keyboard, and counts what is done with them."""

    def __init__(self, browser: Browser, folder: Path) -> None:
        self._browser, self._folder = browser, folder
        self.clicks, self.drags, self.typed = 0, 0, 0
        self._hand = RIGHT_HAND

    def text(self) -> str:
        """What stands on the page."""
        return str(self._browser.evaluate("document.body.innerText"))

    def wait(self, words: str, patience: float = PATIENCE) -> None:
        """Go on once some words stand on the page."""
        try:
            wait_until(lambda: words in self.text(), f"'{words}' on the page", patience)
        except BaseException:
            print(self.text(), file=sys.stderr)
            self.picture("failed")
            raise

    def _place(self, found: str) -> tuple[float, float]:
        middle = f"{_MIDDLE}({found})"
        try:
            place = wait_until(lambda: self._browser.evaluate(middle), found, PATIENCE)
        except BaseException:
            self.picture("failed")
            raise
        return float(place[0]), float(place[1])

    def _click_at(self, x: float, y: float) -> None:
        self._browser.press(x, y)
        self._browser.mouse("mouseReleased", x, y)
        self.clicks += 1
        time.sleep(0.3)

    def click(self, label: str) -> None:
        """Click on what has a label."""
        self._click_at(*self._place(f"{_FIND}({json.dumps(label)})"))

    def unfold(self, folder: str) -> None:
        """Open a folder of the panel."""
        self.click(folder)
        time.sleep(1.5)

    def choose(self, label: str, option: str) -> None:
        """Choose an option, or the one that begins so, of a list."""
        found = f"{_OPTION}({json.dumps(option)})"
        begun = time.monotonic()
        while not self._browser.evaluate(f"Boolean({found})"):
            assert time.monotonic() - begun < PATIENCE, f"{label} has no {option}"
            self._click_at(*self._place(f"{_INPUT}({json.dumps(label)})"))
            time.sleep(1.0)  # a folder that still unfolds is clicked on again
        time.sleep(0.4)  # the list unfolds
        self._click_at(*self._place(found))

    def type(self, label: str, text: str) -> None:
        """Write something into a field, in place of what it has."""
        found = f"{_INPUT}({json.dumps(label)})"
        self._click_at(*self._place(found))
        self._browser.evaluate(f"{found}.select()")
        self._browser.call("Input.insertText", text=text)
        self._browser.key("Tab")
        self._browser.release("Tab")
        self.typed += 1
        time.sleep(0.5)

    def go_to(self, at: float) -> None:
        """Click on the time line, again where it has just become longer."""
        begun, shown = time.monotonic(), f"{at:.3f} s"
        while shown not in self.text() and time.monotonic() - begun < PATIENCE:
            left, top, width, height, last = self._browser.evaluate(_TIME_LINE)
            # above the keys, whose marks would take the click
            self._click_at(left + width * at / last, top + height - 20.0)
            time.sleep(2.0)
        self.wait(shown)

    def drag_hand(self, way: tuple[float, float]) -> None:
        """Drag the right hand by some pixels."""
        x, y = self._hand
        self._browser.press(x, y)
        steps = 12
        for step in range(1, steps + 1):
            share = step / steps
            self._browser.mouse("mouseMoved", x + share * way[0], y + share * way[1], pressed=True)
            time.sleep(0.05)
        self._browser.mouse("mouseReleased", x + way[0], y + way[1])
        self._hand = x + way[0], y + way[1]
        self.drags += 1
        self.wait("posed by hand")

    def picture(self, name: str) -> None:
        """Write what is seen."""
        time.sleep(3.0)  # all is drawn
        self._browser.evaluate(_CLOSE)
        place = self._folder / f"timeline_{name}.webp"
        picture = Image.open(BytesIO(self._browser.png())).convert("RGB")
        picture.save(place, quality=QUALITY, method=6)


def wave(hands: Hands) -> None:
    """Keys at five times, of which the last is the first one once more."""
    hands.click("Key")
    hands.wait("key 1 of 1")
    hands.click("Copy")
    hands.unfold("Dragging")
    hands.choose("Moves", "limb alone")
    for at, way in ((0.6, RAISED), (1.0, OUT), (1.4, IN)):
        hands.go_to(at)
        hands.drag_hand(way)
        if at == 0.6:
            hands.picture("drag")
        hands.click("Key")
        hands.wait("key ")
    hands.go_to(2.0)
    hands.click("Paste")
    hands.wait("key 5 of 5")
    hands.unfold("Layers")
    hands.choose("After the last", "it gives way")
    hands.choose("Behaviour", "active_ragdoll")


def simulate(hands: Hands, title: str, number: int) -> float:
    """Make a take; returns how long that took, s of wall time."""
    hands.type("Title", title)
    begun = time.monotonic()
    hands.click("Simulate")
    hands.wait(f"take {number}", SIMULATED)
    return time.monotonic() - begun


def add_events(hands: Hands) -> None:
    """Steps, then a hit by which it goes limp."""
    hands.choose("Seen", "none")
    hands.type("Duration (s)", "12")
    hands.unfold("Events")
    hands.go_to(2.4)
    hands.choose("New", "steering")
    hands.type("lasts (s)", "1.2")
    hands.click("Add event")
    hands.wait("steering")
    hands.go_to(4.0)
    hands.choose("New", "pushes")
    hands.type("force", "0, 400, 0")
    hands.click("Add event")
    hands.choose("New", "limp")
    hands.type("lasts (s)", "0.6")
    hands.click("Add event")
    hands.picture("events")


def push_later(hands: Hands) -> None:
    """Move the push, and what goes limp, to a later time."""
    hands.choose("Seen", "none")
    hands.go_to(4.2)
    for event in ("limp 1", "pushes 1"):
        hands.choose("There are", event)
        hands.click("Move here")


def main() -> int:
    """Do it, measure it, and write its pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("docs/pictures"), help="(%(default)s)")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="leave timeline and takes there")
    options = parser.parse_args()
    with TemporaryDirectory() as temporary, one_browser(Path(temporary)) as browser:
        browser.call(
            "Emulation.setDeviceMetricsOverride",
            width=SIZE[0], height=SIZE[1], deviceScaleFactor=1, mobile=False,
        )  # fmt: skip
        place = (options.keep or Path(temporary)).resolve()
        place.mkdir(parents=True, exist_ok=True)
        file = place / "dance.yaml"
        arguments = ["-m", "actuated_characters.cli", "author", str(file)]
        author = Process(arguments, Path(temporary) / "author.log")
        try:
            found = wait_until(lambda: _PLACE.search(author.stdout), "the address", PATIENCE)
            browser.open(found[0])
            do_it(Hands(browser, options.folder), file)
        except BaseException:
            print(author.stdout, author.stderr, file=sys.stderr)
            raise
        finally:
            author.end(signal.SIGINT, PATIENCE)
    return 0


def do_it(hands: Hands, file: Path) -> None:
    """All that the page says, with a line of what each step took."""

    def measured(name: str, step: Callable[[], float | None]) -> None:
        begun, clicks, drags, typed = time.monotonic(), hands.clicks, hands.drags, hands.typed
        took = step()
        lasted = took or time.monotonic() - begun
        done = hands.clicks - clicks, hands.drags - drags, hands.typed - typed
        print(f"{name}: {lasted:.0f} s, {done[0]} clicks, {done[1]} drags, {done[2]} fields")
        sys.stdout.flush()

    hands.wait("no keys yet")
    time.sleep(3.0)  # the camera comes nearer
    measured("wave", lambda: wave(hands))
    measured("take 1", lambda: simulate(hands, "wave", 1))
    hands.go_to(1.0)
    hands.picture("wave")
    measured("events", lambda: add_events(hands))
    measured("take 2", lambda: simulate(hands, "hit", 2))
    hands.go_to(4.6)
    hands.picture("fall")
    measured("the hit is later", lambda: push_later(hands))
    measured("take 3", lambda: simulate(hands, "hit later", 3))
    hands.choose("Outline", "2")
    hands.go_to(4.6)
    hands.picture("compared")
    for number in ("2", "3"):
        check_that_it_falls_and_gets_up(file.with_suffix(".takes") / number)


def check_that_it_falls_and_gets_up(take: Path) -> None:
    """The pelvis is low once, and high at the end."""
    (recording,) = read_whole(take)
    heights = recording.position[:, 2]
    print(f"{take}: pelvis at least {heights.min():.2f} m, at the end {heights[-1]:.2f} m")
    assert heights.min() < FALLEN
    assert heights[-1] > STANDS


if __name__ == "__main__":
    sys.exit(main())
