"""Where the figures of a search are and what they do: worlds side by side, the best before them."""

import numpy as np

from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.viewer.drawing.framing import RIGHT
from actuated_characters.viewer.drawing.scene import WORLD, BrowserScene
from actuated_characters.viewer.search.figure import Figure
from actuated_characters.viewer.search.news import MotionNews, WindowNews, WorldNews, as_cost
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character

_BEST = "best so far"
_BESIDE, _GAP = 0.75, 0.55  # m from a world to the next one, and more where the best is seen
_BEHIND = 1.8  # m from the best to the worlds, and from a row of them to the next one
_IN_ROW = 6  # worlds
_SPEED = 0.25  # of real time, at which a window is seen
_STANDS = 0.8  # s that the worlds stand at the end of a window
_PAUSE = 0.6  # s of rest before a motion begins again
_TOWARDS: FloatArray = np.array((0.5**0.5, -(0.5**0.5)))  # the camera, over the ground
_STILL: FloatArray = np.zeros(2)


class Stage:
    """The figures of all worlds, and one of the best path."""

    def __init__(
        self, scene: BrowserScene, character: Character, rate: int, skin: GivenSkin | None
    ) -> None:
        """`rate` is that of the positions, Hz."""
        self._scene, self._character, self._rate, self._skin = scene, character, rate, skin
        self._best = self._figure("best")
        self._worlds: list[Figure] = []
        self._window: WindowNews | None = None
        self._motion: MotionNews | None = None
        self._begun = self._time = 0.0  # s of wall time
        self._framed: object = None

    def _figure(self, name: str) -> Figure:
        return Figure(self._scene.api, f"{WORLD}/characters/{name}", self._character, self._skin)

    @property
    def has_been_seen(self) -> bool:
        """Whether what is shown was played to its end at least once."""
        if self._window is None:
            return True
        return self._time - self._begun >= self._window_seconds(self._window)

    def show_window(self, window: WindowNews) -> None:
        """Show a window from its beginning on."""
        self._window, self._motion, self._begun = window, None, self._time
        while len(self._worlds) < len(window.worlds):
            self._worlds.append(self._figure(f"world_{len(self._worlds) + 1}"))
        for figure, world in zip(self._worlds, window.worlds, strict=False):
            figure.word = _word(world)
            figure.paint(world.fate.color)
        for figure in self._worlds[len(window.worlds) :]:
            figure.show(shown=False)
        self._best.word = _BEST

    def show_motion(self, motion: MotionNews) -> None:
        """Show a motion alone, from its beginning on."""
        self._window, self._motion, self._begun = None, motion, self._time
        for figure in self._worlds:
            figure.show(shown=False)
        self._best.word = motion.word

    def draw(self, seconds: float) -> None:
        """Go on by a wall time, s, and draw."""
        self._time += seconds
        if self._window is not None:
            self._draw_window(self._window)
        elif self._motion is not None:
            positions, desired = self._motion.positions, self._motion.desired
            row = self._row(len(positions))
            self._best.pose(positions[row], _STILL, None if desired is None else desired[row])
        shown = [each for each in (self._best, *self._worlds) if each.is_shown]
        if shown:
            self._frame(shown)
            self._scene.follow_characters(shown, seconds)

    def _frame(self, shown: list[Figure]) -> None:
        """Have the cameras see all figures, once their number is another one."""
        if self._framed != len(shown):
            self._framed = len(shown)
            self._scene.frame_characters(shown)

    def _draw_window(self, window: WindowNews) -> None:
        elapsed = (self._time - self._begun) % self._window_seconds(window)
        tick = int(elapsed * _SPEED * self._rate)
        places = world_places(len(window.worlds))
        for figure, world, place in zip(self._worlds, window.worlds, places, strict=False):
            row = min(tick, len(world.positions) - 1)
            figure.pose(world.positions[row], place - world.positions[0, :2])
        if len(window.best):
            row = self._row(len(window.best))
            # in its place, wherever it goes
            offset = _BEHIND * _TOWARDS - window.best[row, :2]
            self._best.pose(window.best[row], offset, window.desired[row])

    def _window_seconds(self, window: WindowNews) -> float:
        """How long a window is shown, s of wall time."""
        longest = max(len(world.positions) for world in window.worlds)
        return longest / (_SPEED * self._rate) + _STANDS

    def _row(self, count: int) -> int:
        """The row that is seen now of so many, which are played in real time, again and again."""
        elapsed = (self._time - self._begun) % (count / self._rate + _PAUSE)
        return min(int(elapsed * self._rate), count - 1)


def world_places(count: int) -> FloatArray:
    """Places (count, 2) on the ground, m: rows across the view, with a gap for what is before."""
    rows = -(-count // _IN_ROW)
    places = []
    for row in range(rows):
        of_row = count // rows + (row < count % rows)
        left = (of_row + 1) // 2  # of the gap
        for number in range(of_row):
            side = -1.0 if number < left else 1.0
            across = _BESIDE * (number - left + 0.5) + 0.5 * side * _GAP
            places.append(across * RIGHT[:2] - row * _BEHIND * _TOWARDS)
    return np.array(places)


def _word(world: WorldNews) -> str:
    return world.fate.word if world.cost is None else f"{world.fate.word} {as_cost(world.cost)}"
