"""What keys do in a page: the arrows are the characters' alone, and never turn the camera."""

from pathlib import Path

import numpy as np
import pytest

from actuated_characters.viewer.web.request_check import RequestCheck
from actuated_characters.viewer.web.server import open_socket, start_server, stop_server
from msgs_config.arrays import FloatArray
from tests.support.browser import needs_chromium, one_browser
from tests.support.ros import wait_until

pytestmark = [pytest.mark.slow, pytest.mark.sharing, needs_chromium]

SOON = 60.0  # s


def test_an_arrow_key_triggers_its_command_and_leaves_the_camera(tmp_path: Path) -> None:
    listening = open_socket("127.0.0.1", 0)
    server = start_server(listening, RequestCheck("127.0.0.1"), print)
    try:
        pressed: list[object] = []
        server.gui.add_command("Walk", hotkey="arrowup").on_trigger(pressed.append)
        with one_browser(tmp_path, "--window-size=640,360") as browser:
            browser.open(f"http://127.0.0.1:{listening.getsockname()[1]}")
            wait_until(lambda: server.get_clients(), "a page", SOON)
            camera = next(iter(server.get_clients().values())).camera
            wait_until(lambda: _has_camera(camera), "its camera", SOON)
            before, place = _direction(camera), np.array(camera.position)
            browser.key("ArrowUp")
            wait_until(lambda: pressed, "the command", SOON)
            browser.key("KeyW")  # moves the camera ahead, as long as it is down
            wait_until(lambda: np.linalg.norm(camera.position - place) > 0.5, "a way", SOON)
            browser.release("KeyW")
            browser.release("ArrowUp")
            assert np.allclose(_direction(camera), before, atol=1e-3)
    finally:
        stop_server(server)


def _has_camera(camera: object) -> bool:
    try:
        return bool(np.isfinite(_direction(camera)).all())
    except (AttributeError, AssertionError):  # viser's, until the page has sent it
        return False


def _direction(camera: object) -> FloatArray:
    """Where a camera looks (3,), of length one."""
    way: FloatArray = np.subtract(camera.look_at, camera.position)  # type: ignore[attr-defined]
    return way / np.linalg.norm(way)
