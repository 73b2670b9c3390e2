"""The directory of a run's results: its figures as a summary, as series, and as a plot."""

import json
import shutil
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from actuated_characters.metrics.run_metrics import COLUMNS
from actuated_characters.whole_files import part_of, write_whole, writing
from msgs_config.arrays import FloatArray
from msgs_config.errors import RecordingError, RunError

BAG, PARAMETERS, LOGS = "bag", "parameters", "logs"
DAMAGED = BAG + ".damaged"  # what `recover` leaves beside the bag that it makes
SUMMARY, SERIES, PLOT = "summary.json", "measurements.csv", "plot.png"
STRIP, VIDEO = "strip.png", "video.mp4"  # what `render` makes of the bag
REPORT = "report"  # what `report` does


def prepare_directory(directory: Path, *, overwrite: bool) -> None:
    """Make a directory ready for a run's results; remove those of an earlier run, nothing else.

    Raises:
        RunError: there are results and `overwrite` is not set, or files that no run has made.
    """
    names = (BAG, DAMAGED, PARAMETERS, LOGS, SUMMARY, SERIES, PLOT, STRIP, VIDEO, REPORT)
    results = [directory / name for name in names]
    results += [part_of(path) for path in results]  # of a run that was killed
    try:
        present = set(directory.iterdir()) if directory.exists() else set()
        if present - set(results):
            raise RunError(f"{directory} holds other files than a run's results; choose another")
        if present and not overwrite:
            raise RunError(f"{directory} holds results already; --overwrite replaces them")
        for path in present:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        (directory / PARAMETERS).mkdir(parents=True)
        (directory / LOGS).mkdir()
    except OSError as error:
        raise RunError(f"cannot write to {directory}: {error.strerror or error}") from error


def figures_directory(run: Path, namespace: str, *, is_alone: bool) -> Path:
    """Where a character's figures are: in a run's directory, or in a folder of its name there.

    Args:
        run: The directory of the run.
        namespace: That of the character's topics, which ends in its name; or the name itself.
        is_alone: Whether it is the only one, and has no name in its world.
    """
    return run if is_alone else run / namespace.rpartition("/")[2]


def write_figures(directory: Path, summary: dict[str, object], series: FloatArray) -> None:
    """Write `measurements.csv` with a line of column names, and then `summary.json`, each whole.

    Raises:
        RecordingError: the directory cannot be written to.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"cannot write to {directory}: {error.strerror or error}") from error
    header = ",".join(COLUMNS)
    with writing(directory / SERIES) as part:
        np.savetxt(part, series, delimiter=",", header=header, comments="", fmt="%.9g")
    write_whole(directory / SUMMARY, json.dumps(summary, indent=2) + "\n")


def write_parameters(
    directory: Path, name: str, parameters: Mapping[str, object], node: str | None = None
) -> Path:
    """Write `NAME.yaml`, as `--params-file` takes it; returns its path.

    The parameters are for the node of that name, or for those that the pattern `node` matches.

    Raises:
        RecordingError: the file cannot be written.
    """
    file = directory / PARAMETERS / f"{name}.yaml"
    content = {node or name: {"ros__parameters": dict(parameters)}}
    write_whole(file, yaml.safe_dump(content))
    return file


def read_figures(directory: Path) -> tuple[dict[str, Any], FloatArray]:
    """The summary and the series (ticks, columns) that a run left in a directory.

    Raises:
        RecordingError: there are none.
    """
    try:
        summary = json.loads((directory / SUMMARY).read_text(encoding="utf-8"))
        series = np.loadtxt(directory / SERIES, delimiter=",", skiprows=1, ndmin=2)
    except (OSError, ValueError) as error:
        raise RecordingError(f"{directory} holds no figures of a run") from error
    return summary, series


def plot_figures(directory: Path) -> None:
    """Draw errors and efforts of a run over time into `plot.png`.

    Raises:
        RecordingError: there are none, or it cannot be written.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    summary, series = read_figures(directory)
    columns = dict(zip(COLUMNS, series.T, strict=True))
    figure, panels = pyplot.subplots(4, sharex=True, figsize=(10, 9), layout="constrained")
    curves = (
        ("joint error (rad)", {"mean": "joint_error_mean_rad", "largest": "joint_error_max_rad"}),
        ("root (m)", {"error": "root_error_m"}),
        ("root height (m)", {"simulated": "root_height_m", "reference": "reference_root_height_m"}),
        ("effort", {"assistance / weight": "assist", "largest joint effort / limit": "effort"}),
    )
    columns["assist"] = columns["assist_force_n"] / (summary["body_weight_n"] or np.nan)
    columns["effort"] = columns["effort_of_limit_max"]
    for panel, (label, lines) in zip(panels, curves, strict=True):
        for name, column in lines.items():
            panel.plot(columns["time_s"], columns[column], label=name, linewidth=0.9)
        panel.set_ylabel(label)
        panel.grid(alpha=0.3)
        panel.legend(loc="upper right", fontsize="small")
    panels[-1].set_xlabel("simulation time (s)")
    figure.suptitle(f"{summary['character']}, {summary['ticks']} ticks")
    content = BytesIO()
    figure.savefig(content, format="png", dpi=110)
    pyplot.close(figure)
    write_whole(directory / PLOT, content.getvalue())
