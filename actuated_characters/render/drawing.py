"""Draws the pictures of a film, in several processes: the same ones however many there are."""

import multiprocessing
import signal
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection

import numpy as np

from actuated_characters.render.captions import write_on
from actuated_characters.render.engine.camera_pose import CameraPose
from actuated_characters.render.engine.render_scene import Size
from actuated_characters.render.engine.renderer import LinkForce, Picture, Renderer
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.model import Character, UrdfOptions, Vector
from msgs_config.errors import ActuatedCharactersError, RunError

_AHEAD = 2  # shots that a process has, so that it never waits for the next one
_WAIT = 5.0  # s for a process to end that was told to


@dataclass(frozen=True)
class SceneSettings:
    """What stays the same from picture to picture."""

    characters: tuple[Character, ...]
    ground: bool
    terrain: UrdfOptions | None
    ghost_offset: Vector  # m, world: how far from its place a ghost is drawn
    size: Size


@dataclass(frozen=True)
class FrameSpec:
    """One picture of characters of n degrees of freedom and l links in all."""

    position: FloatArray  # (n,), message form
    ghost: FloatArray | None  # (n,), NaN for a character that has none
    forces: tuple[LinkForce, ...]
    touching: BoolArray | None  # (l,): the links that are marked
    balls: FloatArray  # (m, 4): centres and radii, m in the world
    view: CameraPose
    caption: str  # none if empty


def draw(
    stage: SceneSettings, shots: Sequence[FrameSpec], workers: int
) -> Generator[Picture, None, None]:
    """The pictures (h, w, 3) one after another, as they are asked for.

    Process k of m draws each m-th picture from the k-th on. Close the iterator to end the processes
    before the last picture.

    Args:
        stage: What stays.
        shots: What changes.
        workers: How many processes; with one it is this one.

    Raises:
        CharacterError: a file of a character or of the terrain cannot be used.
        RunError: a process ended.
    """
    if workers <= 1:
        yield from _pictures(stage, shots)
        return
    with ExitStack() as ending:
        pipes = [ending.enter_context(_process()) for _ in range(min(workers, len(shots)))]
        # a layout remembers what it has looked up, and cannot be sent; it is rebuilt when needed
        sent = replace(stage, characters=tuple(replace(each) for each in stage.characters))
        for pipe in pipes:
            _send(pipe, sent)
        for number in range(len(shots) + _AHEAD * len(pipes)):
            if number >= _AHEAD * len(pipes):
                done = number - _AHEAD * len(pipes)
                yield _received(pipes[done % len(pipes)])
            if number < len(shots):
                _send(pipes[number % len(pipes)], shots[number])


def _pictures(stage: SceneSettings, shots: Iterable[FrameSpec]) -> Iterator[Picture]:
    with Renderer(stage.characters, ground=stage.ground, terrain=stage.terrain) as camera:
        for shot in shots:
            picture = camera.picture(
                shot.position,
                ghost=shot.ghost,
                ghost_offset=stage.ghost_offset,
                forces=shot.forces,
                touching=shot.touching,
                balls=shot.balls,
                view=shot.view,
                size=stage.size,
            )
            yield write_on(picture, shot.caption) if shot.caption else picture


@contextmanager
def _process() -> Iterator[Connection]:
    """A process that draws, and what it is talked to by: a set, and shots one after another."""
    context = multiprocessing.get_context("spawn")  # an engine does not survive a fork
    ours, theirs = context.Pipe()
    process = context.Process(target=_draw_each, args=(theirs,), daemon=True)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited: Ctrl-C is ours
    try:
        process.start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    try:
        theirs.close()
        yield ours
    finally:
        ours.close()
        process.terminate()
        process.join(_WAIT)
        if process.is_alive():
            process.kill()
            process.join()
        process.close()


def _draw_each(pipe: Connection) -> None:
    """Answer each shot by its picture, or by an error, until nobody is there any more."""
    with suppress(EOFError, ConnectionError):
        try:
            for picture in _pictures(pipe.recv(), iter(pipe.recv, None)):
                pipe.send(picture)
        except ActuatedCharactersError as error:
            pipe.send(error)


def _send(pipe: Connection, content: SceneSettings | FrameSpec) -> None:
    # what the other side has to say of its end is read, not this
    with suppress(ConnectionError):
        pipe.send(content)


def _received(connection: Connection) -> Picture:
    try:
        received = connection.recv()
    except (EOFError, ConnectionError) as error:
        raise RunError("a process that draws pictures ended before they were done") from error
    if isinstance(received, ActuatedCharactersError):
        raise received
    return np.asarray(received, dtype=np.uint8)
