"""What a page may send to the viewer's server, by the messages of viser's own page, and others."""

import gc
import math
import random
import threading
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from actuated_characters.viewer.web.connection import MOST_BYTES
from actuated_characters.viewer.web.rejections import Rejections
from actuated_characters.viewer.web.request_check import RequestCheck
from actuated_characters.viewer.web.server import (
    ViewerServer,
    open_socket,
    start_server,
    stop_server,
)
from msgs_config.errors import RecordingError
from tests.support.control_messages import CAMERA, CLICK, DRAG, mutations
from tests.support.ros import wait_until

PROTOCOL = f"viser-v{viser.__version__}"
FAR = 1e300


@dataclass
class Page:
    """A server with one control of each kind, and a client that speaks to it as a page does."""

    server: ViewerServer
    client: ClientConnection
    rejected: list[str]
    controls: dict[str, Any] = field(default_factory=dict)
    seen: list[object] = field(default_factory=list)

    def send(self, content: object) -> None:
        self.client.send(content if isinstance(content, bytes) else msgspec.msgpack.encode(content))

    def update(self, control: str, value: object) -> None:
        uuid = self.controls[control]._impl.uuid
        self.send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}})

    def settle(self) -> None:
        """Wait until all that was sent was taken: the last message is a drag of a known length."""
        count = self.seen.count("settled")
        self.send({**DRAG, "name": "/settle"})
        wait_until(lambda: self.seen.count("settled") > count, "the last message")

    def values(self) -> dict[str, object]:
        return {name: each.value for name, each in self.controls.items()}


def add_controls(page: Page) -> None:
    """Add a control of each kind that the viewer has, and a part of the scene to be touched."""
    gui, scene = page.server.gui, page.server.scene
    page.controls = {
        "menu": gui.add_dropdown("Menu", ("one", "two")),
        "group": gui.add_button_group("Group", ("Play", "Pause")),
        "slider": gui.add_slider("Slider", 0.0, 2.0, 0.5, initial_value=1.0),
        "number": gui.add_number("Number", 1.0, min=0.0, step=0.1),
        "box": gui.add_checkbox("Box", initial_value=False),
        "text": gui.add_text("Text", "before"),
        "button": gui.add_button("Button"),
        "off": gui.add_checkbox("Off", initial_value=False, disabled=True),
    }

    async def settle(event: object) -> None:
        del event
        page.seen.append("settled")

    async def see(event: object) -> None:
        page.seen.append(event)

    corners, faces = np.eye(3), np.array([[0, 1, 2]])
    scene.add_mesh_simple("/settle", corners, faces).on_drag("left")(settle)
    mesh = scene.add_mesh_simple("/mesh", corners, faces)
    mesh.on_drag("left")(see)
    mesh.on_click(modifier="shift")(see)
    page.controls["button"].on_hold(see, callback_hz=10.0)


@pytest.fixture
def page() -> Iterator[Page]:
    rejected: list[str] = []
    listening = open_socket("127.0.0.1", 0)
    server = start_server(listening, RequestCheck("127.0.0.1"), rejected.append)
    url = f"ws://127.0.0.1:{listening.getsockname()[1]}"
    with connect(url, subprotocols=[PROTOCOL], max_size=None) as client:  # type: ignore[list-item]
        page = Page(server, client, rejected)
        add_controls(page)
        page.send(CAMERA)
        page.settle()
        yield page
    stop_server(server)


@pytest.mark.parametrize(
    ("control", "value"),
    [
        ("menu", "two"),
        ("group", "Pause"),
        ("slider", 2),
        ("slider", 0.5),
        ("number", 1234.5),
        ("box", True),
        ("text", "chest:150,0,0"),
        ("text", ""),
    ],
)
def test_what_a_page_sends_is_taken(page: Page, control: str, value: object) -> None:
    page.update(control, value)
    page.settle()

    assert page.values()[control] == value
    assert not page.rejected


@pytest.mark.parametrize(
    ("control", "value"),
    [
        *((name, None) for name in ("menu", "group", "slider", "number", "box", "text", "button")),
        *((name, [1, 2]) for name in ("menu", "group", "slider", "number", "box", "text")),
        *((name, {"a": 1}) for name in ("menu", "group", "slider", "number", "box", "text")),
        ("menu", "5"),
        ("menu", 1),
        ("menu", True),
        ("group", "5"),
        ("group", ""),
        ("slider", "1"),
        ("slider", "fast"),
        ("slider", True),
        ("slider", 2.1),
        ("slider", -math.inf),
        ("slider", math.nan),
        ("number", math.nan),
        ("number", math.inf),
        ("number", -1.0),
        ("number", FAR),
        ("number", 2**63),
        ("box", 1),
        ("box", "true"),
        ("text", 5),
        ("text", b"bytes"),
        ("text", 5000 * "x"),
        ("button", "yes"),
        ("off", True),
    ],
)
def test_a_value_that_a_control_cannot_have_is_one_line_and_nothing_else(
    page: Page, control: str, value: object
) -> None:
    before = page.values()

    page.update(control, value)
    page.settle()

    assert page.values() == before
    assert len(page.rejected) == 1
    assert page.rejected[0].startswith("rejected a message: GuiUpdateMessage")
    assert "\n" not in page.rejected[0]


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xc1",
        b"\x81\xa4type",
        200 * b"\x91" + b"\x01",
        50_000 * b"\x91" + b"\x01",
        b"\xa1\xff",
        5,
        None,
        [],
        {},
        {"type": 5},
        {"type": ["GuiUpdateMessage"]},
        {"type": "Nonsense"},
        {"type": "RunJavascriptMessage", "source": "alert(1)"},
        {"type": "ShareUrlRequest"},
        {"type": "ShareUrlDisconnect"},
        {"type": "GuiFormDirtyMessage", "uuid": "x"},
        {"type": "GuiFormSubmitMessage", "uuid": "x"},
        {"type": "GuiRemoveMessage", "uuid": "x"},
        {"type": "ResetGuiMessage"},
        {
            "type": "LocalStorageGetItemResponseMessage",
            "value": "",
            "error": "",
            "request_uuid": "",
        },
        {"type": "GetRenderResponseMessage", "payload": b"x", "render_uuid": "x"},
        {"type": "GuiUpdateMessage"},
        {"type": "GuiUpdateMessage", "uuid": "unknown", "updates": {"value": 1}},
        {"type": "GuiUpdateMessage", "uuid": ["x"], "updates": {"value": 1}},
        {"type": "GuiUpdateMessage", "uuid": "x", "updates": {}, "excluded_self_client": 1},
        {"type": "GuiButtonHoldMessage", "uuid": "x", "frequency": 10.0},
        {"type": "CommandTriggerMessage", "uuid": "x"},
        {"type": "ScenePointerMessage", "event_type": "click"},
        {"type": "TransformControlsDragStartMessage", "name": "/mesh", "owner": ""},
        {**CAMERA, "wxyz": [1, 0, 0]},
        {**CAMERA, "fov": "wide"},
        {**CAMERA, "fov": 0.0},
        {**CAMERA, "position": [math.nan, 0, 0]},
        {**CAMERA, "position": [FAR, 0, 0]},
        {**CAMERA, "image_width": 1 << 40},
        {**CAMERA, "image_height": -1},
        {**CAMERA, "more": 1},
        {**DRAG, "phase": "go"},
        {**DRAG, "name": "/nowhere"},
        {**DRAG, "name": None},
        {**DRAG, "owner": "7"},
        {**DRAG, "end_position": [math.inf, 0, 0]},
        {**DRAG, "end_position": "here"},
        {**DRAG, "end_position": [FAR, 0, 0]},
        {**DRAG, "button": 5},
        {**CLICK, "ray_direction": [0, 0, 0]},
        {**CLICK, "ray_direction": [0, 0, 900]},
        {**CLICK, "modifier": "hyper"},
    ],
)
def test_a_message_that_no_page_sends_is_one_line_and_nothing_else(
    page: Page, content: object
) -> None:
    page.send(content)
    page.settle()

    assert len(page.rejected) == 1
    assert page.rejected[0].startswith("rejected a message: ")
    assert "\n" not in page.rejected[0]
    assert set(page.seen) == {"settled"}
    assert len(page.server.get_clients()) == 1


@pytest.mark.parametrize("name", ["label", "min", "_dirty", "props", "update_cb", "removed"])
def test_a_page_sets_the_value_of_a_control_and_no_other_property(page: Page, name: str) -> None:
    uuid = page.controls["slider"]._impl.uuid
    for updates in ({name: 1}, {"value": 1.5, name: 1}):
        page.send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": updates})
    page.settle()

    assert page.controls["slider"].value == 1.0
    assert len(page.rejected) == 2


def test_text_instead_of_a_message_is_one_line(page: Page) -> None:
    page.client.send("hello")
    page.settle()

    assert page.rejected == ["rejected a message: it is text, not msgpack"]


def test_what_is_touched_and_held_is_passed_on(page: Page) -> None:
    button = page.controls["button"]._impl.uuid
    page.send({**DRAG, "name": "/mesh"})
    page.send({**CLICK, "name": "/mesh"})
    page.send({"type": "GuiButtonHoldMessage", "uuid": button, "frequency": 10.0})
    page.send({"type": "GuiButtonHoldMessage", "uuid": button, "frequency": 1e5})
    page.settle()

    assert len([each for each in page.seen if each != "settled"]) == 3
    assert len(page.rejected) == 1


def test_files_are_not_taken(page: Page) -> None:
    source = page.controls["text"]._impl.uuid
    start = {
        "type": "FileTransferStartUpload",
        "source_component_uuid": source,
        "transfer_uuid": "file",
        "filename": "file.bin",
        "mime_type": "",
        "part_count": 1000,
        "size_bytes": 1 << 30,
    }
    part = {"type": "FileTransferPart", "source_component_uuid": source, "transfer_uuid": "file"}
    page.send(start)
    for number in range(20):
        page.send({**part, "part_index": number, "content": bytes(MOST_BYTES // 2)})
    page.settle()

    assert not page.server.gui._current_file_upload_states
    assert len(page.rejected) == 21


def test_a_large_message_ends_its_connection_in_a_line(page: Page) -> None:
    page.client.send(bytes(MOST_BYTES + 1))
    with pytest.raises(ConnectionClosed):
        while True:
            page.client.recv(timeout=10.0)

    wait_until(lambda: len(page.rejected) == 1, "the line")
    assert str(MOST_BYTES) in page.rejected[0]
    wait_until(lambda: not page.server.get_clients(), "the connection's end")


def test_a_page_that_floods_is_slowed_and_loses_nothing(page: Page) -> None:
    for number in range(800):
        page.update("number", float(number))
    page.settle()

    assert page.controls["number"].value == 799.0
    assert not page.rejected


def test_each_of_a_thousand_mutated_messages_changes_nothing_but_values(page: Page) -> None:
    """Of messages that a page sends; memory is what the process has, when all is collected."""
    uuids = [each._impl.uuid for each in page.controls.values()]
    originals = [
        CAMERA,
        {**DRAG, "name": "/mesh"},
        {**CLICK, "name": "/mesh"},
        {
            "type": "GuiButtonHoldMessage",
            "uuid": page.controls["button"]._impl.uuid,
            "frequency": 10,
        },
        *({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": 1}} for uuid in uuids),
    ]
    messages = list(mutations(originals, 1000, random.Random(7)))
    for raw in messages[:50]:
        page.send(raw)
    page.settle()
    before = resident_bytes()

    for raw in messages:
        page.send(raw)
    page.settle()

    assert len(page.server.get_clients()) == 1
    assert resident_bytes() - before < 20e6
    assert len(page.rejected) > 500
    assert all("\n" not in line and "an error" not in line for line in page.rejected)
    assert page.controls["menu"].value in ("one", "two")
    assert page.controls["group"].value in ("Play", "Pause")
    assert 0.0 <= page.controls["slider"].value <= 2.0
    assert isinstance(page.controls["box"].value, bool)


def resident_bytes() -> int:
    """The memory of this process that is in use."""
    gc.collect()
    return 4096 * int(Path("/proc/self/statm").read_text().split()[1])


def picture(payload: object) -> dict[str, object]:
    return {"type": "GetRenderResponseMessage", "payload": payload, "render_uuid": "x"}


def test_a_picture_that_was_asked_for_may_be_large_and_must_be_one(page: Page) -> None:
    head = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR"
    small, huge = (width.to_bytes(4, "big") for width in (640, 1 << 20))
    large = head + small + small + bytes(10 << 20)
    receiver = threading.Thread(target=receive_all, args=(page.client,), daemon=True)
    receiver.start()  # which answers pings
    (client,) = page.server.get_clients().values()

    with page.server.awaiting_picture(client):
        for payload in (b"", head + small + small, large):
            page.send(picture(payload))
        page.settle()
        assert not page.rejected
        for payload in (bytes(10 << 20), head, head + huge + huge, "text"):
            page.send(picture(payload))
        page.settle()
    assert len(page.rejected) == 4
    page.send(picture(b""))
    page.settle()
    assert "has a use for" in page.rejected[-1]
    page.client.send(large)
    wait_until(lambda: str(MOST_BYTES) in page.rejected[-1], "the line")
    receiver.join(30.0)


def receive_all(client: ClientConnection) -> None:
    with suppress(ConnectionClosed):
        while True:
            client.recv()


def test_a_page_that_has_gone_is_asked_for_no_picture(page: Page) -> None:
    (client,) = page.server.get_clients().values()
    page.client.close()
    wait_until(lambda: not page.server.get_clients(), "the connection's end")

    with pytest.raises(RecordingError, match="gone"), page.server.awaiting_picture(client):
        pass


def test_rejections_are_told_once_each_and_not_without_end() -> None:
    rejections = Rejections()
    for number in range(3):
        rejections.note("again")
        rejections.note(f"line {number}")
    assert rejections.take() == ["again", "line 0", "line 1", "line 2"]
    told = []
    for number in range(1000):
        rejections.note(f"other {number}")
        told += rejections.take()
    assert len(told) < 100
    assert told[-1].startswith("more than 100 different rejections")
    rejections.note(1000 * "x")
    assert rejections.take() == []
