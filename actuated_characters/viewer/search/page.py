"""The page of a search as the search sees it: a process that draws, and is told what was found."""

import multiprocessing
import os
import socket
from collections.abc import Mapping
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.viewer.parameters import ViewerSettings
from actuated_characters.viewer.search.news import News
from actuated_characters.viewer.search.player import Searched, SearchPlayer
from actuated_characters.viewer.web.rejections import Rejections
from actuated_characters.viewer.web.request_check import RequestCheck
from actuated_characters.viewer.web.server import (
    describe_address,
    open_socket,
    start_server,
    stop_server,
)
from msgs_config.errors import ActuatedCharactersError
from msgs_config.runtime.worker_processes import WorkerProcesses

if TYPE_CHECKING:  # it is subscripted for the type checker alone
    from multiprocessing.queues import Queue

_NICE = 5  # pictures can wait on a busy machine, the search should not


class SearchPage:
    """A page for a `with` block, which a process of its own draws.

    Drawing takes no time of the search's process, and what is told waits for nothing.
    """

    def __init__(self, searched: Searched, viewer: Mapping[str, object]) -> None:
        """Listen, and start the process; `viewer` has parameters of the viewer.

        Raises:
            ConfigurationError: a parameter is wrong, or the port cannot be listened on.
        """
        settings = ViewerSettings.given(viewer)
        context = multiprocessing.get_context("spawn")
        self._news: Queue[News | None] = context.Queue()
        self._news.cancel_join_thread()  # a page that takes nothing any more delays no end
        with open_socket(settings.host, settings.port or None) as listening:
            self.lines = describe_address(settings.host, listening.getsockname()[1])
            given = searched, dict(viewer), listening, self._news
            self._pool = WorkerProcesses(1, _begin, *given)
            self._shown = self._pool.submit(_show)  # the process has the socket by now
        self._end_was_told = False

    def __enter__(self) -> "SearchPage":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._news.put(None)
        self._pool.__exit__(kind, error, traceback)

    def show(self, news: News) -> None:
        """Have it show what was found; says once if it has ended, for the search goes on."""
        self._news.put(news)
        if self._shown.done():
            self._tell_end("the search goes on unseen; ")

    def wait(self) -> None:
        """Wait until its process ends, which it does not of itself, and say so."""
        self._shown.exception()
        self._tell_end("")

    def _tell_end(self, beginning: str) -> None:
        if not self._end_was_told:
            self._end_was_told = True
            print(f"{beginning}{self._reason()}", flush=True)

    def _reason(self) -> str:
        """Why its process has ended."""
        try:
            self._shown.result(0.0)
        except (ActuatedCharactersError, OSError) as error:
            return f"viewer failed: {error}"
        except BrokenProcessPool:
            pass
        return "the viewer has ended"


_given: tuple[Searched, dict[str, object], socket.socket, "Queue[News | None]"] | None = None


def _begin(
    searched: Searched,
    viewer: dict[str, object],
    listening: socket.socket,
    news: "Queue[News | None]",
) -> None:
    """What the page's process does first."""
    global _given
    _given = searched, viewer, listening, news
    os.nice(_NICE)


def _show() -> None:
    """Show the search until it ends."""
    assert _given is not None
    searched, viewer, listening, news = _given
    settings = ViewerSettings.given(viewer)
    skin = None
    if settings.skin:
        skin_map = Path(settings.skin_map) if settings.skin_map else None
        skin = GivenSkin.read(Path(settings.skin), skin_map)
    rejections = Rejections()
    server = start_server(listening, RequestCheck(settings.host), rejections.note)
    try:
        SearchPlayer(server, searched, skin).play(settings.fps, news, rejections)
    finally:
        stop_server(server)
