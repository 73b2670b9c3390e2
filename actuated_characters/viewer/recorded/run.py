"""A recorded run as the viewer shows it, state by state."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.bags.robots.reading import RobotSource, read_any
from actuated_characters.render.scene import RecordedScene, make_scene
from actuated_characters.viewer.drawing.sample import CharacterSample
from actuated_characters.viewer.recorded.timeline import row_at
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Shape
from msgs_config.errors import RecordingError
from msgs_config.messages.projectiles import BallStates
from msgs_config.messages.state import StampedState

_WRENCH_DURATION = 0.1  # s: what simulators have by default


@dataclass(frozen=True)
class RecordedRun:
    """The characters of one world of a recording, over the ticks that there are of all."""

    path: Path
    scene: RecordedScene
    starts: float = 0.0  # s, when its first state is in the time of the run that it is beside

    @property
    def name(self) -> str:
        """What it is called where there are several."""
        return self.path.resolve().name

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """Those of its characters."""
        return self.scene.recordings

    @property
    def times(self) -> FloatArray:
        """Simulation time (t + 1,) of each state since the first one, s."""
        return self.scene.times

    @property
    def can_be_forked(self) -> bool:
        """Whether it is of one character of this project's simulator, as `fork` wants it."""
        return len(self.recordings) == 1 and bool(self.recordings[0].parameters)

    @property
    def push_duration(self) -> float:
        """How long a push acts, s, at first."""
        return float(self.recordings[0].parameters.get("wrench_duration", _WRENCH_DURATION))

    def sample(self, character: int, row: int) -> CharacterSample:
        """What is known of one character, by its number, in a state."""
        recording = self.recordings[character]
        effort, contacts, pushes = None, None, None
        if row and not np.isnan(recording.effort[row - 1]).any():
            effort = recording.effort[row - 1]
            contacts = recording.contacts[row - 1] if recording.contacts else None
            pushes = recording.applied_wrench[row - 1] if recording.applied_wrench else None
        reference = recording.reference_position[row]
        return CharacterSample(
            StampedState(
                int(recording.stamps_ns[row]),
                recording.position[row],
                recording.velocity[row],
                effort,
            ),
            None if np.isnan(reference).any() else reference,
            contacts,
            pushes,
        )

    def position_at(self, character: int, time: float) -> FloatArray | None:
        """Where a character was at a time in s, (n,), message form; None before the first state.

        The time is that of the run that this one is beside.
        """
        if time < self.starts:
            return None
        row = row_at(self.times, time - self.starts)
        position: FloatArray = self.recordings[character].position[row]
        return position

    def balls(self, row: int) -> tuple[BallStates | None, list[Shape]]:
        """The balls and boxes that are there in a state, and their shapes."""
        recording = self.recordings[0]
        states = recording.balls[row] if recording.balls else None
        return states, self.scene.ball_shapes(row, () if states is None else states.names)


def read_run(path: Path, source: RobotSource | None = None) -> RecordedRun:
    """Read a run's directory or a bag; `source` says whose a bag of another robot is.

    Raises:
        RecordingError: there is no recording of a world, or none that can be read.
    """
    return RecordedRun(path, make_scene(read_any(path, source or RobotSource())))


def beside(run: RecordedRun, other: RecordedRun) -> RecordedRun:
    """Another run at the time of a run, both from their first states on.

    A fork is at the time of the run that it is of, also where it is recorded from a keyframe on.

    Raises:
        RecordingError: they have not the same characters.
    """
    check_comparable(run, other)
    stamps_ns, first_ns = run.recordings[0].stamps_ns, int(other.recordings[0].stamps_ns[0])
    row = min(int(np.searchsorted(stamps_ns, first_ns)), len(stamps_ns) - 1)
    is_same = stamps_ns[row] == first_ns and all(
        np.array_equal(ours.position[row], theirs.position[0])
        for ours, theirs in zip(run.recordings, other.recordings, strict=True)
    )
    return replace(other, starts=float(run.times[row]) if is_same else 0.0)


def check_comparable(run: RecordedRun, other: RecordedRun) -> None:
    """Raise RecordingError unless two runs have the same characters."""
    one, two = (
        [(each.name, each.character.name, each.layout.dof_names) for each in either.recordings]
        for either in (run, other)
    )
    if one != two:
        names = [
            ", ".join(each.name or each.character.name for each in either.recordings)
            for either in (run, other)
        ]
        raise RecordingError(
            f"{other.path} cannot be shown beside {run.path}: it has other characters or degrees "
            f"of freedom ({names[1]}, not {names[0]})"
        )
