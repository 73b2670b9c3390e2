"""The pictures of a report: series over simulated time, with what happened marked on them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from actuated_characters.metrics.recording_metrics import ContactSeries
from actuated_characters.report.decimation import decimated, span_maxima, span_means, span_starts
from actuated_characters.studies.framework.plots import label, make_panels
from msgs_config.arrays import FloatArray, IntArray

_WIDTH = 11.0  # inches
_ROW = 0.24  # inches of a row of a heat map
_COLUMNS = 3  # small multiples in a row
_CELLS = 700  # of a heat map, along the time
_POINTS = 4000  # of a path
_BINS = 60  # of a histogram
_SATURATED = 1.0 - 1e-9
_TIME = "simulation time (s)"
_THIN = 0.9
_REFERENCE: dict[str, Any] = {"color": "black", "linestyle": "--", "linewidth": 1.0, "alpha": 0.8}
_PUSH = "tab:orange"
_THROW: dict[str, Any] = {"color": "tab:red", "linestyle": "--"}
_MODES = {
    "TRACK": "tab:green",
    "REACT": "tab:red",
    "SEARCH": "black",
    "BLEND": "tab:blue",
    "LIMP": "tab:brown",
}
_OTHER_MODE = "tab:pink"
_BAND = 0.04  # of a panel's height, that the modes take up at its top ...
_BAND_ABOVE = 0.02  # ... and above it, where colours have a meaning
_MOMENTS: dict[str, dict[str, Any]] = {
    "reset": {"color": "black", "linestyle": "-"},
    "parameter changed": {"color": "tab:purple", "linestyle": ":"},
    "pause": {"color": "tab:gray", "linestyle": "-."},
}


@dataclass(frozen=True)
class Marks:
    """What happened, s since the first state."""

    pushes: Sequence[tuple[float, float]] = ()  # start and duration
    resets: Sequence[float] = ()
    changes: Sequence[float] = ()  # of parameters
    pauses: Sequence[float] = ()
    throws: Sequence[float] = ()
    modes: Sequence[tuple[float, float, str]] = ()  # start, duration and name

    @property
    def _moments(self) -> dict[str, Sequence[float]]:
        return {"reset": self.resets, "parameter changed": self.changes, "pause": self.pauses}

    def draw(self, axes: Axes, *, filled: bool = True) -> None:
        """Draw them over a panel whose x is time; not filled, where colours have a meaning."""
        for start, duration in self.pushes:
            axes.axvline(start, color=_PUSH, linewidth=1.0)
            if filled:
                axes.axvspan(start, start + duration, color=_PUSH, alpha=0.3, linewidth=0)
            else:
                axes.axvline(start + duration, color=_PUSH, linewidth=1.0)
        for name, times in self._moments.items():
            for time in times:
                axes.axvline(time, linewidth=1.0, **_MOMENTS[name])
        for time in self.throws:
            axes.axvline(time, linewidth=1.0, **_THROW)
        band = (1.0 - _BAND, 1.0) if filled else (1.0, 1.0 + _BAND_ABOVE)
        for start, duration, name in self.modes:
            color = _MODES.get(name, _OTHER_MODE)
            end = start + duration
            axes.axvspan(start, end, *band, color=color, linewidth=0, clip_on=False)

    def explained(self, figure: Figure) -> Figure:
        """The figure, with what the marks are below its panels, if there are any."""
        handles: list[Line2D | Patch] = []
        if self.pushes:
            handles.append(Patch(color=_PUSH, alpha=0.5, label="push"))
        if self.throws:
            handles.append(Line2D([], [], label="ball let go", **_THROW))
        for mode in dict.fromkeys(name for _, _, name in self.modes):
            handles.append(Patch(color=_MODES.get(mode, _OTHER_MODE), label=mode))
        for name, times in self._moments.items():
            if times:
                handles.append(Line2D([], [], label=name, **_MOMENTS[name]))
        if handles:
            figure.legend(
                handles=handles, loc="outside lower center", ncols=len(handles), fontsize="small"
            )
        return figure


def error_chart(
    times: FloatArray,  # (t,) s
    errors: FloatArray,  # (t, k) rad or m
    names: Sequence[str],
    units: Sequence[str],
    breaks: IntArray,
    marks: Marks,
) -> Figure:
    """One panel a joint: how far it is from its reference, all joints of a unit to one scale."""
    columns = min(_COLUMNS, len(names))
    rows = -(-len(names) // columns)
    figure, panels = make_panels(rows, columns, (_WIDTH, 1.45 * rows + 0.7), same_x=True)
    tops = {unit: _top(errors[:, [u == unit for u in units]]) for unit in set(units)}
    at, drawn = decimated(*broken(times, errors, breaks))
    for number, (panel, name, unit) in enumerate(zip(panels, names, units, strict=False)):
        marks.draw(panel)
        panel.plot(at, drawn[:, number], linewidth=_THIN)
        panel.set_ylim(0.0, tops[unit])
        last = number + columns >= len(names)
        named = number % columns == 0 or len(tops) > 1
        label(panel, _TIME if last else "", f"error ({unit})" if named else "", name, legend=None)
        panel.tick_params(labelbottom=last)
    for panel in panels[len(names) :]:
        panel.set_axis_off()
    span_time(panels, times)
    return marks.explained(figure)


def effort_chart(
    times: FloatArray,  # (t + 1,) s
    shares: FloatArray,  # (t, k) of the limit
    names: Sequence[str],
    marks: Marks,
) -> Figure:
    """A heat map: the largest share of its limit that each joint's effort reached, over time."""
    figure, (panel,) = make_panels(1, 1, (_WIDTH, _ROW * len(names) + 1.6))
    colors = colormaps["Blues"].with_extremes(over="red", bad="white")
    mesh = panel.pcolormesh(
        _edges(times, len(shares)),
        np.arange(len(names) + 1),
        span_maxima(shares, _CELLS).T,
        cmap=colors,
        vmin=0.0,
        vmax=_SATURATED,
        rasterized=True,
    )
    marks.draw(panel, filled=False)
    _name_rows(panel, names)
    panel.set_xlabel(_TIME)
    bar = figure.colorbar(mesh, ax=panel, extend="max", pad=0.01)
    bar.set_label("effort / limit; red: at it", fontsize="small")
    return marks.explained(figure)


def root_chart(
    times: FloatArray,  # (t,) s
    position: FloatArray,  # (t, 3) m, world
    reference: FloatArray,  # (t, 3) m, NaN where there is none
    errors: FloatArray,  # (t, 2) m and rad
    breaks: IntArray,
    marks: Marks,
) -> Figure:
    """The root's path from above, its height, and how far it is from the reference."""
    figure = Figure(figsize=(_WIDTH, 5.4), layout="constrained")
    grid = figure.add_gridspec(2, 3, height_ratios=(1.3, 1.0))
    above = figure.add_subplot(grid[0, :])
    rows = strided(len(times), breaks)
    styles: dict[str, dict[str, Any]] = {"simulated": {"linewidth": 1.2}, "reference": _REFERENCE}
    for (name, style), path in zip(styles.items(), (position, reference), strict=True):
        _, drawn = broken(times[rows], path[rows], np.searchsorted(rows, breaks))
        if not np.isnan(drawn).all():
            above.plot(drawn[:, 0], drawn[:, 1], label=name, **style)
    above.plot(*position[0, :2], marker="o", markersize=5, color="black", linestyle="none")
    above.set_aspect("equal", adjustable="datalim")
    label(above, "x (m)", "y (m)", "from above; the dot is the begin")
    height = figure.add_subplot(grid[1, 0])
    at, drawn = decimated(*broken(times, np.stack((position[:, 2], reference[:, 2]), 1), breaks))
    height.plot(at, drawn[:, 0], linewidth=_THIN, label="simulated")
    if not np.isnan(drawn[:, 1]).all():
        height.plot(at, drawn[:, 1], label="reference", **_REFERENCE)
    label(height, _TIME, "height (m)", legend=None)
    panels = [height]
    at, drawn = decimated(*broken(times, errors, breaks))
    for column, name in enumerate(("position error (m)", "rotation error (rad)")):
        if np.isnan(drawn[:, column]).all():
            continue
        panel = figure.add_subplot(grid[1, column + 1], sharex=height)
        panel.plot(at, drawn[:, column], linewidth=_THIN)
        panel.set_ylim(bottom=0.0)
        label(panel, _TIME, name, legend=None)
        panels.append(panel)
    for panel in panels:
        marks.draw(panel)
    span_time(panels, times)
    return marks.explained(figure)


def contact_chart(
    times: FloatArray, contacts: ContactSeries, weight: float, marks: Marks
) -> Figure:
    """Which link touched something when, and the vertical force on all of them over the weight."""
    count = max(len(contacts.links), 1)
    heights = (_ROW * count + 0.3, 1.6)
    figure = Figure(figsize=(_WIDTH, sum(heights) + 0.9), layout="constrained")
    above, below = figure.subplots(2, sharex=True, height_ratios=heights)
    if contacts.links:
        above.pcolormesh(
            _edges(times, len(contacts.touching)),
            np.arange(len(contacts.links) + 1),
            span_means(contacts.touching.astype(float), _CELLS).T,
            cmap="Blues",
            vmin=0.0,
            vmax=1.5,  # not too dark for the marks
            rasterized=True,
        )
        _name_rows(above, contacts.links)
    else:
        above.set_yticks([])
        above.text(0.5, 0.5, "nothing touched anything", transform=above.transAxes, ha="center")
    above.set_title("links that touched something", fontsize="medium")
    at, drawn = decimated(times[:-1], contacts.vertical_force[:, np.newaxis] / weight)
    below.plot(at, drawn[:, 0], linewidth=_THIN, label="vertical force / weight")
    below.axhline(1.0, **_REFERENCE)
    label(below, _TIME, "vertical force / weight", legend=None)
    marks.draw(above, filled=False)
    marks.draw(below)
    span_time([above], times)
    return marks.explained(figure)


def tick_chart(
    times: FloatArray,  # (t + 1,) s
    steps: FloatArray,  # (t,) s of wall time, NaN for a pause
    period: float,  # s of wall time; 0 where nothing paces the run
    late: FloatArray | None,  # (t + 1,) s
    marks: Marks,
) -> Figure:
    """Wall time from state to state, as a histogram and over time; how late, if it was paced."""
    rows = 1 if late is None else 2
    figure = Figure(figsize=(_WIDTH, 2.6 * rows + 0.4), layout="constrained")
    grid = figure.add_gridspec(rows, 3)
    counted, over_time = figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1:])
    shown = 1e3 * np.maximum(steps, 1e-6)
    known = shown[~np.isnan(shown)]
    if len(known) and known.max() > known.min():
        counted.hist(known, bins=np.geomspace(known.min(), known.max(), _BINS).tolist())
        counted.set_xscale("log")
    else:
        counted.hist(known)
    counted.set_yscale("log")
    label(counted, "wall time of a tick (ms)", "ticks", "how often, pauses left out", legend=None)
    at, drawn = decimated(times[1:], shown[:, np.newaxis])
    over_time.plot(at, drawn[:, 0], linewidth=0.6)
    over_time.set_yscale("log")
    label(over_time, "" if rows > 1 else _TIME, "wall time (ms)", "over time", legend=None)
    panels = [over_time]
    if period:
        counted.axvline(1e3 * period, label="period", **_REFERENCE)
        over_time.axhline(1e3 * period, label="period", **_REFERENCE)
        for axes in (counted, over_time):
            axes.legend(loc="upper right", fontsize="small")
    if late is not None:
        panel = figure.add_subplot(grid[1, 1:], sharex=over_time)
        at, drawn = decimated(times, 1e3 * late[:, np.newaxis])
        panel.plot(at, drawn[:, 0], linewidth=0.6)
        panel.axhline(1e3 * period, label="a period", **_REFERENCE)
        label(panel, _TIME, "lateness (ms)", "behind the schedule", legend="upper right")
        panels.append(panel)
    for panel in panels:
        marks.draw(panel)
    span_time(panels, times)
    return marks.explained(figure)


def broken(
    times: FloatArray, values: FloatArray, breaks: IntArray
) -> tuple[FloatArray, FloatArray]:
    """The series with NaN before each row of `breaks`, so that no line is drawn over a reset."""
    if not len(breaks):
        return times, values
    return (
        np.insert(times, breaks, times[breaks]),
        np.insert(values, breaks, np.nan, axis=0),
    )


def strided(length: int, breaks: IntArray) -> IntArray:
    """Rows of a path that are enough to draw it; those at which an episode begins among them."""
    rows = np.concatenate((span_starts(length, _POINTS), breaks, [length - 1]))
    return np.unique(rows.astype(np.intp))


def _edges(times: FloatArray, length: int) -> FloatArray:
    """Times at which the cells of a heat map of so many ticks begin, and that of the end."""
    return np.append(times[span_starts(length, _CELLS)], times[length])


def _name_rows(axes: Axes, names: Sequence[str]) -> None:
    axes.set_yticks(np.arange(len(names)) + 0.5, names, fontsize="small")
    axes.invert_yaxis()


def span_time(panels: Sequence[Axes], times: FloatArray) -> None:
    """Let panels have the times (t,) of a recording as their width."""
    if times[-1] > times[0]:
        for panel in panels:
            panel.set_xlim(float(times[0]), float(times[-1]))


def _top(values: FloatArray) -> float:
    """Where an axis of values from 0 on is to end."""
    known = values[np.isfinite(values)]
    return 1.05 * float(known.max(initial=0.0)) or 1.0
