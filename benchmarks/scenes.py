"""Pictures of the scenes in a browser, 1440 by 900: `python -m benchmarks.scenes [NAME ...]`.

They need Chromium. It draws by the processor here, so that each takes half a minute; what a page
shows depends on when it is taken, and no two pictures are equal.
"""

import argparse
import re
import signal
import sys
import time
from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from rich.console import Console
from rich.progress import track

from actuated_characters.scenes.scene import scene_names
from tests.support.browser import Browser, one_browser
from tests.support.ros import Process, wait_until

SIZE = (1440, 900)  # pixels
SEARCHED = 400.0  # s that a search may take, with all of its windows
PATIENCE = 120.0  # s that a page may take until it shows a simulated time
QUALITY = 70  # of the pictures, percent
WATCHED = {"walker": 5.0, "brawl": 9.0, "crowd": 12.0, "gains": 8.0, "underactuated": 5.0}
"""s of wall time from a page's first simulated time to its picture, where that is not 4."""

_STOOD = 4.0  # s
_PLACE = re.compile(r"http://\S+")
_SHOWN = "[...document.querySelectorAll('p')].some(each => / s$/.test(each.innerText))"
_CLOSE = "document.querySelectorAll('.mantine-Notification-closeButton').forEach(x => x.click())"


def reset(browser: Browser) -> None:
    """Begin again, and wait for most of the response."""
    browser.click("Reset")
    time.sleep(2.5)


def pour(browser: Browser) -> None:
    """Begin again, and pour balls until a part of them lies."""
    browser.click("Reset")
    for _ in range(3):
        time.sleep(1.0)
        browser.click("Pour balls")
    time.sleep(2.0)


def look_back(browser: Browser) -> None:
    """Wait until a search has found its motion, and show a window in which worlds are lost."""
    found = "document.body.innerText.includes('the one that stays')"
    wait_until(lambda: browser.evaluate(found), "what was found", SEARCHED)
    browser.click("Earlier")
    time.sleep(1.0)
    browser.click("Earlier")
    time.sleep(5.0)


ACTS: Mapping[str, Callable[[Browser], None]] = {
    "lift": reset,
    "delay": reset,
    "ragdoll": pour,
    "samcon": look_back,
}
"""What is done on the pages of some scenes before their pictures."""


def main() -> int:
    """Show each scene, and write what is seen."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenes (all)")
    parser.add_argument("--folder", type=Path, default=Path("docs/pictures/scenes"))
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    for name in track(options.names or scene_names(), "scenes", console=Console()):
        picture = Image.open(BytesIO(take_picture(name))).convert("RGB")
        picture.save(options.folder / f"{name}.webp", quality=QUALITY, method=6)
    return 0


def take_picture(name: str) -> bytes:
    """What a page of a scene shows, PNG."""
    with TemporaryDirectory() as folder, one_browser(Path(folder)) as browser:
        browser.call(
            "Emulation.setDeviceMetricsOverride",
            width=SIZE[0], height=SIZE[1], deviceScaleFactor=1, mobile=False,
        )  # fmt: skip
        arguments = ["-m", "actuated_characters.cli", "play", "--scene", name]
        played = Process([*arguments, "--output", f"{folder}/run"], Path(folder) / "play.log")
        try:
            found = wait_until(lambda: _PLACE.search(played.stdout), "the address", PATIENCE)
            browser.open(found[0])
            wait_until(lambda: browser.evaluate(_SHOWN), f"a time on the page of {name}", PATIENCE)
            time.sleep(WATCHED.get(name, _STOOD))
            browser.evaluate(_CLOSE)
            ACTS.get(name, lambda browser: None)(browser)
            return browser.png()
        except BaseException:
            print(played.stdout, played.stderr, file=sys.stderr)
            raise
        finally:
            played.end(signal.SIGINT, PATIENCE)


if __name__ == "__main__":
    sys.exit(main())
