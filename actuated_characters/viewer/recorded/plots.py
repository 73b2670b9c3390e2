"""Plots beside a recorded run: error, effort and contact over time, and the present time."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import viser
from viser import uplot

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.error_measures import limit_shares, vector_kinds
from actuated_characters.metrics.recording_metrics import contact_series, tracking_errors
from actuated_characters.report.decimation import span_maxima, span_starts
from msgs_config.arrays import FloatArray

_SPANS = 600  # parts of the time: more of them are not seen on a panel
_ASPECT = 2.6
_MIN_HEIGHT = 1e-3  # least value that the height of a plot stands for
_COLOUR, _CURSOR = "#2a6fbb", "#d9480f"
_ERROR, _EFFORT, _CONTACT = "largest joint error (rad)", "largest effort / limit", "force / weight"


def curves(recording: Recording) -> dict[str, FloatArray]:
    """Values (t + 1,) over the states of a recording by what they are; those that it has.

    The largest joint error, rad; the largest share that the effort of a joint has of its limit; and
    the vertical force of all contacts as a share of the weight.
    """
    kinds = vector_kinds(recording.layout)
    found = {_ERROR: _largest(tracking_errors(recording)[:, kinds.rotating])}
    limits = recording.character.effort_limits()
    sizes = recording.layout.norms(recording.effort)
    shares = limit_shares(sizes, limits)[:, kinds.actuated]
    found[_EFFORT] = np.concatenate(([np.nan], _largest(shares)))
    contacts = contact_series(recording.character, recording.contacts)
    weights = _weights(recording)
    if contacts is not None and (weights > 0.0).any():
        loads = np.full(len(weights), np.nan)
        np.divide(contacts.vertical_force, weights, out=loads, where=weights > 0.0)
        found[_CONTACT] = np.concatenate(([np.nan], loads))
    return {name: values for name, values in found.items() if np.isfinite(values).any()}


def _weights(recording: Recording) -> FloatArray:
    """The weight in each tick (t,), N; 0 where the simulator tells of no gravity."""
    weights = np.zeros(len(recording.effort))
    for row in recording.episode_rows.tolist():
        weights[row:] = float(recording.parameters_at(row).get("gravity", 0.0))
    return recording.character.mass * weights


def _largest(values: FloatArray) -> FloatArray:
    """The largest of each row of (r, c), NaN where a row has no number."""
    if not values.shape[1]:
        return np.full(len(values), np.nan)
    largest: FloatArray = np.fmax.reduce(values, axis=1)
    return largest


class Plots:
    """The curves of one character on the panel, with a line at the present time."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._gui = gui
        self._folder = gui.add_folder("Plots")
        self._times: FloatArray = np.zeros(1)
        self._shown: list[tuple[viser.GuiUplotHandle, FloatArray]] = []
        self._at = -1

    def choose(self, times: FloatArray, values: Mapping[str, FloatArray]) -> None:
        """Show curves over times (t,), s."""
        for handle, _ in self._shown:
            handle.remove()
        self._times = times[span_starts(len(times), _SPANS)]
        self._shown, self._at = [], -1
        for title, each in values.items():
            curve = span_maxima(each, _SPANS)
            top = max(1.05 * float(np.nanmax(curve)), _MIN_HEIGHT)
            with self._folder:
                handle = self._gui.add_uplot(
                    (self._times, curve, np.full_like(curve, np.nan)),
                    (
                        uplot.Series(label="s"),
                        uplot.Series(label=title, stroke=_COLOUR, width=1),
                        uplot.Series(label="now", stroke=_CURSOR, width=2),
                    ),
                    title=title,
                    legend=uplot.Legend(show=False),
                    scales={
                        "x": uplot.Scale(time=False),
                        "y": uplot.Scale(auto=False, range=(0.0, top)),
                    },
                    aspect=_ASPECT,
                )
            self._shown.append((handle, curve))

    def point_at(self, time: float) -> None:
        """Draw the line at a time, s."""
        if len(self._times) < 2:
            return
        at = int(np.searchsorted(self._times, time, side="right")) - 1
        if at == self._at:
            return
        self._at = at
        for handle, curve in self._shown:
            line = np.full_like(curve, np.nan)
            first = min(max(at, 0), len(curve) - 2)
            line[first : first + 2] = 0.0, np.nanmax(curve)
            data: Any = (self._times, curve, line)
            handle.data = data
