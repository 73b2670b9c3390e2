"""What a behaviour is asked for in a run, planned before it, each time from a stamp on."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from actuated_characters.runs.planned.files import Planned, read_planned
from msgs_config.messages.joint_state import JointStateEncoder


@dataclass(frozen=True)
class PlannedBehaviour(Planned):
    """What is asked for until the next time."""

    ask: str  # a value of `Ask`

    def encode(self) -> bytes:
        """The serialised message of `~/behaviour`."""
        return JointStateEncoder([self.ask], "").encode(self.stamp_ns)


def read_behaviours(file: Path) -> Sequence[PlannedBehaviour]:
    """Read a file of `write_planned`. Raises RecordingError as `read_planned`."""
    return read_planned(file, "behaviours", lambda fields: PlannedBehaviour(**fields))
