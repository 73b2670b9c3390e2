"""The charts of a report: series over simulation time, with the run's events marked on them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import Colormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from actuated_characters.metrics.error_measures import AT_LIMIT
from actuated_characters.render.plots import label, make_panels
from actuated_characters.report.decimation import decimated, span_maxima, span_means, span_starts
from msgs_config.arrays import BoolArray, FloatArray, IntArray

TIME = "simulation time (s)"

_WIDTH = 11.0  # inches
_ROW = 0.24  # inches of a row of a heat map
_COLUMNS = 3  # panels in a row
_HEIGHT, _HEIGHT_ALONE = 1.45, 2.2  # inches of a panel among others in a row, and alone in it
_DPI = 110
_CELLS = 700  # cells of a heat map along the time
_POINTS = 4000  # points of a path
_BINS = 60  # bins of a histogram
_REFERENCE: dict[str, Any] = {"color": "black", "linestyle": "--", "linewidth": 1.0, "alpha": 0.8}
_PUSH = "tab:orange"
_MODES = {
    "TRACK": "tab:green",
    "REACT": "tab:red",
    "SEARCH": "black",
    "BLEND": "tab:blue",
    "LIMP": "tab:brown",
}
_OTHER_MODES = ("tab:pink", "tab:cyan", "tab:olive", "tab:gray", "tab:purple", "gold")
_BAND = 0.04  # share of a panel's height that the modes take up at its top ...
_BAND_ABOVE = 0.02  # ... and above the panel, if its colours have a meaning
_MOMENTS: dict[str, dict[str, Any]] = {
    "ball let go": {"color": "tab:red", "linestyle": "--"},
    "reset": {"color": "black", "linestyle": "-"},
    "parameter changed": {"color": "tab:purple", "linestyle": ":"},
    "pause": {"color": "tab:gray", "linestyle": "-."},
}


@dataclass(frozen=True)
class Marks:
    """The events of a run, s since the first state."""

    pushes: Sequence[tuple[float, float]] = ()  # start and duration
    resets: Sequence[float] = ()
    changes: Sequence[float] = ()  # changes of parameters
    pauses: Sequence[float] = ()
    throws: Sequence[float] = ()
    modes: Sequence[tuple[float, float, str]] = ()  # start, duration and name

    @property
    def _moments(self) -> dict[str, Sequence[float]]:
        each = (self.throws, self.resets, self.changes, self.pauses)
        return {name: times for name, times in zip(_MOMENTS, each, strict=True) if times}

    @property
    def _mode_colors(self) -> dict[str, str]:
        """The colour of each mode, and of each state of a machine, in their order."""
        colors: dict[str, str] = {}
        for _, _, name in self.modes:
            others = sum(mode not in _MODES for mode in colors)
            colors.setdefault(name, _MODES.get(name, _OTHER_MODES[others % len(_OTHER_MODES)]))
        return colors

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
        band = (1.0 - _BAND, 1.0) if filled else (1.0, 1.0 + _BAND_ABOVE)
        colors = self._mode_colors
        for start, duration, name in self.modes:
            color = colors[name]
            end = start + duration
            axes.axvspan(start, end, *band, color=color, linewidth=0, clip_on=False)

    def explained(self, figure: Figure) -> Figure:
        """The figure with a legend of the marks, if there are any, below its panels."""
        handles: list[Line2D | Patch] = []
        if self.pushes:
            handles.append(Patch(color=_PUSH, alpha=0.5, label="push"))
        handles += [Patch(color=color, label=mode) for mode, color in self._mode_colors.items()]
        handles += [Line2D([], [], label=name, **_MOMENTS[name]) for name in self._moments]
        if handles:
            figure.legend(
                handles=handles, loc="outside lower center", ncols=len(handles), fontsize="small"
            )
        return figure


@dataclass(frozen=True)
class Panel:
    """Curves over time in one unit."""

    unit: str  # with the quantity: the label of the y axis
    lines: Mapping[str, FloatArray]  # (t + 1,) or (t,) by name; NaN where nothing is known
    title: str = ""
    from_zero: bool = False  # for an error, which is never negative
    is_logarithmic: bool = False

    def known(self) -> "Panel":
        """The panel without the curves of which nothing is known."""
        known = {name: line for name, line in self.lines.items() if not np.isnan(line).all()}
        return replace(self, lines=known)


@dataclass(frozen=True)
class Timeline:
    """Simulation time as the x axis of a recording's panels."""

    times: FloatArray  # (t + 1,) s, of the states
    breaks: IntArray  # rows of the first states of all episodes but the first
    marks: Marks

    @property
    def path_rows(self) -> IntArray:
        """Rows of the states that are enough to draw a path, each episode's first among them."""
        count = len(self.times)
        rows = np.concatenate((span_starts(count, _POINTS), self.breaks, [count - 1]))
        return np.unique(rows.astype(np.intp))

    def path(self, rows: IntArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Times and values (r, k) of the states of some rows, interrupted where an episode ends."""
        return _interrupted(self.times[rows], values, np.searchsorted(rows, self.breaks))

    def plot(self, panel: Axes, values: FloatArray, **style: Any) -> None:
        """Draw a value of each state (t + 1,), or of each tick (t,); nothing if none is known."""
        if np.isnan(values).all():
            return
        breaks = self.breaks[self.breaks < len(values)]
        column = values[:, np.newaxis]
        at, drawn = decimated(*_interrupted(self.times[: len(values)], column, breaks))
        panel.plot(at, drawn[:, 0], **{"linewidth": 0.9, **style})

    def finish(self, figure: Figure, panels: Sequence[Axes]) -> Figure:
        """The figure, with marks on panels of series, all as wide as the recording is long."""
        for panel in panels:
            self.marks.draw(panel)
            if self.times[-1] > self.times[0]:
                panel.set_xlim(float(self.times[0]), float(self.times[-1]))
        return self.marks.explained(figure)


def png(figure: Figure) -> bytes:
    """A figure as the content of a PNG file."""
    content = BytesIO()
    figure.savefig(content, format="png", dpi=_DPI)
    return content.getvalue()


def series_chart(
    timeline: Timeline, panels: Sequence[Panel], *, columns: int = _COLUMNS, title: str = ""
) -> Figure:
    """A figure of panels row by row; those that begin at zero have one scale for each unit.

    Neither a curve of which nothing is known is drawn, nor a panel without a curve.
    """
    panels = [panel.known() for panel in panels if panel.known().lines]
    columns = min(columns, max(len(panels), 1))
    rows = max(-(-len(panels) // columns), 1)
    height = _HEIGHT if columns > 1 else _HEIGHT_ALONE
    figure, axes = make_panels(rows, columns, (_WIDTH, height * rows + 0.7), same_x=True)
    tops = {panel.unit: 0.0 for panel in panels}
    for panel in panels:
        largest = [np.nanmax(values, initial=0.0) for values in panel.lines.values()]
        tops[panel.unit] = max(tops[panel.unit], *largest) if panel.from_zero else 0.0
    for number, (each, panel) in enumerate(zip(axes, panels, strict=False)):
        for name, values in panel.lines.items():
            timeline.plot(each, values, label=name, **(_REFERENCE if "reference" in name else {}))
        if panel.from_zero:
            each.set_ylim(0.0, 1.05 * tops[panel.unit] or 1.0)
        if panel.is_logarithmic:
            each.set_yscale("log")
        is_last = number + columns >= len(panels)
        legend = "upper right" if len(panel.lines) > 1 or columns == 1 else None
        label(each, TIME if is_last else "", panel.unit, panel.title, legend=legend)
        each.tick_params(labelbottom=is_last)
    for each in axes[len(panels) :]:
        each.set_axis_off()
    figure.suptitle(title)
    return timeline.finish(figure, axes[: len(panels)])


def effort_chart(timeline: Timeline, shares: FloatArray, names: Sequence[str]) -> Figure:
    """The largest share of its limit (t, k) that each joint's effort reached, as colours."""
    colors = colormaps["Blues"].with_extremes(over="red", bad="white")
    figure, mesh = _heat_map(timeline, span_maxima(shares, _CELLS), names, colors, AT_LIMIT)
    bar = figure.colorbar(mesh, ax=figure.axes[0], extend="max", pad=0.01)
    bar.set_label("effort / limit; red: at it", fontsize="small")
    return timeline.marks.explained(figure)


def contact_chart(timeline: Timeline, touching: BoolArray, names: Sequence[str]) -> Figure:
    """When (t, k) each of some links touched something."""
    cells = span_means(touching.astype(float), _CELLS)
    figure, _ = _heat_map(timeline, cells, names, colormaps["Blues"], 1.5)  # pale: marks are seen
    return timeline.marks.explained(figure)


def _heat_map(
    timeline: Timeline, cells: FloatArray, names: Sequence[str], colors: Colormap, top: float
) -> tuple[Figure, QuadMesh]:
    """A row of cells for each of k names; `cells` (c, k), 0 to `top`, lie evenly over the ticks."""
    figure, (panel,) = make_panels(1, 1, (_WIDTH, _ROW * len(names) + 1.3))
    ticks, rows = len(timeline.times) - 1, np.arange(len(names) + 1)
    edges = np.append(timeline.times[span_starts(ticks, _CELLS)], timeline.times[ticks])
    style: dict[str, Any] = {"cmap": colors, "vmin": 0.0, "vmax": top, "rasterized": True}
    mesh = panel.pcolormesh(edges, rows, cells.T, **style)
    panel.set_yticks(rows[:-1] + 0.5, names, fontsize="small")
    panel.invert_yaxis()
    panel.set_xlabel(TIME)
    timeline.marks.draw(panel, filled=False)
    return figure, mesh


def path_chart(timeline: Timeline, position: FloatArray, reference: FloatArray) -> Figure:
    """The path of the root (t + 1, 3) from above, and that of its reference, m in the world."""
    figure, (panel,) = make_panels(1, 1, (_WIDTH, 3.2))
    rows = timeline.path_rows
    styles: dict[str, dict[str, Any]] = {"simulated": {"linewidth": 1.2}, "reference": _REFERENCE}
    for (name, style), values in zip(styles.items(), (position, reference), strict=True):
        _, path = timeline.path(rows, values[rows])
        if not np.isnan(path).all():
            panel.plot(path[:, 0], path[:, 1], label=name, **style)
    panel.plot(*position[0, :2], marker="o", markersize=5, color="black", linestyle="none")
    panel.set_aspect("equal", adjustable="datalim")
    label(panel, "x (m)", "y (m)", "from above; the dot is the begin")
    return figure


def histogram(steps: FloatArray) -> Figure:
    """How often a tick took how much wall time, of times (t,) in ms; NaN is left out."""
    figure, (panel,) = make_panels(1, 1, (_WIDTH, 2.4))
    known = steps[~np.isnan(steps)]
    if len(known) and known.max() > known.min():
        panel.hist(known, bins=np.geomspace(known.min(), known.max(), _BINS).tolist())
        panel.set_xscale("log")
    else:
        panel.hist(known)
    panel.set_yscale("log")
    label(panel, "wall time of a tick (ms)", "ticks", "how often, pauses left out", legend=None)
    return figure


def _interrupted(
    times: FloatArray, values: FloatArray, breaks: IntArray
) -> tuple[FloatArray, FloatArray]:
    """A series (r, k) with NaN before each row of `breaks`, so that no line crosses a reset."""
    if not len(breaks):
        return times, values
    return (
        np.insert(times, breaks, times[breaks]),
        np.insert(values, breaks, np.nan, axis=0),
    )
