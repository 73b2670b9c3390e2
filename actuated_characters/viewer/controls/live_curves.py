"""Curves of a character that runs: what it does, what it should do, and what theory expects."""

from collections import deque
from collections.abc import Sequence
from time import monotonic
from typing import Any

import numpy as np
import viser
from viser import uplot

from actuated_characters.viewer.controls.expected_motion import ExpectedMotion
from actuated_characters.viewer.controls.requests import Requests
from actuated_characters.viewer.drawing.sample import CharacterSample
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character

_WINDOW = 8.0  # s that a curve shows
_MOST = 400  # points of a curve
_PERIOD = 0.2  # s of wall time between two pictures of a curve: the page draws each anew
_COLOURS = {"it is": "#2a6fbb", "it should be": "#40be6e", "theory": "#d9480f"}
_ASPECT = 1.6


class ShownCurves:
    """Plots of some degrees of freedom of the character that the panel is about."""

    def __init__(self, gui: viser.GuiApi, requests: Requests, names: Sequence[str]) -> None:
        """Show degrees of freedom of these names, of those that the character has."""
        self._gui, self._requests, self._names = gui, requests, names
        self._folder = gui.add_folder("Over time", visible=bool(names))
        self._character: Character | None = None
        self._expected: ExpectedMotion | None = None
        self._points: dict[str, deque[tuple[float, float, float, float]]] = {}
        self._plots: dict[str, Any] = {}
        self._next = 0.0  # s, wall time of the next picture
        self._last = 0.0  # s, simulated

    def show(self, controller: str, character: Character, sample: CharacterSample) -> None:
        """Take the newest state of a character with this controller, and draw now and then.

        Another character, or an older state, begins new curves.
        """
        if not self._names or sample.state is None:
            return
        if character is not self._character:
            self._choose(character)
        self._draw(controller)
        time = 1e-9 * sample.state.stamp_ns
        if time < self._last:
            self._points.clear()
        if time == self._last:
            return
        if self._expected is not None:
            self._expected.take(sample)
        layout, expected = character.layout, self._expected
        self._last = time
        for name in self._names:
            if name not in layout.dof_names:
                continue
            at = layout.dof_names.index(name)
            wanted = np.nan if sample.reference is None else float(sample.reference[at])
            theory = np.nan if expected is None else expected.at(time)
            points = self._points.setdefault(name, deque(maxlen=_MOST))
            points.append((time, float(sample.state.position[at]), wanted, theory))

    def _choose(self, character: Character) -> None:
        self._character = character
        self._expected = ExpectedMotion(character) if ExpectedMotion.fits(character) else None
        self._points.clear()
        for plot in self._plots.values():
            plot.remove()
        self._plots.clear()

    def _draw(self, controller: str) -> None:
        now = monotonic()
        if now < self._next:
            return
        self._next = now + _PERIOD
        if self._expected is not None:
            self._requests.get(controller, self._expected.parameters, self._expected.set)
        for name, points in self._points.items():
            values = np.array(points).T
            data = tuple(values[:, values[0] >= values[0, -1] - _WINDOW])
            if name in self._plots:
                self._plots[name].data = data
            elif len(points) > 1:
                self._plots[name] = self._add_plot(name, data)

    def _add_plot(self, title: str, data: tuple[FloatArray, ...]) -> Any:
        with self._folder:
            return self._gui.add_uplot(
                data,
                (
                    uplot.Series(label="s"),
                    *(
                        uplot.Series(label=label, stroke=color, width=2)
                        for label, color in _COLOURS.items()
                    ),
                ),
                title=title,
                scales={"x": uplot.Scale(time=False), "y": uplot.Scale(auto=True)},
                legend=uplot.Legend(show=True),
                aspect=_ASPECT,
            )
