"""The charts of a report: series over simulation time, with the run's events marked on them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from actuated_characters.metrics.error_measures import AT_LIMIT
from actuated_characters.render.plots import label, make_panels
from actuated_characters.report.decimation import decimated, span_maxima, span_starts
from actuated_characters.report.events import CHANGE, FALL, MODE, PUSH, RESET, THROW, Event
from msgs_config.arrays import BoolArray, FloatArray, IntArray

_WIDTH = 11.0  # inches
_ROW = 0.24  # inches of a row of a heat map
_COLUMNS = 3  # panels in a row
_HEIGHT, _HEIGHT_ALONE = 1.45, 2.2  # inches of a panel among others in a row, and alone in it
_DPI = 110
_CELLS = 700  # cells of a heat map along the time
_PALE = 0.6  # the colour of a contact, from 0 to 1: marks are seen on it
_REFERENCE: dict[str, Any] = {"color": "black", "linestyle": "--", "linewidth": 1.0, "alpha": 0.8}
_PUSH_COLOR = "tab:orange"
_MODE_COLORS = {
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
    THROW: {"color": "tab:red", "linestyle": "--"},
    RESET: {"color": "black", "linestyle": "-"},
    CHANGE: {"color": "tab:purple", "linestyle": ":"},
    FALL: {"color": "tab:gray", "linestyle": "-."},
}


def mode_colors(events: Sequence[Event]) -> dict[str, str]:
    """The colour (#rrggbb) of each mode, and of each state of a machine, in their order."""
    names = list(dict.fromkeys(each.label for each in events if each.kind == MODE))
    others = [name for name in names if name not in _MODE_COLORS]
    colors = {name: _OTHER_MODES[place % len(_OTHER_MODES)] for place, name in enumerate(others)}
    return {name: to_hex(_MODE_COLORS.get(name) or colors[name]) for name in names}


@dataclass(frozen=True)
class Marks:
    """The events of a run as marks on its charts."""

    events: Sequence[Event] = ()

    def draw(self, axes: Axes, *, filled: bool = True) -> None:
        """Draw them over a panel whose x is time; not filled, where colours have a meaning."""
        band = (1.0 - _BAND, 1.0) if filled else (1.0, 1.0 + _BAND_ABOVE)
        colors = mode_colors(self.events)
        for event in self.events:
            start, end = event.start, event.start + event.duration
            if event.kind == MODE:
                color = colors[event.label]
                axes.axvspan(start, end, *band, color=color, linewidth=0, clip_on=False)
            elif event.kind == PUSH:
                axes.axvline(start, color=_PUSH_COLOR, linewidth=1.0)
                if filled:
                    axes.axvspan(start, end, color=_PUSH_COLOR, alpha=0.3, linewidth=0)
                else:
                    axes.axvline(end, color=_PUSH_COLOR, linewidth=1.0)
            else:
                axes.axvline(start, linewidth=1.0, **_MOMENTS[event.kind])

    def explained(self, figure: Figure) -> Figure:
        """The figure with a legend of the marks, if there are any, below its panels."""
        kinds = {event.kind for event in self.events}
        handles: list[Line2D | Patch] = []
        if PUSH in kinds:
            handles.append(Patch(color=_PUSH_COLOR, alpha=0.5, label=PUSH))
        handles += [
            Patch(color=color, label=mode) for mode, color in mode_colors(self.events).items()
        ]
        handles += [
            Line2D([], [], label=kind, **style) for kind, style in _MOMENTS.items() if kind in kinds
        ]
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

    def plot(self, panel: Axes, values: FloatArray, **style: Any) -> None:
        """Draw a value of each state (t + 1,), or of each tick (t,); no line crosses a reset."""
        times, breaks = self.times[: len(values)], self.breaks[self.breaks < len(values)]
        times = np.insert(times, breaks, times[breaks])
        column = np.insert(values, breaks, np.nan)[:, np.newaxis]
        at, drawn = decimated(times, column)
        panel.plot(at, drawn[:, 0], **{"linewidth": 0.9, **style})


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
        is_last = number + columns >= len(panels)
        legend = "upper right" if len(panel.lines) > 1 or columns == 1 else None
        x = "simulation time (s)" if is_last else ""
        label(each, x, panel.unit, panel.title, legend=legend)
        each.tick_params(labelbottom=is_last)
        timeline.marks.draw(each)
        if timeline.times[-1] > timeline.times[0]:
            each.set_xlim(float(timeline.times[0]), float(timeline.times[-1]))
    for each in axes[len(panels) :]:
        each.set_axis_off()
    figure.suptitle(title)
    return timeline.marks.explained(figure)


def effort_chart(timeline: Timeline, shares: FloatArray, names: Sequence[str]) -> Figure:
    """The largest share of its limit (t, k) that each joint's effort reached, as colours."""
    return _heat_map(timeline, shares, names, "effort / limit; red: at it")


def contact_chart(timeline: Timeline, touching: BoolArray, names: Sequence[str]) -> Figure:
    """When (t, k) each of some links touched something."""
    return _heat_map(timeline, np.where(touching, _PALE, 0.0), names)


def _heat_map(
    timeline: Timeline, values: FloatArray, names: Sequence[str], unit: str = ""
) -> Figure:
    """A row for each of k names, of the largest values (t, k) in short spans of the ticks.

    Values are from 0 to 1 and red above; with a `unit` a bar says so.
    """
    figure, (panel,) = make_panels(1, 1, (_WIDTH, _ROW * len(names) + 1.3))
    cells, ticks, rows = span_maxima(values, _CELLS), len(values), np.arange(len(names) + 1)
    edges = np.append(timeline.times[span_starts(ticks, _CELLS)], timeline.times[ticks])
    colors = colormaps["Blues"].with_extremes(over="red", bad="white")
    mesh = panel.pcolormesh(
        edges, rows, cells.T, cmap=colors, vmin=0.0, vmax=AT_LIMIT, rasterized=True
    )
    if unit:
        bar = figure.colorbar(mesh, ax=panel, extend="max", pad=0.01)
        bar.set_label(unit, fontsize="small")
    panel.set_yticks(rows[:-1] + 0.5, names, fontsize="small")
    panel.invert_yaxis()
    panel.set_xlabel("simulation time (s)")
    timeline.marks.draw(panel, filled=False)
    return timeline.marks.explained(figure)
