"""The picture of a comparison: how two recordings drift apart."""

import numpy as np
from matplotlib.figure import Figure

from actuated_characters.render.plots import label, make_panels
from actuated_characters.report.comparison.comparison import RecordingComparison
from actuated_characters.report.decimation import decimated

_SIZE = (11.0, 3.4)  # inches, of each character's panel
_LOG_ZERO = 1e-17  # rad or m; stands for 0 on a logarithmic axis


def draw_comparisons(comparisons: list[RecordingComparison]) -> Figure:
    """One panel a character: the difference of joints, sliders and root over time."""
    width, height = _SIZE
    figure, panels = make_panels(len(comparisons), 1, (width, height * len(comparisons)))
    for panel, comparison in zip(panels, comparisons, strict=True):
        growth = comparison.growth
        curves = {
            "joints, largest (rad)": growth.joints,
            "sliders, largest (m)": growth.sliders,
            "root (m)": growth.root,
        }
        for name, values in curves.items():
            if np.isnan(values).all():
                continue
            times, drawn = decimated(growth.times, np.maximum(values, _LOG_ZERO)[:, np.newaxis])
            panel.plot(times, drawn[:, 0], linewidth=0.9, label=name)
        if comparison.first is not None:
            panel.axvline(
                comparison.first.time, color="black", linestyle=":", label="first difference"
            )
        panel.set_yscale("log")
        panel.set_ylim(bottom=_LOG_ZERO)
        has_curves = bool(panel.get_legend_handles_labels()[0])
        label(
            panel,
            "simulation time (s)",
            "difference",
            comparison.name,
            legend="lower right" if has_curves else None,
        )
    return figure
