"""Joint states of a recording as a CSV file."""

import csv
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.whole_files import writing
from msgs_config.errors import RecordingError

_HEAD = ("time_s", "stamp_ns", "episode")


def columns(recording: Recording, *, reference: bool) -> list[str]:
    """Names of the columns."""
    names = recording.layout.dof_names
    kinds = ["position", "velocity", "effort"]
    if reference:
        kinds += ["reference_position", "reference_velocity"]
    return [*_HEAD, *(f"{kind}.{name}" for kind in kinds for name in names)]


def write_joint_states(
    recording: Recording, file: Path, *, reference: bool = False, overwrite: bool = False
) -> None:
    """Write one row a state, numbers such that they are read back to the last bit.

    `effort` is what was applied in the tick before the state; where there was none, or no
    reference, the cells are empty. The file is whole or not there at all.

    Raises:
        RecordingError: the file exists already, or cannot be written.
    """
    check_output(file, overwrite=overwrite)
    with writing(file) as part, part.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns(recording, reference=reference))
        writer.writerows(_rows(recording, reference=reference))


def check_output(file: Path, *, overwrite: bool) -> None:
    """Raise RecordingError if a file must not be written, as can be known before all the work."""
    if file.is_dir():
        raise RecordingError(f"cannot write {file}: it is a directory")
    if not file.absolute().parent.is_dir():
        raise RecordingError(f"cannot write {file}: its directory does not exist")
    if file.exists() and not overwrite:
        raise RecordingError(f"{file} exists already; --overwrite replaces it")


def _rows(recording: Recording, *, reference: bool) -> Iterator[list[object]]:
    missing = np.full(recording.layout.size, np.nan)
    episode, first_rows = 0, set(recording.episode_rows.tolist())
    times = recording.times
    for row, stamp in enumerate(recording.stamps_ns.tolist()):
        episode += row in first_rows
        parts = [
            recording.position[row],
            recording.velocity[row],
            recording.effort[row - 1] if row else missing,
        ]
        if reference:
            parts += [recording.reference_position[row], recording.reference_velocity[row]]
        cells: list[object] = [float(times[row]), stamp, episode]
        for part in parts:
            cells += ["" if math.isnan(value) else value for value in part.tolist()]
        yield cells
