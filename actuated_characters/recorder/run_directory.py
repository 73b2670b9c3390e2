"""The directory of a run's results: its figures as a summary and as series over time."""

import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from actuated_characters.bags.format.metadata import BAG, EARLIER_BAG
from actuated_characters.metrics.run_metrics import Series
from msgs_config.errors import RecordingError, RunError
from msgs_config.whole_files import part_of, write_whole, writing

PARAMETERS, LOGS = "parameters", "logs"
DAMAGED = BAG + ".damaged"  # what a recovery leaves beside the bag that it makes
SUMMARY, SERIES, PLOT = "summary.json", "measurements.csv", "plot.png"
STRIP, VIDEO = "strip.png", "video.mp4"  # what `render` makes of the bag
REPORT = "report"  # what `report` makes of the bag
_MOST_NUMBERED = 10_000  # directories whose names differ by a number alone


def prepare_directory(directory: Path, *, overwrite: bool, characters: Sequence[str] = ()) -> None:
    """Make a directory ready for a run's results; remove those of an earlier run, nothing else.

    `characters` are the names of several, each of which has figures of its own.

    Raises:
        RunError: there are results and `overwrite` is not set, or files that no run has made.
    """
    names = (
        BAG,
        EARLIER_BAG,
        DAMAGED,
        PARAMETERS,
        LOGS,
        SUMMARY,
        SERIES,
        PLOT,
        STRIP,
        VIDEO,
        REPORT,
    )
    results = [directory / name for name in (*names, *characters)]
    results += [part_of(path) for path in results]  # left by a run that was killed
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


def prepare_free_directory(directory: Path) -> Path:
    """Make a directory ready whose name nobody gave: with a number, where it has results already.

    Raises:
        RunError: it cannot be written to.
    """
    for number in range(1, _MOST_NUMBERED):
        free = directory if number == 1 else directory.with_name(f"{directory.name}-{number}")
        if not free.exists() or not any(free.iterdir()):
            break
    prepare_directory(free, overwrite=False)
    return free


def metrics_directory(run: Path, namespace: str, *, is_alone: bool) -> Path:
    """Where a character's figures are: in a run's directory, or in a folder of its name there.

    Args:
        run: The directory of the run.
        namespace: That of the character's topics, which ends in its name; or the name itself.
        is_alone: Whether it is the only one, and has no name in its world.
    """
    return run if is_alone else run / namespace.rpartition("/")[2]


def write_metrics(directory: Path, summary: dict[str, object], series: Series) -> None:
    """Write `measurements.csv` with a line of column names, and then `summary.json`, each whole.

    Raises:
        RecordingError: the directory cannot be written to.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"cannot write to {directory}: {error.strerror or error}") from error
    rows, header = np.column_stack(list(series.values())), ",".join(series)
    with writing(directory / SERIES) as part:
        np.savetxt(part, rows, delimiter=",", header=header, comments="", fmt="%.9g")
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


def read_metrics(directory: Path) -> tuple[dict[str, Any], Series]:
    """The summary and the series that a run left in a directory.

    Raises:
        RecordingError: there are none.
    """
    try:
        summary = json.loads((directory / SUMMARY).read_text(encoding="utf-8"))
        with (directory / SERIES).open(encoding="utf-8") as file:
            names = file.readline().strip().split(",")
            rows = np.loadtxt(file, delimiter=",", ndmin=2).reshape(-1, len(names))
    except (OSError, ValueError) as error:
        raise RecordingError(f"{directory} holds no figures of a run") from error
    return summary, dict(zip(names, rows.T, strict=True))
