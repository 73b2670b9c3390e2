"""Draws the pictures of a movie, in several processes: the same ones however many there are."""

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, replace

from actuated_characters.render.engine.camera_pose import Size
from actuated_characters.render.engine.renderer import FrameSpec, Picture, Renderer
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.errors import RunError

_FRAMES_AHEAD = 2  # frames that wait for each process, so that it never waits for the next one


@dataclass(frozen=True)
class SceneSettings:
    """What stays the same from picture to picture."""

    characters: tuple[Character, ...]
    ground: bool
    terrain: UrdfOptions | None
    size: Size
    write: Callable[[Picture, str], Picture]  # adds a caption

    def renderer(self) -> Renderer:
        """Start an engine for it."""
        return Renderer(self.characters, ground=self.ground, terrain=self.terrain)


def draw(
    settings: SceneSettings, frames: Sequence[FrameSpec], workers: int = 1
) -> Generator[Picture, None, None]:
    """The pictures (h, w, 3) one after another, as they are asked for.

    Close the iterator to end the processes before the last picture.

    Args:
        settings: What stays.
        frames: What changes.
        workers: How many processes; with one it is this one.

    Raises:
        CharacterError: a file of a character or of the terrain cannot be used.
        RunError: a process ended.
    """
    if workers <= 1:
        with settings.renderer() as renderer:
            for frame in frames:
                yield _picture(settings, renderer, frame)
        return
    with _processes(settings, min(workers, len(frames))) as pool:
        drawn: deque[Future[Picture]] = deque()
        try:
            for frame in frames:
                with _interrupts_blocked():  # a process that is started here inherits the block
                    drawn.append(pool.submit(_draw_in_process, frame))
                if len(drawn) >= _FRAMES_AHEAD * workers:
                    yield drawn.popleft().result()
            while drawn:
                yield drawn.popleft().result()
        except BrokenProcessPool as error:
            raise RunError("a process that draws pictures ended before they were done") from error


def _picture(settings: SceneSettings, renderer: Renderer, frame: FrameSpec) -> Picture:
    picture = renderer.picture(frame, settings.size)
    return settings.write(picture, frame.caption) if frame.caption else picture


@contextmanager
def _processes(settings: SceneSettings, workers: int) -> Generator[ProcessPoolExecutor, None, None]:
    """Processes that draw; they end with the context, or with this process."""
    # a layout remembers what it has looked up, and cannot be sent; it is rebuilt when needed
    sent = replace(settings, characters=tuple(replace(each) for each in settings.characters))
    context = multiprocessing.get_context("spawn")  # an engine does not survive a fork
    pool = ProcessPoolExecutor(workers, context, initializer=_begin, initargs=(sent,))
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _interrupts_blocked() -> Generator[None, None, None]:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


# In a process that draws

_settings: SceneSettings
_renderer: Renderer | None = None


def _begin(settings: SceneSettings) -> None:
    global _settings
    _settings = settings
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End when the parent is killed, which ends nothing by itself."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _draw_in_process(frame: FrameSpec) -> Picture:
    global _renderer
    _renderer = _renderer or _settings.renderer()
    return _picture(_settings, _renderer, frame)
