"""The time line at the bottom of a recorded run's page.

viser's panels stand at the sides, and none of them is as wide as a page of any width. So the page
has a script of its own (`time_bar.js`), which draws the time line and listens to clicks and keys.
It needs no connection of its own: what it asks for it sends as if the panel's own slider or buttons
had been used, which are checked like those; the present time comes along with the scene's poses, in
a frame that nobody sees; and the marks, which seldom change, are a text that it fetches.
"""

import json
import math
import secrets
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from actuated_characters.viewer.recorded.marks import Mark
from actuated_characters.viewer.recorded.playback_controls import PlaybackControls
from actuated_characters.viewer.recorded.timeline import Playback
from actuated_characters.viewer.web.server import ViewerServer

_FRAME, _ADDRESS = "/time_line", "/time_line.json"
_VERSIONS = 10_000
_FILES = [Path(__file__).with_name(name) for name in ("time_bar.js", "time_bar.css")]


class TimeBar:
    """The time line of all pages of a server."""

    def __init__(
        self, server: ViewerServer, timeline: Playback, controls: PlaybackControls
    ) -> None:
        """Add it; the panel's `controls` are what it acts by."""
        self._timeline = timeline
        # no other viewer's on this port before, to which a page was connected
        self._version = secrets.randbelow(_VERSIONS)
        self._frame = server.scene.add_frame(_FRAME, show_axes=False)
        self._told: dict[str, Any] = {
            "first": float(timeline.times[0]),
            "slider": controls.slider._impl.uuid,
            "playback": controls.buttons._impl.uuid,
        }
        self._text = "{}"
        self._server = server
        server.parts.files += _FILES
        server.parts.texts[_ADDRESS] = lambda: self._text

    def add_files(self, files: Sequence[Path]) -> None:
        """Give pages more scripts and styles, for which `timeLine` is in the page."""
        self._server.parts.files += files

    def tell(self, **values: Any) -> None:
        """Have scripts find these values, from the next `mark` on, in `timeLine.told`."""
        self._told.update(values)

    def mark(self, marks: Sequence[Mark], ghost: str = "", of_ghost: Sequence[Mark] = ()) -> None:
        """Show these marks, and below them those of a ghost, if it has a name.

        The time line is as long as it is now.
        """
        self._version += 1
        shown = {"marks": marks, "ghostMarks": of_ghost}
        lists = {name: [asdict(mark) for mark in each] for name, each in shown.items()}
        told = {**self._told, "last": self._timeline.end, "version": self._version}
        self._text = json.dumps({**told, **lists, "ghost": ghost})

    def show_time(self) -> None:
        """Bring all pages to the present time.

        viser sends no position that is within 1e-5 of the last one, as a share: so seconds and
        their fraction are two numbers, and no number is large.
        """
        timeline = self._timeline
        fraction, seconds = math.modf(timeline.time)
        self._frame.position = (fraction, seconds, 2.0 * self._version + float(timeline.plays))
