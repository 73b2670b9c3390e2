"""Plots beside a recorded run: error, effort and contact over time, and the present time."""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from viser import uplot

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics.error_measures import limit_shares, vector_kinds
from actuated_characters.metrics.recording_metrics import contact_series, tracking_errors
from actuated_characters.report.decimation import span_maxima, span_starts
from actuated_characters.viewer.drawing.colors import GHOST
from actuated_characters.viewer.recorded.run import RecordedRun
from msgs_config.arrays import FloatArray

_SPANS = 600  # parts of the time: more of them are not seen on a panel
_ASPECT = 2.6
_MIN_HEIGHT = 1e-3  # least value that the height of a plot stands for
_COLOURS = ("#2a6fbb", "#{:02x}{:02x}{:02x}".format(*GHOST))  # of the run, of its ghost
_CURSOR = "#d9480f"
_EQUAL_TIMES = 1e-9  # s: two times are as good as equal
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


@dataclass(frozen=True)
class RunCurves:
    """The curves of one character of a run, by what they are."""

    name: str  # of the run
    times: FloatArray  # (t + 1,) s, in the time of the run that it is beside
    values: Mapping[str, FloatArray]  # (t + 1,) each


def run_curves(run: RecordedRun, name: str) -> dict[str, RunCurves]:
    """The curves of each character of a run, by the character's name."""
    times = run.times + run.starts
    return {
        each.name or each.character.name: RunCurves(name, times, curves(each))
        for each in run.recordings
    }


def resampled(times: FloatArray, values: FloatArray, starts: FloatArray, end: float) -> FloatArray:
    """The largest of values at times (k,) in each span of time (s,); NaN where there is none.

    Spans begin at `starts` and end where the next one begins, the last one at `end`, included.
    """
    span = np.searchsorted(starts, times + _EQUAL_TIMES, side="right") - 1
    within = (span >= 0) & (times <= end + _EQUAL_TIMES)
    largest = np.full(len(starts), np.nan)
    np.fmax.at(largest, span[within], values[within])
    return largest


class Plots:
    """The curves of one character on the panel, with a line at the present time."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._gui = gui
        self._folder = gui.add_folder("Plots")
        with self._folder:
            self._legend = gui.add_html("", visible=False)
        self._times: FloatArray = np.zeros(1)
        self._shown: list[tuple[viser.GuiUplotHandle, list[FloatArray]]] = []
        self._at = -1

    def choose(self, run: RunCurves, ghost: RunCurves | None = None) -> None:
        """Show the curves of a run, and over them those of its ghost, if that is a run."""
        for handle, _ in self._shown:
            handle.remove()
        self._times = run.times[span_starts(len(run.times), _SPANS)]
        self._shown, self._at = [], -1
        names = [run.name] if ghost is None else [run.name, ghost.name]
        self._legend.content = _legend(names)
        self._legend.visible = ghost is not None
        for title, each in run.values.items():
            shown = [span_maxima(each, _SPANS)]
            if ghost is not None and title in ghost.values:
                end = float(run.times[-1])
                shown.append(resampled(ghost.times, ghost.values[title], self._times, end))
            self._shown.append((self._add(title, shown, names), shown))

    def _add(
        self, title: str, shown: Sequence[FloatArray], names: Sequence[str]
    ) -> viser.GuiUplotHandle:
        """Add a plot of the curves (s,) of runs with these names."""
        lines = [
            uplot.Series(label=name, stroke=color, width=1)
            for name, color, _ in zip(names, _COLOURS, shown, strict=False)
        ]
        now: Any = (self._times, *shown, np.full_like(shown[0], np.nan))
        with self._folder:
            return self._gui.add_uplot(
                now,
                (
                    uplot.Series(label="s"),
                    *lines,
                    uplot.Series(label="now", stroke=_CURSOR, width=2),
                ),
                title=title,
                legend=uplot.Legend(show=False),
                scales={
                    "x": uplot.Scale(time=False),
                    "y": uplot.Scale(auto=False, range=(0.0, _top(shown))),
                },
                aspect=_ASPECT,
            )

    def point_at(self, time: float) -> None:
        """Draw the line at a time, s."""
        if len(self._times) < 2:
            return
        at = int(np.searchsorted(self._times, time, side="right")) - 1
        if at == self._at:
            return
        self._at = at
        for handle, shown in self._shown:
            line = np.full_like(shown[0], np.nan)
            first = min(max(at, 0), len(line) - 2)
            line[first : first + 2] = 0.0, _top(shown)
            data: Any = (self._times, *shown, line)
            handle.data = data


def _top(shown: Sequence[FloatArray]) -> float:
    """What the height of a plot of some curves stands for."""
    return max(_MIN_HEIGHT, *(1.05 * float(np.nanmax(each, initial=0.0)) for each in shown))


def _legend(names: Sequence[str]) -> str:
    """HTML that says which colour is whose."""
    parts = [
        f'<span style="color: {color}">&#9644;</span> {html.escape(name)}'
        for name, color in zip(names, _COLOURS, strict=False)
    ]
    text = "&emsp;".join(parts)
    return f'<div style="font-size: 12px; padding: 0 0.8em; overflow-wrap: anywhere">{text}</div>'
