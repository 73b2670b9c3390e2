"""The panel of a recorded run, and what its buttons do to the time line."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.drawing.scene import BrowserScene
from actuated_characters.viewer.recorded.controls import RecordedPanel
from actuated_characters.viewer.recorded.timeline import Playback
from actuated_characters.viewer.web.request_check import RequestCheck
from actuated_characters.viewer.web.server import open_socket, start_server, stop_server

TIMES = np.arange(241) / 240.0  # one second
NO_TARGET: Any = None


@pytest.fixture
def timeline() -> Playback:
    return Playback(TIMES)


@pytest.fixture
def panel(timeline: Playback) -> Iterator[RecordedPanel]:
    server = start_server(open_socket("127.0.0.1", 0), RequestCheck("127.0.0.1"), lambda _: None)
    scene = BrowserScene(server)
    yield RecordedPanel(server.gui, scene, timeline, ActionQueue(), NO_TARGET, by_arrow=False)
    stop_server(server)


@pytest.mark.parametrize(("button", "row"), [("Start", 0), ("End", 240), ("-1", 119), ("+1", 121)])
def test_who_goes_to_a_state_stands_there_also_in_a_loop(
    panel: RecordedPanel, timeline: Playback, button: str, row: int
) -> None:
    timeline.loops = True
    timeline.play_from(0.5)

    panel.time.move(button)
    timeline.advance(0.1)

    assert (timeline.row, timeline.plays) == (row, False)
