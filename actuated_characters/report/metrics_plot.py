"""The figures of a run as a table, and over time as a plot: those that its character has."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from actuated_characters.metrics.run_metrics import Series, slider_columns
from actuated_characters.recorder.run_directory import PLOT, read_metrics
from actuated_characters.report.charts import Marks, Panel, Timeline, png, series_chart
from msgs_config.arrays import FloatArray
from msgs_config.whole_files import write_whole

_OF_ROOT = ("root_error_mean_m", "root_error_max_m")
NOMINAL = 1e-3
"""Share of a limit below which an effort is nowhere near it, as if there were none."""


def describe_metrics(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Name and value of each figure, as a table shows them; `-` is one that has no meaning here.

    Left out are those of a kind of joint, and of a time, that there is not.
    """
    always = ("fell",) if summary["fell"] is None else ("fell", *_OF_ROOT)
    known = {
        name: _shown(value)
        for name, value in summary.items()
        if value is not None or name in always
    }
    of_root = known.pop("root_actuators", "0")
    if of_root != "0":
        known["actuators"] += f", {of_root} of them the root's assistance"
    return list(known.items())


def _shown(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name}: {part}" for name, part in value.items()) or "none"
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def plot_metrics(directory: Path) -> None:
    """Draw the figures that a run left in its directory into `plot.png` there.

    Raises:
        RecordingError: there are none, or it cannot be written.
    """
    write_whole(directory / PLOT, png(draw_metrics(*read_metrics(directory))))


def draw_metrics(summary: Mapping[str, Any], series: Series) -> Figure:
    """One panel for each quantity that the character has; see `Measurement` for the arguments."""
    timeline = Timeline(series["time_s"], np.zeros(0, dtype=np.intp), Marks())
    title = f"{summary['character']}, {summary['ticks']} ticks"
    weight = float(summary["body_weight_n"] or np.nan)
    return series_chart(timeline, _panels(series, weight), columns=1, title=title)


def _panels(series: Series, weight: float) -> list[Panel]:
    suffix = slider_columns("")[0]
    sliders = [name.removeprefix(suffix) for name in series if name.startswith(suffix)]
    places: dict[str, FloatArray] = {}
    forces: dict[str, FloatArray] = {}
    for slider in sliders:
        position, reference, force = (series[name] for name in slider_columns(slider))
        places |= {slider: position, f"{slider}, reference": reference}
        forces[slider] = force
    of_limit = series["effort_of_limit_max"]
    shares = {"assistance / weight": series["assist_force_n"] / weight}
    if not sliders or of_limit.max(initial=0.0) > NOMINAL:
        shares["largest joint effort / limit"] = of_limit
    errors = {"mean": series["joint_error_mean_rad"], "largest": series["joint_error_max_rad"]}
    heights = {"simulated": series["root_height_m"], "reference": series["reference_root_height_m"]}
    return [
        Panel("joint error (rad)", errors),
        Panel("sliders (m)", places),
        Panel("root error (m)", {"error": series["root_error_m"]}),
        Panel("root height (m)", heights),
        Panel("force of sliders (N)", forces),
        Panel("effort", shares),
    ]
