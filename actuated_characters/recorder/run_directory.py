"""The directory of a run's results: its figures as a summary and as series over time."""

import json
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from actuated_characters.bags.directory_lock import is_locked
from actuated_characters.bags.format.metadata import BAG, EARLIER_BAG
from actuated_characters.metrics.run_metrics import Series
from msgs_config.errors import RecordingError, RunError
from msgs_config.files import dump_yaml
from msgs_config.whole_files import part_of, write_whole, writing

PARAMETERS, LOGS = "parameters", "logs"
DAMAGED = BAG + ".damaged"  # what a recovery leaves beside the bag that it makes
SUMMARY, SERIES, PLOT = "summary.json", "measurements.csv", "plot.png"
STRIP, VIDEO = "strip.png", "video.mp4"  # what `render` makes of the bag
REPORT = "report"  # what `report` makes of the bag
_FIGURES = (SUMMARY, SERIES, PLOT)
_RESULTS = (BAG, EARLIER_BAG, DAMAGED, PARAMETERS, LOGS, *_FIGURES, STRIP, VIDEO, REPORT)
_MOST_NUMBERED = 10_000  # directories whose names differ by a number alone


def _with_parts(names: Iterable[str]) -> set[str]:
    """The names, and those of what a run leaves that is killed while it writes them."""
    return {name for each in names for name in (each, part_of(Path(each)).name)}


_PARTS, _PARTS_OF_FIGURES = _with_parts(_RESULTS), _with_parts(_FIGURES)


def prepare_directory(directory: Path, *, overwrite: bool) -> None:
    """Make a directory ready for a run's results; remove those of an earlier run, nothing else.

    Raises:
        RunError: there are results and `overwrite` is not set, or files that no run has made.
    """
    try:
        present = list(directory.iterdir()) if directory.exists() else []
        if not all(map(_is_result, present)):
            raise RunError(f"{directory} holds other files than a run's results; choose another")
        if present and not overwrite:
            raise RunError(f"{directory} holds results already; --overwrite replaces them")
        for path in present:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        (directory / PARAMETERS).mkdir(parents=True)
        (directory / LOGS).mkdir()
    except OSError as error:
        raise RunError(f"cannot write to {directory}: {error.strerror or error}") from error


def prepare_free_directory(directory: Path, *, replace: bool = False) -> Path:
    """Make a directory ready whose name nobody gave; returns it.

    It has a number where there are results already, unless these are to be replaced: then where
    there is anything else, or a run that is still recorded.

    Raises:
        RunError: it cannot be written to.
    """
    numbers = range(2, _MOST_NUMBERED)
    numbered = (directory.with_name(f"{directory.name}-{number}") for number in numbers)
    is_free = _is_replaceable if replace else _is_empty
    try:
        free = next((each for each in (directory, *numbered) if is_free(each)), directory)
    except OSError as error:
        raise RunError(f"cannot write to {directory}: {error.strerror or error}") from error
    prepare_directory(free, overwrite=replace)
    return free


def _is_empty(directory: Path) -> bool:
    return not directory.exists() or (directory.is_dir() and not any(directory.iterdir()))


def _is_replaceable(directory: Path) -> bool:
    if not directory.is_dir():
        return not directory.exists()
    return all(map(_is_result, directory.iterdir())) and not is_locked(directory / BAG)


def _is_result(path: Path) -> bool:
    """Whether a run has made it; what a killed one left counts, too.

    A folder of any other name is a character's, if it has figures, or nothing yet.
    """
    if path.name in _PARTS:
        return True
    if path.is_symlink() or not path.is_dir():
        return False
    inside = {each.name for each in path.iterdir()}
    begins_with = {SERIES, part_of(Path(SERIES)).name}
    return not inside or (inside <= _PARTS_OF_FIGURES and not inside.isdisjoint(begins_with))


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
    write_whole(file, dump_yaml(content, sort_keys=True))
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
