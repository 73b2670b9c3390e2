"""Mutated control messages to the viewer as users have it, live and of a recording: it lives."""

import json
import random
import signal
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
import pytest
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from actuated_characters.runs.plan import make_plan
from msgs_config.messages import topics
from tests.support.control_messages import CAMERA, CLICK, DRAG, mutations
from tests.support.ros import Process, Processes, SimulatorClient, tick_of, wait_until
from tests.support.runs import run_plan_here

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

COUNT = 1000  # messages
MOST_GROWTH = 20e6  # bytes
SOON = 60.0  # s


def address_of(viewer: Process) -> str:
    def address() -> str:
        assert viewer.exit_code is None, viewer.stderr
        lines = [line for line in viewer.stdout.splitlines() if line.startswith("http://")]
        return lines[0] if lines else ""

    return str(wait_until(address, "the viewer's address", SOON)).replace("http", "ws")


def open_page(url: str) -> ClientConnection:
    return connect(
        url,
        subprotocols=[f"viser-v{viser.__version__}"],  # type: ignore[list-item]
        max_size=None,
    )


def sent_to(page: ClientConnection, patience: float = 1.0) -> list[dict[str, Any]]:
    """The messages that the viewer sends until it says nothing for a while: viser's wire format."""
    found: list[dict[str, Any]] = []
    for _ in range(200):
        try:
            raw = page.recv(timeout=patience)
        except TimeoutError:
            break
        assert isinstance(raw, bytes)
        length = int.from_bytes(raw[8:16], "little")
        packed = zstandard.ZstdDecompressor().decompress(raw[16 : 16 + length])
        found += msgspec.msgpack.decode(packed)["messages"]
    return found


def originals(shown: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Messages that a page could send about what it was shown."""
    controls = [each for each in shown if each["type"].startswith("Gui") and "value" in each]
    meshes = [each["name"] for each in shown if each["type"] == "MeshMessage"]
    buttons = [each["uuid"] for each in shown if each["type"] == "GuiButtonMessage"]
    assert len(controls) > 5
    updates = [
        {"type": "GuiUpdateMessage", "uuid": each["uuid"], "updates": {"value": each["value"]}}
        for each in controls
    ]
    holds = [{"type": "GuiButtonHoldMessage", "uuid": each, "frequency": 10} for each in buttons]
    touches = [{**each, "name": name} for each in (DRAG, CLICK) for name in meshes[:5]]
    return [CAMERA, *updates, *holds, *touches]


def harmless(each: dict[str, Any]) -> bool:
    """Whether a message, if a mutation leaves it valid, ends neither the run nor the film."""
    return str(each.get("updates", {}).get("value", "")) not in ("Fork", "MP4", "PNG")


def resident_bytes(pid: int) -> int:
    return 4096 * int(Path(f"/proc/{pid}/statm").read_text().split()[1])


def attack(url: str, pid: int, log: Callable[[], str]) -> None:
    """Send the messages, and then some that are too large; asserts that nothing grows or ends."""
    with open_page(url) as page:
        page.send(msgspec.msgpack.encode(CAMERA))
        known = [each for each in originals(sent_to(page)) if harmless(each)]
        messages = list(mutations(known, COUNT, random.Random(11)))
        _send(page, messages[:100])
        before = resident_bytes(pid)
        _send(page, messages)
    for _ in range(5):
        with open_page(url) as page, pytest.raises(ConnectionClosed):
            for _ in range(10):
                page.send(bytes(8 << 20))
            while True:
                page.recv(timeout=SOON)
    with open_page(url) as page:
        for part in range(200):
            content = {"type": "FileTransferPart", "transfer_uuid": "x", "part_index": part}
            page.send(msgspec.msgpack.encode({**content, "content": bytes(50_000)}))
        _send(page, [])
    growth = resident_bytes(pid) - before
    assert growth < MOST_GROWTH, f"{growth / 1e6:.1f} MB"
    wait_until(lambda: "rejected a message" in log(), "a line", SOON)
    assert "Traceback" not in log()


def _send(page: ClientConnection, messages: list[bytes]) -> None:
    def take() -> None:
        """Take what the viewer has drawn meanwhile."""
        with suppress(TimeoutError):
            while True:
                page.recv(timeout=0.0)

    for raw in messages:
        page.send(raw)
        take()
    pong = page.ping()
    wait_until(pong.is_set, "the answer to a ping", SOON, take)


def test_the_live_viewer_lives(processes: Processes, client: SimulatorClient) -> None:
    viewer = processes.node(topics.VIEWER_NODE, fresh=True)
    processes.composed({"real_time_factor": 1.0}, {}, character="pendulum")
    client.spin_until(lambda: client.states.messages and tick_of(client.states.last) > 5, "ticks")

    attack(address_of(viewer), viewer.pid, lambda: viewer.stderr)

    assert viewer.end(signal.SIGINT) == 0
    assert "Traceback" not in viewer.stderr


def test_the_viewer_of_a_recording_lives(processes: Processes, tmp_path: Path) -> None:
    run_plan_here(make_plan("pendulum", 0.5, {}, {}, {}), tmp_path / "run")
    viewer = processes.command("view", str(tmp_path / "run"))

    attack(address_of(viewer), viewer.pid, lambda: viewer.stdout)

    viewer.send(signal.SIGINT)
    assert viewer.wait() == 130
    assert "Traceback" not in viewer.stderr
    assert json.loads((tmp_path / "run" / "summary.json").read_text())


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_viewer_that_is_ended_leaves_nothing(
    processes: Processes, tmp_path: Path, number: signal.Signals
) -> None:
    run = tmp_path / "run"
    run_plan_here(make_plan("pendulum", 0.5, {}, {}, {}), run)
    before = sorted(run.rglob("*"))
    viewer = processes.command("view", str(run))
    url = address_of(viewer)
    with open_page(url) as page:
        page.send(msgspec.msgpack.encode(CAMERA))
        sent_to(page)

        viewer.send(number)
        viewer.wait()

    assert sorted(run.rglob("*")) == before
    with pytest.raises(ConnectionRefusedError):
        open_page(url)
