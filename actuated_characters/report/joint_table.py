"""Joint states of a recording as a CSV file."""

import csv
import math
from pathlib import Path

import numpy as np

from actuated_characters.bags.recording import Recording
from msgs_config.errors import RecordingError
from msgs_config.whole_files import writing


def write_joint_states(
    recording: Recording, file: Path, *, reference: bool = False, overwrite: bool = False
) -> None:
    """Write one row a state, numbers such that they are read back to the last bit.

    The columns are `time_s`, `stamp_ns`, `episode`, and `position.NAME`, `velocity.NAME`,
    `effort.NAME` and, if wanted, `reference_position.NAME` and `reference_velocity.NAME` for each
    degree of freedom. `effort` was applied in the tick before the state; where there was none, or
    no reference, the cells are empty. The file is whole or not there at all.

    Raises:
        RecordingError: the file exists already, or cannot be written.
    """
    check_output(file, overwrite=overwrite)
    before_first = np.full((1, recording.layout.size), np.nan)
    kinds = {
        "position": recording.position,
        "velocity": recording.velocity,
        "effort": np.vstack((before_first, recording.effort)),
    }
    if reference:
        kinds["reference_position"] = recording.reference_position
        kinds["reference_velocity"] = recording.reference_velocity
    names = [f"{kind}.{name}" for kind in kinds for name in recording.layout.dof_names]
    rows = np.arange(len(recording.stamps_ns))
    heads = zip(
        recording.times.tolist(),
        recording.stamps_ns.tolist(),
        np.searchsorted(recording.episode_rows, rows, side="right").tolist(),
        strict=True,
    )
    with writing(file) as part, part.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["time_s", "stamp_ns", "episode", *names])
        for row, head in enumerate(heads):
            values = np.concatenate([values[row] for values in kinds.values()]).tolist()
            writer.writerow([*head, *("" if math.isnan(value) else value for value in values)])


def check_output(file: Path, *, overwrite: bool) -> None:
    """Raise RecordingError if a file must not be written, as can be known before all the work."""
    if file.is_dir():
        raise RecordingError(f"cannot write {file}: it is a directory")
    if not file.absolute().parent.is_dir():
        raise RecordingError(f"cannot write {file}: its directory does not exist")
    if file.exists() and not overwrite:
        raise RecordingError(f"{file} exists already; --overwrite replaces it")
