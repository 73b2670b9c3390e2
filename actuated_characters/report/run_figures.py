"""The figures of a run as a table, and over time as a plot: those that its character has."""

from collections.abc import Iterable, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from actuated_characters.metrics.run_metrics import Series, slider_columns
from actuated_characters.runs.run_directory import PLOT, read_figures
from actuated_characters.studies.framework.plots import label, make_panels
from actuated_characters.whole_files import write_whole
from msgs_config.arrays import FloatArray

_SIZE = (10.0, 2.2)  # inches, of a panel
_NO_LIMIT = 1e-3  # a share of an effort limit that tells nothing of a slider with a nominal limit
_DASHED: dict[str, Any] = {"linestyle": "--", "color": "black", "alpha": 0.8}
_PLAIN: dict[str, Any] = {}

Line = tuple[str, FloatArray, dict[str, Any]]
"""A line's name in the legend, its values (t,) and its style."""


def describe_figures(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Name and value of each figure that could be measured, as a table shows them."""
    known = {name: _shown(value) for name, value in summary.items() if value is not None}
    of_root = known.pop("root_actuators", "0")
    if of_root != "0":
        known["actuators"] += f", {of_root} of them the root's assistance"
    return list(known.items())


def _shown(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name}: {part}" for name, part in value.items()) or "none"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def plot_figures(directory: Path) -> None:
    """Draw the figures that a run left in its directory into `plot.png` there.

    Raises:
        RecordingError: there are none, or it cannot be written.
    """
    content = BytesIO()
    draw_figures(*read_figures(directory)).savefig(content, format="png", dpi=110)
    write_whole(directory / PLOT, content.getvalue())


def draw_figures(summary: Mapping[str, Any], series: Series) -> Figure:
    """One panel for each quantity that the character has; see `Measurement` for the arguments."""
    panels = {unit: list(_known(lines)) for unit, lines in _panels(summary, series).items()}
    panels = {unit: lines for unit, lines in panels.items() if lines}
    width, height = _SIZE
    count = max(len(panels), 1)
    figure, axes = make_panels(count, 1, (width, height * count + 0.4), same_x=True)
    for panel, (unit, lines) in zip(axes, panels.items(), strict=False):
        for name, values, style in lines:
            panel.plot(series["time_s"], values, label=name, linewidth=0.9, **style)
        label(panel, "", unit, legend="upper right")
    axes[-1].set_xlabel("simulation time (s)")
    figure.suptitle(f"{summary['character']}, {summary['ticks']} ticks")
    return figure


def _known(lines: Iterable[Line]) -> Iterable[Line]:
    """The lines that have a value."""
    return (line for line in lines if not np.isnan(line[1]).all())


def _panels(summary: Mapping[str, Any], series: Series) -> dict[str, list[Line]]:
    """The lines of each panel, by what its axis shows; NaN throughout if there are none."""
    suffix = slider_columns("")[0]
    sliders = [name.removeprefix(suffix) for name in series if name.startswith(suffix)]
    places, efforts = list[Line](), list[Line]()
    for slider in sliders:
        position, reference, effort = slider_columns(slider)
        places.append((slider, series[position], _PLAIN))
        places.append((f"{slider}, reference", series[reference], _DASHED))
        efforts.append((slider, series[effort], _PLAIN))
    shares = [("assistance / weight", series["assist_force_n"] / _weight(summary), _PLAIN)]
    of_limit = series["effort_of_limit_max"]
    if not sliders or of_limit.max(initial=0.0) > _NO_LIMIT:
        shares.append(("largest joint effort / limit", of_limit, _PLAIN))
    return {
        "joint error (rad)": [
            ("mean", series["joint_error_mean_rad"], _PLAIN),
            ("largest", series["joint_error_max_rad"], _PLAIN),
        ],
        "sliders (m)": places,
        "root error (m)": [("error", series["root_error_m"], _PLAIN)],
        "root height (m)": [
            ("simulated", series["root_height_m"], _PLAIN),
            ("reference", series["reference_root_height_m"], _DASHED),
        ],
        "force of sliders (N)": efforts,
        "effort": shares,
    }


def _weight(summary: Mapping[str, Any]) -> float:
    return float(summary["body_weight_n"] or np.nan)
