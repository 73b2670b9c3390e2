"""Shows a recorded run in a browser: no node, for nothing of it is on topics."""

import threading
import time
from collections.abc import Sequence
from concurrent.futures import Future
from functools import partial
from pathlib import Path

import viser

from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.render.skin.palette import color_number
from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.drawing.drawn_character import DrawnCharacter, bind_nothing
from actuated_characters.viewer.drawing.scene import WORLD, BrowserScene, DrawnBalls
from actuated_characters.viewer.recorded.controls import RecordedPanel
from actuated_characters.viewer.recorded.export import (
    FPS,
    CancelledError,
    free_path,
    save_film,
    save_picture,
)
from actuated_characters.viewer.recorded.forking import Fork
from actuated_characters.viewer.recorded.ghosts import REFERENCE, Ghost, Ghosts
from actuated_characters.viewer.recorded.marks import find_marks
from actuated_characters.viewer.recorded.plots import Plots, run_curves
from actuated_characters.viewer.recorded.push_arrow import DrawnPush, PushArrow
from actuated_characters.viewer.recorded.run import RecordedRun, read_run
from actuated_characters.viewer.recorded.time_bar import TimeBar
from actuated_characters.viewer.recorded.timeline import Playback, frame_times
from actuated_characters.viewer.web.rejections import Rejections
from actuated_characters.viewer.web.server import ViewerServer
from msgs_config.character.model import Shape
from msgs_config.errors import ActuatedCharactersError

_LEAST_REST = 0.003  # s of rest after a picture, for the threads that send it


class RecordedPlayer:
    """Draws the state of a recorded run that the time line is at; others may be its ghosts."""

    def __init__(
        self,
        server: ViewerServer,
        run: RecordedRun,
        others: Sequence[RecordedRun],
        skin: GivenSkin | None = None,
    ) -> None:
        """Build the scene, with a mesh from a file as the skin of every character, if given.

        Raises:
            ActuatedCharactersError: a mesh or `skin` cannot be used, or a bag cannot be read again.
        """
        self._server, self._run = server, run
        self._ghosts = Ghosts(run)
        for other in others:
            self._ghosts.add(self._ghosts.make(other))
        self._timeline = Playback(run.times)
        self._actions = ActionQueue()
        self._scene = BrowserScene(server)
        self._arrow = PushArrow(
            self._scene, self._timeline, self._actions, run.push_duration, self._show_push
        )
        self._drawn = self._add_characters(skin)
        self._balls, self._shapes = DrawnBalls(self._scene.api, f"{WORLD}/balls"), list[Shape]()
        self._panel = self._add_panel()
        self._bar = TimeBar(server, self._timeline, self._panel.time)
        self._marks = find_marks(run)
        self._plots, self._curves = Plots(server.gui), run_curves(run, run.name)
        self._panel.character.options = tuple(self._curves)
        self._panel.character.visible = len(self._curves) > 1
        self._compared: tuple[str, str] | None = None  # the ghost and the character of the plots
        self._fork: Fork | None = None
        self._read: Fork | None = None  # the last one that was looked at
        self._timeline.play()
        self._draw(0.0)
        self._scene.frame_characters(self._drawn)

    def _add_characters(self, skin: GivenSkin | None) -> list[DrawnCharacter]:
        """Add all characters, with an arrow on the first one if the run can be forked."""
        drawn = [
            DrawnCharacter(
                self._scene.api,
                f"{WORLD}/characters/{number}",
                each.character,
                each.character.effort_limits(),
                self._arrow.bind if self._run.can_be_forked else bind_nothing,
                color_number(each.world, number),
                skin,
            )
            for number, each in enumerate(self._run.recordings)
        ]
        self._arrow.draw_on(drawn[0])
        return drawn

    def _add_panel(self) -> RecordedPanel:
        """Add the panel, with the first ghost chosen if there is one."""
        panel = RecordedPanel(
            self._server.gui,
            self._scene,
            self._timeline,
            self._actions,
            self,
            by_arrow=self._run.can_be_forked,
        )
        names = self._ghosts.names
        panel.choose_ghosts(names, names[0] if names else REFERENCE)
        return panel

    def play(self, fps: float, rejections: Rejections) -> None:
        """Show it until an interruption, and print what is rejected."""
        before = time.monotonic()
        try:
            while True:
                now = time.monotonic()
                self._actions.run()
                self._timeline.advance(now - before)
                self._draw(now - before)
                self._look_at_fork()
                for sentence in rejections.take():
                    print(sentence, flush=True)
                before = now
                time.sleep(max(1.0 / fps - (time.monotonic() - now), _LEAST_REST))
        finally:
            if self._fork is not None:
                self._fork.cancel()

    def _draw(self, seconds: float) -> None:
        """Bring the scene to the time line; `seconds` since the last call."""
        row, now = self._timeline.row, self._timeline.time
        chosen = str(self._panel.ghost.value)
        other = self._ghosts.get(chosen)
        self._arrow.update()
        with self._server.atomic():
            for number, drawn in enumerate(self._drawn):
                sample = self._run.sample(number, row)
                if other is not None:
                    sample.reference = other.run.position_at(number, now)
                elif chosen != REFERENCE:
                    sample.reference = None
                drawn.shows = self._panel.shows
                drawn.draw(sample)
            balls, shapes = self._run.balls(row)
            if balls is None or shapes[: len(self._shapes)] != self._shapes[: len(shapes)]:
                self._balls.remove()
            if balls is not None:
                self._balls.place(balls, dict(zip(balls.names, shapes, strict=True)).__getitem__)
            self._shapes = shapes
            self._scene.follow_characters(self._drawn, seconds)
            self._bar.show_time()
        self._panel.show_time(self._run.name)
        self._compare(chosen, str(self._panel.character.value))
        self._plots.point_at(now)

    def _compare(self, chosen: str, character: str) -> None:
        """Show the marks and curves of the run, and those of the chosen ghost if it is a run."""
        if (chosen, character) == self._compared or character not in self._curves:
            return
        self._compared, ghost = (chosen, character), self._ghosts.get(chosen)
        if ghost is None:
            self._bar.mark(self._marks)
            self._plots.choose(self._curves[character])
        else:
            self._bar.mark(self._marks, ghost.name, ghost.marks)
            self._plots.choose(self._curves[character], ghost.curves.get(character))

    def save_picture(self, client: viser.ClientHandle) -> None:
        """Save what a client sees beside the run."""
        path = free_path(self._folder, f"view-{self._timeline.time:.3f}s", ".png")
        try:
            save_picture(client, path)
        except ActuatedCharactersError as error:
            self._tell(f"error: {error}")
        else:
            self._tell(f"saved {path}")

    def save_film(self, client: viser.ClientHandle, start: float, end: float) -> None:
        """Save what a client sees from one time to another, s, at the speed of the time line."""
        timeline = self._timeline
        end = min(end, timeline.end)
        if not float(timeline.times[0]) <= start < end:
            self._tell(f"error: a film from {start:g} s to {end:g} s; 'From' must be before 'To'")
            return
        times = frame_times(start, end, timeline.speed / FPS)
        path = free_path(self._folder, f"view-{start:.2f}-{end:.2f}s", ".mp4")
        timeline.plays = self._panel.is_cancelled = False

        def show(moment: float) -> None:
            timeline.seek(moment)
            self._draw(timeline.speed / FPS)

        def progress(done: int) -> None:
            if self._panel.is_cancelled:
                raise CancelledError
            self._panel.show_progress(done / len(times))

        try:
            save_film(client, path, times, show, progress)
        except ActuatedCharactersError as error:
            self._tell(f"error: {error}")
        except CancelledError:
            self._tell("the film is cancelled")
        else:
            self._tell(f"saved {path}")
        finally:
            self._panel.show_progress(None)

    @property
    def _folder(self) -> Path:
        path = self._run.path.absolute()
        return path if path.is_dir() else path.parent

    def fork(self, push: str, settings: Sequence[str]) -> None:
        """Fork the run at the present time; the fork becomes a ghost when it is done."""
        if self._fork is not None:
            self._tell("error: a fork is being made; cancel it, or wait for it")
            return
        self._timeline.plays = False
        self._fork = Fork(self._run.path, self._timeline.time, push, settings)
        self._panel.forks.show_forking(goes_on=True)
        self._tell(f"forking at {self._timeline.time:g} s into {self._fork.directory} ...")

    def discard_push(self) -> None:
        """Remove the arrow."""
        self._arrow.discard()

    def _show_push(self, push: DrawnPush | None, let_go: bool) -> None:
        self._panel.forks.show_push(push, self._run.push_duration, let_go=let_go)

    def cancel(self) -> None:
        """End the fork that is being made."""
        if self._fork is not None:
            self._end_fork(self._fork, "the fork is cancelled")

    def _look_at_fork(self) -> None:
        """Have the fork read when it is done, in a thread of its own: the pages are drawn on."""
        fork = self._fork
        if fork is None or fork is self._read or not fork.has_ended:
            return
        self._read = fork
        if fork.error:
            self._end_fork(fork, fork.error)
        else:
            threading.Thread(target=self._read_fork, args=(fork,), daemon=True).start()

    def _read_fork(self, fork: Fork) -> None:
        found: Future[Ghost] = Future()
        try:
            found.set_result(self._ghosts.make(read_run(fork.directory)))
        except BaseException as error:  # to be raised in the player's thread
            found.set_exception(error)
        self._actions.put(partial(self._take_fork, fork, found))

    def _take_fork(self, fork: Fork, found: Future[Ghost]) -> None:
        """Make a fork that was read the ghost, unless it was cancelled meanwhile."""
        if fork is not self._fork:
            return
        try:
            ghost = found.result()
        except ActuatedCharactersError as error:
            self._end_fork(fork, f"error: {error}")
            return
        self._ghosts.add(ghost)
        self._panel.choose_ghosts(self._ghosts.names, ghost.name)
        self._timeline.play_from(fork.time)
        self._end_fork(fork, f"forked: {fork.directory}; the ghost")

    def _end_fork(self, fork: Fork, sentence: str) -> None:
        """No fork is being made any more; say why."""
        fork.cancel()
        self._fork = None
        self._panel.forks.show_forking(goes_on=False)
        self._tell(sentence)

    def _tell(self, sentence: str) -> None:
        """Say something in the panel and in the terminal."""
        self._panel.tell(sentence)
        print(sentence, flush=True)
