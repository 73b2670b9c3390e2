"""The viewer's server as other programs and pages meet it: by a plain client of websockets."""

import http.client
import json
import socket
from collections.abc import Iterator
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path

import pytest
import viser
import websockets.asyncio.server
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from actuated_characters.viewer.web import server as server_module
from actuated_characters.viewer.web.page_parts import PageParts
from actuated_characters.viewer.web.request_check import RequestCheck
from actuated_characters.viewer.web.server import (
    ViewerServer,
    open_socket,
    start_server,
    stop_server,
)
from msgs_config.errors import ConfigurationError
from tests.support.ros import wait_until

PROTOCOL = f"viser-v{viser.__version__}"


@dataclass
class Running:
    server: ViewerServer
    port: int
    rejected: list[str] = field(default_factory=list)

    def open(self, origin: str | None, host: str | None = None) -> bool:
        """Whether a client with these headers gets the scene."""
        headers = {} if host is None else {"Host": host}
        try:
            with connect(
                f"ws://127.0.0.1:{self.port}",
                origin=origin,  # type: ignore[arg-type]
                additional_headers=headers,
                subprotocols=[PROTOCOL],  # type: ignore[list-item]
                max_size=None,
            ) as client:
                return len(client.recv(timeout=10.0)) > 0
        except InvalidStatus as error:
            assert error.response.status_code == HTTPStatus.FORBIDDEN
            return False

    def get(self, path: str, host: str, origin: str | None = None) -> http.client.HTTPResponse:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=10.0)
        connection.putrequest("GET", path, skip_host=True)
        connection.putheader("Host", host)
        if origin is not None:
            connection.putheader("Origin", origin)
        connection.endheaders()
        return connection.getresponse()


@pytest.fixture
def running() -> Iterator[Running]:
    rejected: list[str] = []
    listening = open_socket("127.0.0.1", 0)
    server = start_server(listening, RequestCheck("127.0.0.1"), rejected.append)
    yield Running(server, listening.getsockname()[1], rejected)
    stop_server(server)


def test_a_program_without_an_origin_and_the_servers_own_page_connect(running: Running) -> None:
    assert running.open(None)
    assert running.open(f"http://127.0.0.1:{running.port}")
    assert not running.rejected


@pytest.mark.parametrize("origin", ["http://evil.example", "http://localhost:3000", "null"])
def test_a_page_of_another_origin_cannot_open_the_websocket(running: Running, origin: str) -> None:
    assert not running.open(origin)
    assert not running.server.get_clients()
    assert len(running.rejected) == 1
    assert repr(origin) in running.rejected[0]


def test_a_page_whose_name_resolves_to_this_machine_gets_nothing(running: Running) -> None:
    rebound = f"evil.example:{running.port}"
    page = running.get("/", rebound, f"http://{rebound}")

    assert page.status == HTTPStatus.FORBIDDEN
    assert b"viser" not in page.read()
    with socket.create_connection(("127.0.0.1", running.port), timeout=10.0) as connection:
        lines = (
            f"GET / HTTP/1.1\r\nHost: {rebound}\r\nOrigin: http://{rebound}\r\n"
            "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
            f"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
        )
        connection.sendall(lines.encode())
        assert connection.recv(100).startswith(b"HTTP/1.1 403 ")


def test_the_page_is_served_and_none_may_frame_it(running: Running) -> None:
    page = running.get("/", f"localhost:{running.port}")

    assert page.status == HTTPStatus.OK
    assert page.getheader("X-Frame-Options") == "DENY"
    assert b"<html" in page.read()


def test_parts_of_our_own_are_served_with_the_page_and_to_no_page_from_elsewhere(
    running: Running, tmp_path: Path
) -> None:
    script = tmp_path / "hello.js"
    script.write_text("const hello = 'grüß dich';", encoding="utf-8")
    running.server.parts.files.append(script)
    running.server.parts.texts["/marks.json"] = lambda: '{"marks": []}'
    host = f"localhost:{running.port}"

    marks = running.get("/marks.json?again", host)
    assert marks.status == HTTPStatus.OK
    assert marks.getheader("Content-Type") == "application/json"
    assert marks.getheader("Cross-Origin-Resource-Policy") == "same-origin"
    assert json.loads(marks.read()) == {"marks": []}
    assert running.get("/marks.json", host, "http://evil.example").status == HTTPStatus.FORBIDDEN
    page = running.get("/", host).read()
    head = page.index(b"<head>"), page.index(b"</head>")
    assert head[0] < page.index("grüß dich".encode()) < head[1]


def test_parts_of_the_page_are_read_for_the_page_alone(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[PageParts] = []
    monkeypatch.setattr(PageParts, "head", lambda parts: read.append(parts) or b"")
    host = f"localhost:{running.port}"

    assert running.get("/missing", host).status == HTTPStatus.NOT_FOUND
    assert not read
    assert running.get("/", host).status == HTTPStatus.OK
    assert read == [running.server.parts]


@pytest.mark.parametrize("path", ["/", "/missing", "/?websocket=ws://evil.example"])
def test_each_response_lets_the_page_speak_with_its_own_server_alone(
    running: Running, path: str
) -> None:
    response = running.get(path, f"localhost:{running.port}")

    given = (response.getheader("Content-Security-Policy") or "").split("; ")
    policy = {name: sources for name, _, sources in (each.partition(" ") for each in given)}
    assert policy["default-src"] == policy["base-uri"] == policy["form-action"] == "'none'"
    assert policy["frame-ancestors"] == "'none'"
    assert policy["connect-src"] == "'self' data: blob:"
    own = {"'self'", "'none'", "'unsafe-inline'", "'unsafe-eval'", "data:", "blob:"}
    assert {source for sources in policy.values() for source in sources.split()} <= own
    assert response.getheader("X-Content-Type-Options") == "nosniff"
    assert response.getheader("Referrer-Policy") == "no-referrer"
    assert response.getheader("Cross-Origin-Resource-Policy") == "same-origin"
    assert response.getheader("Cross-Origin-Opener-Policy") == "same-origin"


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/" + 300 * "a", HTTPStatus.NOT_FOUND),
        ("/" + 2000 * "a/", HTTPStatus.REQUEST_URI_TOO_LONG),
        ("/" + 1000 * "%41", HTTPStatus.REQUEST_URI_TOO_LONG),
        ("/" + 200 * "a/", HTTPStatus.NOT_FOUND),
        ("/%00", HTTPStatus.NOT_FOUND),
        ("/%ff%fe", HTTPStatus.NOT_FOUND),
        ("/" + 120 * "%F0%9F%98%80" + "/x", HTTPStatus.NOT_FOUND),
        ("/../../etc/passwd", HTTPStatus.NOT_FOUND),
    ],
)
def test_a_path_of_no_page_is_said_to_be_none(
    running: Running, path: str, status: HTTPStatus
) -> None:
    assert running.get(path, f"localhost:{running.port}").status == status


def test_a_request_line_beyond_all_bounds_ends_its_connection_alone(running: Running) -> None:
    with socket.create_connection(("127.0.0.1", running.port), timeout=10.0) as connection:
        connection.sendall(b"GET /" + 20_000 * b"a" + b" HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert b" 500 " not in connection.recv(100)
    assert running.open(None)


@pytest.mark.parametrize(("header", "status"), [("Upgrade", 400), ("Accept-Encoding", 200)])
def test_a_header_that_is_given_twice_is_no_error_of_the_server(
    running: Running, header: str, status: int
) -> None:
    with socket.create_connection(("127.0.0.1", running.port), timeout=10.0) as connection:
        lines = f"GET / HTTP/1.1\r\nHost: localhost:{running.port}\r\n" + 2 * f"{header}: x\r\n"
        connection.sendall(f"{lines}\r\n".encode())
        assert connection.recv(100).startswith(f"HTTP/1.1 {status} ".encode())


def test_a_page_that_comes_before_viser_is_whole_waits(running: Running) -> None:
    listening = open_socket("127.0.0.1", 0)
    rejected: list[str] = []
    seen = Running(running.server, listening.getsockname()[1], rejected)
    statuses: list[int] = []

    class ComesEarly(ViewerServer):
        """A viser that a page asks while it is made: after its server listens, before its scene."""

        def request(self) -> None:
            page = seen.get("/", f"localhost:{seen.port}")
            assert page.getheader("Refresh") == "1"
            statuses.append(page.status)
            with pytest.raises(InvalidStatus) as refused:
                connect(f"ws://127.0.0.1:{seen.port}", subprotocols=[PROTOCOL])  # type: ignore[list-item]
            statuses.append(refused.value.response.status_code)

        def __setattr__(self, name: str, value: object) -> None:
            if name == "_event_loop":
                self.request()
            super().__setattr__(name, value)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(server_module, "ViewerServer", ComesEarly)
        server = start_server(listening, RequestCheck("127.0.0.1"), rejected.append)
    try:
        assert statuses == [HTTPStatus.SERVICE_UNAVAILABLE, HTTPStatus.SERVICE_UNAVAILABLE]
        assert seen.open(None)
        assert not rejected
    finally:
        stop_server(server)


def test_a_client_of_another_version_of_viser_is_told_so(
    running: Running, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(InvalidStatus) as refused:
        connect(f"ws://127.0.0.1:{running.port}")
    assert refused.value.response.status_code == HTTPStatus.BAD_REQUEST
    assert capfd.readouterr() == ("", "")


def test_nothing_listens_on_another_address(running: Running) -> None:
    lines = Path("/proc/net/tcp").read_text().splitlines()[1:]
    places = [line.split()[1].split(":") for line in lines]

    assert {address for address, port in places if int(port, 16) == running.port} == {"0100007F"}


def test_the_server_is_gone_when_it_was_stopped() -> None:
    listening = open_socket("127.0.0.1", 0)
    port = listening.getsockname()[1]
    stop_server(start_server(listening, RequestCheck("127.0.0.1"), lambda fault: None))

    def is_closed() -> bool:
        with socket.socket() as other:
            return other.connect_ex(("127.0.0.1", port)) != 0

    wait_until(is_closed, "the port is closed")
    assert websockets.asyncio.server.serve.__module__ == "websockets.asyncio.server"


def test_without_a_port_the_first_one_that_is_free_is_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with open_socket("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        monkeypatch.setattr(server_module, "FIRST_PORT", port)
        monkeypatch.setattr(server_module, "_PORTS", 50)
        with open_socket("127.0.0.1", None) as free:
            assert port < free.getsockname()[1] < port + 50


def test_a_port_that_is_in_use_is_one_clear_line() -> None:
    with open_socket("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(
            ConfigurationError, match=rf"127\.0\.0\.1, port {port}: .*--port"
        ) as error:
            open_socket("127.0.0.1", port)
    assert "\n" not in str(error.value)


def test_an_address_of_another_machine_is_one_clear_line() -> None:
    with pytest.raises(ConfigurationError, match=r"cannot listen on 192\.0\.2\.1"):
        open_socket("192.0.2.1", None)


def test_a_viser_that_makes_its_server_otherwise_is_not_used(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(server_module, "ViewerServer", _NeverServes)
    with (
        open_socket("127.0.0.1", 0) as listening,
        pytest.raises(ConfigurationError, match="cannot be checked"),
    ):
        start_server(listening, RequestCheck("127.0.0.1"), lambda fault: None)


def test_another_viser_than_the_one_whose_insides_are_known_is_not_used(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(viser, "__version__", "1.2.0")
    with (
        open_socket("127.0.0.1", 0) as listening,
        pytest.raises(ConfigurationError, match=r"viser 1\.2\.0 .*; install viser 1\.1"),
    ):
        start_server(listening, RequestCheck("127.0.0.1"), lambda fault: None)


class _NeverServes:
    """A viser that starts its server by other means."""

    def __init__(self, *, verbose: bool) -> None:
        self.verbose = verbose

    def stop(self) -> None: ...


def test_nothing_is_made_public_through_other_peoples_servers(running: Running) -> None:
    assert running.server.request_share_url() is None
