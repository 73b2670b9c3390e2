"""Shows a search in a browser as it goes on: no node, for nothing of it is on topics."""

import queue
import time
from collections import deque
from dataclasses import dataclass
from typing import Protocol

from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.drawing.scene import BrowserScene
from actuated_characters.viewer.search.news import MotionNews, News, WindowNews
from actuated_characters.viewer.search.panel import EARLIER, LATER, SearchPanel
from actuated_characters.viewer.search.stage import Stage
from actuated_characters.viewer.web.rejections import Rejections
from actuated_characters.viewer.web.server import ViewerServer
from msgs_config.character.model import Character

_MOST_SEEN_AGAIN = 200  # windows
_MOST_WAITING = 20  # windows: where more wait to be seen, the newest is
_IDLE_PERIOD = 0.1  # s between looks, while nobody watches
_LEAST_REST = 0.003  # s of rest after a picture, for the threads that send it


class NewsQueue(Protocol):
    """From the search to its page; None means that it ends."""

    def get_nowait(self) -> News | None:
        """The next one; raises queue.Empty if there is none."""


@dataclass(frozen=True)
class Searched:
    """What is searched for."""

    character: Character
    title: str
    rate: int  # Hz, of positions
    about: str = ""  # Markdown that stands on the page, in place of its own


class SearchPlayer:
    """Draws one window after another as they are tried, and in the end what was found."""

    def __init__(
        self, server: ViewerServer, searched: Searched, skin: GivenSkin | None = None
    ) -> None:
        """Build the scene, with a mesh from a file as the skin of every figure, if given.

        Raises:
            ActuatedCharactersError: a mesh or `skin` cannot be used.
        """
        self._server, self._rate = server, searched.rate
        self._actions = ActionQueue()
        self._scene = BrowserScene(server)
        self.stage = Stage(self._scene, searched.character, searched.rate, skin)
        self.panel = SearchPanel(
            server.gui, self._scene, searched.title, searched.about, self._actions, self.move
        )
        self._all: deque[News] = deque(maxlen=_MOST_SEEN_AGAIN)
        self._number = -1  # of these, which is shown
        self._goes_on = True  # to the next ones
        self._is_new = False  # what is shown is not drawn yet
        self._later = -1  # how many come after it, as the panel says it

    def take(self, news: News) -> None:
        """Take what has been found."""
        if len(self._all) == _MOST_SEEN_AGAIN:
            self._number = max(self._number - 1, 0)
        self._all.append(news)

    def move(self, button: str) -> None:
        """Show an earlier window again and again, a later one, or the newest, and all to come."""
        last = len(self._all) - 1
        step = {EARLIER: -1, LATER: 1}.get(button, len(self._all))
        self._number = max(min(self._number + step, last), min(last, 0))
        self._goes_on, self._is_new = self._number == last, True

    def play(self, fps: float, news: NewsQueue, rejections: Rejections) -> None:
        """Show it until the search says that it ends, and print what is rejected."""
        before = time.monotonic()
        while True:
            now = time.monotonic()
            try:
                while (found := news.get_nowait()) is not None:
                    self.take(found)
                return
            except queue.Empty:
                pass
            self._actions.run()
            is_watched = bool(self._server.get_clients())
            if is_watched:
                self.draw(now - before)
            for sentence in rejections.take():
                print(sentence, flush=True)
            before = now
            period = 1.0 / fps if is_watched else _IDLE_PERIOD
            time.sleep(max(period - (time.monotonic() - now), _LEAST_REST))

    def draw(self, seconds: float) -> None:
        """Draw what is to be shown after so many s."""
        self._choose()
        with self._server.atomic():
            self.stage.draw(seconds)

    def _choose(self) -> None:
        """Show the windows one after another, each of them whole, and then what was found."""
        waiting = len(self._all) - 1 - self._number
        if waiting and self._goes_on and self.stage.has_been_seen:
            self._number += waiting if waiting > _MOST_WAITING else 1
            self._is_new = True
        if self._number < 0:
            return
        shown, later = self._all[self._number], len(self._all) - 1 - self._number
        if self._is_new:
            self._is_new, self._later = False, -1
            if isinstance(shown, MotionNews):
                self.stage.show_motion(shown)
                self.panel.show_motion(shown, len(shown.positions) / self._rate, self._number)
            else:
                self.stage.show_window(shown)
        if later != self._later and isinstance(shown, WindowNews):
            self._later = later
            self.panel.show_window(shown, later)
