"""A real browser without a window: Chromium, driven by its DevTools protocol over a websocket.

https://chromedevtools.github.io/devtools-protocol/
"""

import base64
import copy
import fcntl
import io
import json
import os
import shutil
import signal
import subprocess
import tempfile
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from websockets.sync.client import ClientConnection, connect

from tests.support.ros import wait_until

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or ""

NO_CHROMIUM = "not run: chromium is not installed (Debian: apt-get install chromium)"
needs_chromium = pytest.mark.skipif(not CHROMIUM, reason=NO_CHROMIUM)

SIZE = (800, 600)  # of the window, in pixels
CONTROL, SHIFT = 2, 8  # of DevTools' bits of modifiers

Pixels = NDArray[np.uint8]

_PATIENCE = 60.0  # s; WebGL by a processor takes its time
_OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--remote-debugging-port=0",
    f"--window-size={SIZE[0]},{SIZE[1]}",
)


class Browser:
    """One page of a Chromium that ends with `close`."""

    def __init__(self, folder: Path, *options: str) -> None:
        """Start it with more options of Chromium's; profile and log go into a folder."""
        profile = folder / "chromium"
        with (folder / "chromium.log").open("wb") as log:
            self._process = subprocess.Popen(
                [CHROMIUM, *_OPTIONS, *options, f"--user-data-dir={profile}", "about:blank"],
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        told = profile / "DevToolsActivePort"
        wait_until(
            lambda: told.exists() and len(told.read_text().splitlines()) > 1, "chromium", _PATIENCE
        )
        self._port = told.read_text().splitlines()[0]
        pages = [each for each in self._ask("list") if each["type"] == "page"]
        self._attach(pages[0])

    def _ask(self, what: str, method: str = "GET") -> Any:
        """Ask the browser itself."""
        address = f"http://127.0.0.1:{self._port}/json/{what}"
        request = urllib.request.Request(address, method=method)
        with urllib.request.urlopen(request, timeout=10.0) as response:
            return json.load(response)

    def _attach(self, page: dict[str, Any]) -> None:
        """Be about a page that the browser has told of."""
        self._page: ClientConnection = connect(
            page["webSocketDebuggerUrl"], max_size=None, ping_interval=None
        )
        self._number = 0
        self.console: list[str] = []
        self.call("Page.enable")
        self.call("Runtime.enable")

    def another_page(self) -> "Browser":
        """A further page of the same Chromium, which ends with it."""
        page = copy.copy(self)
        page._attach(self._ask("new", "PUT"))
        return page

    def call(self, method: str, **parameters: object) -> dict[str, Any]:
        """Call a method of the protocol, and wait for its result."""
        self._number += 1
        call = {"id": self._number, "method": method, "params": parameters}
        self._page.send(json.dumps(call))
        while True:
            message = json.loads(self._page.recv(timeout=_PATIENCE))
            if message.get("id") == self._number:
                assert "error" not in message, message["error"]
                result: dict[str, Any] = message["result"]
                return result
            if message.get("method") == "Runtime.exceptionThrown":
                details = message["params"]["exceptionDetails"]
                reason = details.get("exception", {}).get("description", "")
                self.console.append(f"{details['text']} {reason}".strip())

    def open(self, url: str) -> None:
        """Load a page, until all of it has come."""
        self.call("Page.navigate", url=url)
        loaded = f"document.readyState === 'complete' && location.href.startsWith({url!r})"
        wait_until(lambda: self.evaluate(loaded), f"{url} in the browser", _PATIENCE)

    def evaluate(self, expression: str) -> Any:
        """The value of an expression of JavaScript in the page."""
        result = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        return result["result"].get("value")

    def png(self) -> bytes:
        """A picture of the page."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def pixels(self) -> Pixels:
        """A picture of the page (height, width, 3)."""
        from PIL import Image

        return np.asarray(Image.open(io.BytesIO(self.png())).convert("RGB"))

    def mouse(self, kind: str, x: float, y: float, *, pressed: bool = False, keys: int = 0) -> None:
        """An event of the mouse: mouseMoved, mousePressed or mouseReleased, at a pixel."""
        button = {} if kind == "mouseMoved" and not pressed else {"button": "left"}
        self.call(
            "Input.dispatchMouseEvent",
            type=kind,
            x=x,
            y=y,
            modifiers=keys,
            buttons=int(pressed),
            clickCount=int(kind != "mouseMoved"),
            **button,
        )

    def press(self, x: float, y: float, *, keys: int = 0) -> None:
        """Press the left button at a pixel."""
        self.mouse("mouseMoved", x, y, keys=keys)
        self.mouse("mousePressed", x, y, pressed=True, keys=keys)

    def key(self, name: str, *, repeated: bool = False, keys: int = 0) -> None:
        """A key goes down, ArrowUp for instance, or is repeated by the system."""
        self._key("rawKeyDown", name, autoRepeat=repeated, modifiers=keys)

    def release(self, name: str, *, keys: int = 0) -> None:
        """A key goes up."""
        self._key("keyUp", name, modifiers=keys)

    def _key(self, kind: str, name: str, **given: object) -> None:
        key = " " if name == "Space" else name
        self.call("Input.dispatchKeyEvent", type=kind, key=key, code=name, **given)

    def place(self, label: str) -> tuple[float, float] | None:
        """The pixel (x, y) in the middle of the button with a label, brought into view; if any."""
        found = self.evaluate(f"""(() => {{
            const found = [...document.querySelectorAll("button")].find(
                each => each.innerText.trim() === {json.dumps(label)});
            if (!found) return null;
            found.scrollIntoView({{block: "center"}});
            const box = found.getBoundingClientRect();
            return [box.x + box.width / 2, box.y + box.height / 2];
        }})()""")
        return None if found is None else (found[0], found[1])

    def click(self, label: str) -> bool:
        """Click on the button with a label; whether there is one."""
        expression = f"""(() => {{
            const found = [...document.querySelectorAll("button, label")].find(
                each => each.innerText.trim() === {json.dumps(label)});
            if (found) found.click();
            return Boolean(found);
        }})()"""
        return bool(self.evaluate(expression))

    def kill(self) -> None:
        """End the browser with all its processes, whatever they are doing."""
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()

    def close(self) -> None:
        """End it, if it has not ended yet."""
        self.kill()
        self._page.close()


@contextmanager
def one_browser(folder: Path, *options: str) -> Iterator[Browser]:
    """The only browser of its user on this machine: each draws with all processors.

    `options` are more of Chromium's.
    """
    lock = Path(tempfile.gettempdir()) / f"actuated_characters_browser_{os.getuid()}"
    with lock.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        browser = Browser(folder, *options)
        try:
            yield browser
        finally:
            browser.close()
