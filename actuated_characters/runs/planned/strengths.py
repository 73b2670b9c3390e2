"""Strengths of joints that are planned before a run, each from a stamp on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actuated_characters.runs.planned.files import Planned, read_planned
from msgs_config.messages.joint_state import JointStateEncoder


@dataclass(frozen=True)
class PlannedStrengths(Planned):
    """Strengths of joints by name, 0 to 1, until the next ones; all others are at 1."""

    strengths: Mapping[str, float]

    def encode(self) -> bytes:
        """The serialised message of `~/strength`."""
        encoder = JointStateEncoder(list(self.strengths), "")
        effort = np.array(list(self.strengths.values()), dtype=float)
        return encoder.encode(self.stamp_ns, effort=effort)


def read_strengths(file: Path) -> Sequence[PlannedStrengths]:
    """Read a file of `write_planned`. Raises RecordingError as `read_planned`."""
    return read_planned(file, "strengths", lambda fields: PlannedStrengths(**fields))
