"""Which requests the viewer's server takes, by what browsers send for pages of its own and others.

Host and Origin are those of RFC 9110 (7.2) and RFC 6454 (7).
"""

import pytest

from actuated_characters.viewer.web import request_check
from actuated_characters.viewer.web.request_check import RequestCheck, is_loopback

ADDRESS = "192.168.1.5:8080"  # of this machine, in its network


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8080", "localhost:8080", "LocalHost:9000", "127.0.0.1", "[::1]:8080"]
)
@pytest.mark.parametrize("scheme", ["http", "https"])
def test_its_own_page_may_whatever_it_is_called_on_this_machine(host: str, scheme: str) -> None:
    check = RequestCheck("127.0.0.1")

    assert check.find_fault([host], []) is None
    assert check.find_fault([host], [f"{scheme}://{host}"]) is None


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "http://evil.example:8080",
        "http://localhost:3000",
        "http://localhost:8080.evil.example",
        "http://evil.example/?localhost:8080",
        "http://localhost",
        "ftp://localhost:8080",
        "localhost:8080",
        "null",
        "",
    ],
)
def test_a_page_from_elsewhere_may_not(origin: str) -> None:
    fault = RequestCheck("127.0.0.1").find_fault(["localhost:8080"], [origin])

    assert fault is not None
    assert repr(origin) in fault


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "localhost.evil.example:8080",
        "evil.example:8080",
        "127.0.0.1.evil.example",
        "user@localhost:8080",
        "localhost:0",
        "localhost:x",
        "[::1",
        "localhost/",
        "192.168.1.5",
        "",
    ],
)
def test_a_name_that_was_made_to_resolve_to_this_machine_is_none_of_its_own(host: str) -> None:
    check = RequestCheck("127.0.0.1")

    assert check.find_fault([host], [f"http://{host}"]) is not None
    assert check.find_fault([host], []) is not None


@pytest.mark.parametrize("hosts", [[], ["localhost", "evil.example"], ["localhost", "localhost"]])
def test_a_request_names_one_host(hosts: list[str]) -> None:
    assert RequestCheck("127.0.0.1").find_fault(hosts, []) is not None


def test_two_origins_are_none() -> None:
    own = "http://localhost:8080"

    assert RequestCheck("127.0.0.1").find_fault(["localhost:8080"], [own, own]) is not None


def test_who_opens_it_to_the_network_may_use_addresses_and_the_machines_names(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(request_check.socket, "gethostname", lambda: "Lab")
    check = RequestCheck("0.0.0.0")

    for host in (ADDRESS, "lab:8080", "lab.local:8080", "[fe80::1]:8080", "localhost:8080"):
        assert check.find_fault([host], [f"http://{host}"]) is None
        assert check.find_fault([host], ["http://evil.example"]) is not None
    assert check.find_fault(["evil.example:8080"], ["http://evil.example:8080"]) is not None
    assert RequestCheck("robot.lan").find_fault(["robot.lan:8080"], []) is None


@pytest.mark.parametrize(
    ("host", "only_here"),
    [
        ("127.0.0.1", True),
        ("127.4.5.6", True),
        ("::1", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("::", False),
        ("192.168.1.5", False),
        ("lab", False),
    ],
)
def test_addresses_that_others_can_reach_are_told_apart(host: str, only_here: bool) -> None:
    assert is_loopback(host) is only_here


@pytest.mark.parametrize(
    "query",
    [
        "websocket=ws://evil.example",
        "websocket=wss://evil.example/",
        "websocket=//evil.example",
        "websocket=///evil.example",
        "websocket=ws:evil.example",
        "websocket=",
        "websocket",
        "websocket=ws://localhost:8081",
        "websocket=ws://localhost:8080.evil.example",
        "websocket=ws://localhost:8080@evil.example",
        "websocket=ws://localhost:8080%40evil.example",
        "websocket=ws://localhost:8080%5C@evil.example",
        "websocket=%20ws://evil.example",
        "websocket=ws%3A%2F%2Fevil.example",
        "%77ebsocket=ws://evil.example",
        "web%73ocket=ws://evil.example",
        "darkMode&websocket=ws://evil.example",
        "websocket=ws://localhost:8080&websocket=ws://evil.example",
        "playbackPath=https://evil.example/scene.viser",
        "playbackPath=data:application/octet-stream;base64,AAAA",
        "playback%50ath=//evil.example/scene.viser",
    ],
)
def test_an_address_that_leads_the_page_to_another_server_is_refused(query: str) -> None:
    fault = RequestCheck("127.0.0.1").find_target_fault(f"/?{query}", "localhost:8080")

    assert fault is not None
    assert "\n" not in fault


@pytest.mark.parametrize(
    "target",
    [
        "/",
        "/index.html?darkMode",
        "/?websocket=ws://localhost:8080",
        "/?websocket=ws%3A%2F%2FLocalhost%3A8080%2F",
        "/?initialCameraPosition=1,2,3&showStats",
        "/websocket=ws://evil.example",
    ],
)
def test_an_address_that_leads_to_this_server_is_taken(target: str) -> None:
    assert RequestCheck("127.0.0.1").find_target_fault(target, "localhost:8080") is None
