"""What stands over a character's head: its name, how often it fell, and what it is doing."""

import json
from contextlib import suppress

import numpy as np
import viser

from actuated_characters.metrics.falls import FALLEN_TIME, PostureReader, PostureSeries, is_down
from msgs_config.arrays import FloatArray
from msgs_config.messages.state import StampedState

TAG_HEIGHT = 0.3  # m, that a text needs above a character

_ABOVE = 0.25  # m, from the highest link's frame to the text
_MOST_CHARACTERS = 20  # of a mode
_SMALL = 0.6  # of the size of a text
_UNTOLD = "TRACK"  # the mode in which nothing happens to a character
_UNREADABLE = (ValueError, KeyError, TypeError, AttributeError, RecursionError)


def mode_of(text: str) -> str:
    """The mode that a message of `~/mode` tells, a JSON object; empty if it tells none.

    Of a state machine it is the state's name.
    """
    with suppress(*_UNREADABLE):
        facts = json.loads(text)
        return str(facts.get("state", facts["mode"]))[:_MOST_CHARACTERS]
    return ""


class FallCounter:
    """Counts falls: a character is down for `FALLEN_TIME` on end, after it was up."""

    def __init__(self, reader: PostureReader) -> None:
        self.count = 0
        self._reader = reader
        self._down_since: int | None = None  # stamp, ns
        self._counted = False
        self._last_ns = 0

    def begin_episode(self) -> None:
        """Forget the falls so far; a simulator's stamps go on where it is reset."""
        self.count, self._down_since, self._counted = 0, None, False

    def take(self, state: StampedState) -> None:
        """Take a newer state; one that is older begins a new episode, with no falls so far."""
        if state.stamp_ns < self._last_ns:
            self.begin_episode()
        self._last_ns = state.stamp_ns
        body = self._reader.read(state.position[np.newaxis])
        anything = PostureSeries(np.full(1, np.nan), np.full((1, 3), np.nan))
        if not is_down(body, anything, self._reader.standing_height)[0]:
            self._down_since, self._counted = None, False
            return
        if self._down_since is None:
            self._down_since = state.stamp_ns
        lasts = 1e-9 * (state.stamp_ns - self._down_since) >= FALLEN_TIME
        if lasts and not self._counted:
            self.count, self._counted = self.count + 1, True


class NameTag:
    """The text over one of several characters."""

    def __init__(
        self,
        scene: viser.SceneApi,
        frame: str,
        name: str,
        reader: PostureReader | None,
        *,
        of_many: bool = False,
    ) -> None:
        """Add it below a frame that goes along with the character, over the ground.

        Without a `reader`, as of a fixed base, no falls are counted. Tags `of_many` are small.
        """
        self._name = name
        self._falls = None if reader is None else FallCounter(reader)
        scale = _SMALL if of_many else 1.0
        self._label = scene.add_label(
            f"{frame}/tag", name, anchor="bottom-center", font_screen_scale=scale
        )

    def begin_episode(self) -> None:
        """Forget the falls of the episode before."""
        if self._falls is not None:
            self._falls.begin_episode()

    def draw(self, state: StampedState, origins: FloatArray, mode: str) -> None:
        """Show what a character is doing whose links (l, 3) are there, m, world."""
        parts = [self._name]
        if self._falls is not None:
            self._falls.take(state)
            if count := self._falls.count:
                parts.append("1 fall" if count == 1 else f"{count} falls")
        if mode and mode != _UNTOLD:
            parts.append(mode.lower())
        text = " · ".join(parts)
        if text != self._label.text:
            self._label.text = text
        self._label.position = (0.0, 0.0, float(origins[:, 2].max()) + _ABOVE)
