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
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character

_WINDOW = 8.0  # s that a curve shows
_STEP = 0.02  # s between two points of a curve
_PERIOD = 0.2  # s of wall time between two pictures of a curve: the page draws each anew
_ASKING_PERIOD = 2.0  # s of wall time between two looks at parameters that others may set
_SERIES = (
    uplot.Series(label="s before now"),
    uplot.Series(label="it should be", stroke="#8fdbaa", width=5),  # below what it is
    uplot.Series(label="it is", stroke="#2a6fbb", width=2),
    uplot.Series(label="theory", stroke="#d9480f", width=2, dash=(7.0, 5.0)),
)
_TIME = uplot.Scale(time=False, auto=False, range=(-_WINDOW, 0.0))
_ASPECT = 2.0
_ROOM_ABOVE = (14, 8, 0, 0)  # pixels, for half of a number at the upper edge, and to the right
_AXIS = uplot.Axis(space=20)  # pixels between two numbers, at least
_UNITS = {JointType.PRISMATIC: "m", JointType.REVOLUTE: "rad"}
_MARGIN, _LEAST_MARGIN = 0.08, 0.01  # share of the height; m or rad
_LEAST_SHARE = 0.3  # of a plot's height that curves have, or it fits anew
_MOST_POINTS = round(_WINDOW / _STEP)


class ShownCurves:
    """Plots of some degrees of freedom of the character that the panel is about."""

    def __init__(self, gui: viser.GuiApi, requests: Requests, names: Sequence[str]) -> None:
        """Show degrees of freedom of these names, of those that the character has."""
        self._gui, self._requests, self._names = gui, requests, names
        self._folder = gui.add_folder("Over time", visible=False)
        self._character: Character | None = None
        self._expected: ExpectedMotion | None = None
        self._points: dict[str, deque[tuple[float, ...]]] = {}
        self._ranges: dict[str, tuple[float, float]] = {}
        self._columns = 3  # of a point: time, target, place; with theory one more
        self._plots: dict[str, Any] = {}
        self._next_picture = self._next_look = 0.0  # s, wall time
        self._waits = False  # for the controller to tell its parameters
        self._last = self._last_point = -np.inf  # s, simulated

    def show(self, controller: str, character: Character, sample: CharacterSample) -> None:
        """Take the newest state of a character with this controller, and draw now and then.

        Another character, or an older state, begins new curves.
        """
        if not self._names or sample.state is None:
            return
        if character is not self._character:
            self._choose(character)
        self._look(controller)
        self._draw()
        time = 1e-9 * sample.state.stamp_ns
        if time < self._last:
            self._points.clear()
            self._last_point = -np.inf
        if time != self._last and self._expected is not None:
            self._expected.take(sample)
        self._last = time
        if time >= self._last_point + _STEP:
            self._last_point = time
            self._add_points(time, sample)

    def look_soon(self) -> None:
        """Ask for the controller's parameters again: one may have been set."""
        self._next_look = 0.0

    def _look(self, controller: str) -> None:
        now = monotonic()
        if self._expected is None or self._waits or now < self._next_look:
            return
        self._next_look, self._waits = now + _ASKING_PERIOD, True
        expected = self._expected

        def take(values: dict[str, object]) -> None:
            self._waits = False
            expected.set(values)

        self._requests.get(controller, expected.parameters, take)

    def _add_points(self, time: float, sample: CharacterSample) -> None:
        assert self._character is not None
        assert sample.state is not None
        names = self._character.layout.dof_names
        theory = np.nan if self._expected is None else self._expected.at(time)
        for name in set(self._names).intersection(names):
            at = names.index(name)
            wanted = np.nan if sample.reference is None else float(sample.reference[at])
            points = self._points.setdefault(name, deque(maxlen=_MOST_POINTS))
            point = (time, wanted, float(sample.state.position[at]), theory)
            points.append(point[: self._columns])

    def _choose(self, character: Character) -> None:
        self._character = character
        self._expected = ExpectedMotion(character) if ExpectedMotion.fits(character) else None
        self._columns = 3 if self._expected is None else 4
        self._points.clear()
        for plot in self._plots.values():
            plot.remove()
        self._plots.clear()
        self._ranges.clear()

    def _draw(self) -> None:
        now = monotonic()
        if now < self._next_picture:
            return
        self._next_picture = now + _PERIOD
        for name, points in self._points.items():
            values = np.array(points).T
            values[0] -= values[0, -1]  # the page keeps the scale of its time as it is
            data = tuple(values[:, values[0] >= -_WINDOW])
            if name not in self._plots and len(points) > 1:
                self._plots[name] = self._add_plot(name, data)
            if name in self._plots:
                self._plots[name].data = data
                self._scale(name, np.array(data[1:]))
        self._folder.visible = bool(self._plots)

    def _scale(self, name: str, values: FloatArray) -> None:
        """Have the page suit a plot's height, or fit it where values (curves, points) lack.

        Each fit makes the plot anew, and such a one is now and then without numbers at its axes
        until its height changes.
        """
        if np.isnan(values).any():
            self._fit(name, values)
        elif self._ranges.pop(name, None) is not None:
            self._plots[name].scales = {"x": _TIME, "y": uplot.Scale(auto=True)}

    def _fit(self, name: str, values: FloatArray) -> None:
        """Have a plot's height suit values (curves, points): a page cannot where some lack."""
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        before = self._ranges.get(name, (np.inf, -np.inf))
        if before[0] <= low and high <= before[1] and high - low > _LEAST_SHARE * np.ptp(before):
            return
        margin = max(_MARGIN * (high - low), _LEAST_MARGIN)
        self._ranges[name] = around = low - margin, high + margin
        y = uplot.Scale(auto=False, range=around)
        self._plots[name].scales = {"x": _TIME, "y": y}

    def _add_plot(self, name: str, data: tuple[FloatArray, ...]) -> Any:
        assert self._character is not None
        joints = self._character.layout.joints
        kind = next(each.type for each in joints if name in each.dof_names)
        title = f"{name} ({_UNITS[kind]}) in the last {_WINDOW:g} s" if kind in _UNITS else name
        with self._folder:
            return self._gui.add_uplot(
                data,
                _SERIES[: len(data)],
                title=title,
                scales={"x": _TIME, "y": uplot.Scale(auto=True)},
                legend=uplot.Legend(show=True, live=False),
                axes=(uplot.Axis(), _AXIS),
                aspect=_ASPECT,
                padding=_ROOM_ABOVE,
            )
