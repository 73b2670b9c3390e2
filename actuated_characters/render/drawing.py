"""Draws the pictures of a movie, in several processes: the same ones however many there are."""

from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace

from actuated_characters.render.engine.camera_pose import Size
from actuated_characters.render.engine.renderer import FrameSpec, Picture, Renderer
from actuated_characters.render.skin.given import GivenSkin
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.errors import RunError
from msgs_config.runtime.worker_processes import WorkerProcesses

_FRAMES_AHEAD = 2  # frames that wait for each process, so that it never waits for the next one


@dataclass(frozen=True)
class SceneSettings:
    """What stays the same from picture to picture."""

    characters: tuple[Character, ...]
    ground: bool
    terrain: UrdfOptions | None
    size: Size
    write: Callable[[Picture, str], Picture]  # adds a caption
    skinned: bool = True  # draw skins in place of the shapes that they are made from
    skin: GivenSkin | None = None  # from a file, in place of those
    color_numbers: tuple[int, ...] | None = None  # of the characters (`Renderer`)

    def renderer(self) -> Renderer:
        """Make what draws it."""
        return Renderer(
            self.characters,
            ground=self.ground,
            terrain=self.terrain,
            skinned=self.skinned,
            skin=self.skin,
            color_numbers=self.color_numbers,
        )


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
        renderer = settings.renderer()
        for frame in frames:
            yield _picture(settings, renderer, frame)
        return
    # a layout remembers what it has looked up, and cannot be sent; it is rebuilt when needed
    sent = replace(settings, characters=tuple(replace(each) for each in settings.characters))
    with WorkerProcesses(min(workers, len(frames)), _begin, sent) as pool:
        drawn: deque[Future[Picture]] = deque()
        try:
            for frame in frames:
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


# In a process that draws

_settings: SceneSettings
_renderer: Renderer | None = None


def _begin(settings: SceneSettings) -> None:
    global _settings
    _settings = settings


def _draw_in_process(frame: FrameSpec) -> Picture:
    global _renderer
    _renderer = _renderer or _settings.renderer()
    return _picture(_settings, _renderer, frame)
