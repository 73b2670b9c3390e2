"""Joint states of a recording, or the positions of a clip, as a CSV file."""

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from actuated_characters.bags.recording import Recording
from character_motion.export.trajectories import Trajectories
from msgs_config.arrays import FloatArray
from msgs_config.whole_files import writing


def write_joint_states(recording: Recording, file: Path, *, reference: bool = False) -> None:
    """Write one row a state, numbers such that they are read back to the last bit.

    The columns are `time_s`, `stamp_ns`, `episode`, and `position.NAME`, `velocity.NAME`,
    `effort.NAME` and, if wanted, `reference_position.NAME` and `reference_velocity.NAME` for each
    degree of freedom. `effort` was applied in the tick before the state; where there was none, or
    no reference, the cells are empty. The file is whole or not there at all.

    Raises:
        RecordingError: the file cannot be written.
    """
    before_first = np.full((1, recording.layout.size), np.nan)
    kinds = {
        "position": recording.position,
        "velocity": recording.velocity,
        "effort": np.vstack((before_first, recording.effort)),
    }
    if reference:
        kinds["reference_position"] = recording.reference_position
        kinds["reference_velocity"] = recording.reference_velocity
    rows = np.arange(len(recording.stamps_ns))
    heads = {
        "time_s": recording.times.tolist(),
        "stamp_ns": recording.stamps_ns.tolist(),
        "episode": np.searchsorted(recording.episode_rows, rows, side="right").tolist(),
    }
    _write(file, heads, kinds, recording.layout.dof_names)


def write_clip(motion: Trajectories, file: Path) -> None:
    """Write one row a frame of a clip: `time_s`, and `position.NAME` of each degree of freedom.

    Raises:
        RecordingError: the file cannot be written.
    """
    (trajectory,) = motion.characters
    positions = motion.positions(trajectory, motion.times)
    heads = {"time_s": motion.times.tolist()}
    _write(file, heads, {"position": positions}, trajectory.character.layout.dof_names)


def _write(
    file: Path,
    heads: Mapping[str, Sequence[float]],
    kinds: Mapping[str, FloatArray],
    dof_names: Sequence[str],
) -> None:
    """Write a table of r rows: columns of one value a row, then arrays (r, n) by their kind."""
    with writing(file) as part, part.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([*heads, *(f"{kind}.{name}" for kind in kinds for name in dof_names)])
        for row, head in enumerate(zip(*heads.values(), strict=True)):
            values = np.concatenate([values[row] for values in kinds.values()]).tolist()
            writer.writerow([*head, *("" if math.isnan(value) else value for value in values)])
