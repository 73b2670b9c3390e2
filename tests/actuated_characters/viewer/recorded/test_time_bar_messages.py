"""What the pages are told of a recorded run's time line."""

import json
from collections.abc import Iterator

import numpy as np
import pytest

from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.recorded.marks import Mark
from actuated_characters.viewer.recorded.playback_controls import PlaybackControls
from actuated_characters.viewer.recorded.time_bar import TimeBar
from actuated_characters.viewer.recorded.timeline import Playback
from actuated_characters.viewer.web.request_check import RequestCheck
from actuated_characters.viewer.web.server import (
    ViewerServer,
    open_socket,
    start_server,
    stop_server,
)

HOUR = np.arange(3600 * 240 + 1) / 240.0  # s
PUSH = Mark("push", 1.0, 1.1, "push on root")


@pytest.fixture
def server() -> Iterator[ViewerServer]:
    server = start_server(open_socket("127.0.0.1", 0), RequestCheck("127.0.0.1"), lambda _: None)
    yield server
    stop_server(server)


def make_bar(server: ViewerServer, timeline: Playback) -> TimeBar:
    return TimeBar(server, timeline, PlaybackControls(server.gui, timeline, ActionQueue()))


def place_of(server: ViewerServer) -> list[float]:
    """The position of the frame that tells the time, as it was last sent."""
    position: list[float] = server.scene._handle_from_node_name["/time_line"].position.tolist()
    return position


def test_each_state_of_an_hour_is_told(server: ViewerServer) -> None:
    timeline = Playback(HOUR)
    bar = make_bar(server, timeline)
    bar.mark([])
    timeline.seek(3599.0)

    for _ in range(5):
        timeline.step(1)
        bar.show_time()
        fraction, seconds, _ = place_of(server)
        assert fraction + seconds == pytest.approx(timeline.time, abs=1e-9)


def test_new_marks_and_playing_are_told_while_the_time_stands(server: ViewerServer) -> None:
    timeline = Playback(HOUR)
    bar = make_bar(server, timeline)
    seen = []
    for plays in (False, True):
        timeline.plays = plays
        for ghost in ("", "fork"):
            bar.mark([PUSH], ghost, [PUSH] if ghost else [])
            bar.show_time()
            seen.append(place_of(server)[2])
            told = json.loads(server.parts.texts["/time_line.json"]())
            assert told["version"] == seen[-1] // 2
            assert (told["ghost"], len(told["ghostMarks"])) == (ghost, len(ghost) // 4)
            assert told["marks"][0]["text"] == PUSH.text

    assert [number % 2 for number in seen] == [0, 0, 1, 1]
    assert len({number // 2 for number in seen}) == 4
