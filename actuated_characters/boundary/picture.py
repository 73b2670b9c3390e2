"""The picture of a search: up to where runs hold, over what varies, or around the character."""

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from actuated_characters.boundary.survey import Point, Survey
from actuated_characters.sweep.grid import cell_text, parameter_name
from msgs_config.whole_files import writing

PICTURE = "boundary.png"
_MOST_PANELS, _PANELS_IN_ROW = 24, 4
_PANEL = 3.0  # inches
_HOLDS, _ALL_HOLD, _HOLE, _FAILED = "tab:green", "tab:olive", "tab:blue", "tab:red"
_WIDEST = math.radians(30.0)  # of a bar


def draw(found: Survey, file: Path) -> bool:
    """Draw the points without an error; returns whether there is anything to draw.

    Raises:
        RecordingError: the file cannot be written.
    """
    points = [point for point in found.points if point.tried and not point.error]
    columns = [name for name in (points[0].cells if points else ()) if _varies(name, points)]
    if not columns:
        file.unlink(missing_ok=True)  # it would be of an earlier search
        return False
    around = found.search.around
    along = around if around in columns else columns[-1]
    panels = _panels(points, [name for name in columns if name != along])[:_MOST_PANELS]
    width = min(len(panels), _PANELS_IN_ROW)
    height = math.ceil(len(panels) / width)
    size = (max(width, 2) * _PANEL, height * _PANEL + 0.5)
    figure, limits = Figure(figsize=size, layout="constrained"), _limits(found, points)
    for place, (title, inside) in enumerate(panels, start=1):
        if along == around:
            axes: Axes = figure.add_subplot(height, width, place, projection="polar")
            _draw_around(axes, found, inside, limits)
        else:
            axes = figure.add_subplot(height, width, place)
            _draw_along(axes, found, inside, along)
            axes.set_ylim(*limits)
        axes.set_title(title, fontsize="medium")
    figure.suptitle(_title(found), fontsize="medium")
    labels = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(labels.values(), labels, loc="outside lower center", ncols=3, fontsize="small")
    with writing(file) as part:
        figure.savefig(part, dpi=120, format="png")
    return True


def _title(found: Survey) -> str:
    name, within = parameter_name(found.search.value), found.search.way.within
    return f"{name} up to which runs hold, found to within {within:g}"


def _varies(name: str, points: Sequence[Point]) -> bool:
    return len({point.cells[name] for point in points}) > 1


def _panels(points: Sequence[Point], columns: Sequence[str]) -> list[tuple[str, list[Point]]]:
    """The points by all that varies but what is drawn along, each with its title."""
    panels: dict[str, list[Point]] = {}
    for point in points:
        title = ", ".join(
            f"{parameter_name(name)} {cell_text(point.cells[name])}" for name in columns
        )
        panels.setdefault(title, []).append(point)
    return list(panels.items())


def _draw_around(
    axes: Axes, found: Survey, points: Sequence[Point], limits: tuple[float, float]
) -> None:
    """Bars around the character, which faces upwards; the angle is that of where a push is from.

    Each goes from where the search begins to where runs hold, inwards if the search leads down.
    """
    assert isinstance(axes, PolarAxes)
    begin = float(found.search.way.first)
    angles = [math.radians(float(point.cells[found.search.around] or 0)) for point in points]
    axes.set_theta_zero_location("N")
    axes.set_ylim(*limits)
    axes.tick_params(labelsize="x-small")
    for colour, label, are_open in ((_HOLDS, "holds", False), (_ALL_HOLD, "nothing failed", True)):
        for angle, point in zip(angles, points, strict=True):
            boundary = found.boundary(point)
            if boundary.holds is None or (boundary.fails is None) != are_open:
                continue
            length = boundary.holds - begin
            axes.bar(angle, length, _width(angles), begin, color=colour, alpha=0.6, label=label)
    _draw_marks(axes, found, angles, points)


def _width(angles: Sequence[float]) -> float:
    """Of bars at angles, all in rad, which neither overlap nor say much of what was not tried."""
    around = sorted({angle % math.tau for angle in angles})
    gaps = (b - a for a, b in pairwise([*around, around[0] + math.tau]))
    return 0.9 * min(*gaps, _WIDEST)


def _limits(found: Survey, points: Sequence[Point]) -> tuple[float, float]:
    """The values between which there is something to be seen, the less one first."""
    way, boundaries = found.search.way, [found.boundary(point) for point in points]
    ends = [value for each in boundaries for value in (each.fails, *each.holes)]
    known = [float(way.last) if value is None else float(value) for value in ends]
    margin = 0.05 * (way.last - way.first)
    furthest = (min if way.last < way.first else max)(known, default=float(way.last)) + margin
    return min(furthest, float(way.first)), max(furthest, float(way.first))


def _draw_along(axes: Axes, found: Survey, points: Sequence[Point], name: str) -> None:
    """A line over what varies; what is no number stands in the order of the file."""
    cells = [point.cells[name] for point in points]
    are_numbers = all(type(cell) in (int, float) for cell in cells)
    places = [
        float(cell) if are_numbers and isinstance(cell, (int, float)) else float(count)
        for count, cell in enumerate(cells)
    ]
    if not are_numbers:
        axes.set_xticks(places, [cell_text(cell) or "-" for cell in cells], rotation=30, ha="right")
    boundaries = [found.boundary(point) for point in points]
    heights = [math.nan if each.holds is None else float(each.holds) for each in boundaries]
    axes.plot(places, heights, color=_HOLDS, marker=".", label="holds")
    full = [
        (place, height)
        for place, height, each in zip(places, heights, boundaries, strict=True)
        if each.fails is None
    ]
    _mark(axes, full, color=_ALL_HOLD, marker="^", label="nothing failed")
    _draw_marks(axes, found, places, points)
    axes.set_xlabel(parameter_name(name))
    axes.set_ylabel(parameter_name(found.search.value))
    axes.grid(alpha=0.3)


def _draw_marks(
    axes: Axes, found: Survey, places: Sequence[float], points: Sequence[Point]
) -> None:
    """Mark what holds beyond the first failure, and where nothing holds."""
    boundaries = [(place, found.boundary(p)) for place, p in zip(places, points, strict=True)]
    holes = [(place, float(value)) for place, each in boundaries for value in each.holes]
    failed = [(place, float(found.search.way.first)) for place, b in boundaries if b.holds is None]
    _mark(axes, holes, color=_HOLE, marker="o", markersize=4, label="holds again")
    _mark(axes, failed, color=_FAILED, marker="x", label="the first value fails")


def _mark(axes: Axes, places: Sequence[tuple[float, float]], **style: Any) -> None:
    """Mark places, if there are any."""
    if places:
        axes.plot(*zip(*places, strict=True), linestyle="", fillstyle="none", **style)
