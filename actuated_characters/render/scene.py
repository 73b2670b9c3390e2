"""What there is to be seen of a recording: the characters of one world, state by state."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from actuated_characters.bags.recording import Recording
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.errors import RecordingError
from msgs_config.shared_parameters import PLANE

_RADIUS = 0.1  # m, of a ball of which it was not recorded
_ROUNDING = 1e-9  # s: two distances are as good as equal


@dataclass(frozen=True)
class Scene:
    """The characters of one world over t ticks; n degrees of freedom in all.

    Arrays have those of one character after those of another.
    """

    recordings: tuple[Recording, ...]  # of the same ticks

    @property
    def characters(self) -> tuple[Character, ...]:
        """As they stood there."""
        return tuple(recording.character for recording in self.recordings)

    @property
    def times(self) -> FloatArray:
        """Simulation time (t + 1,) of each state since the first one, s."""
        return self.recordings[0].times

    @property
    def ground(self) -> bool:
        """Whether there was the plane z = 0."""
        return bool(self.recordings[0].parameters.get("terrain", PLANE) == PLANE)

    @property
    def terrain(self) -> UrdfOptions | None:
        """What else lay there."""
        return self.recordings[0].world.terrain

    @cached_property
    def position(self) -> FloatArray:
        """Positions (t + 1, n), message form."""
        return np.hstack([recording.position for recording in self.recordings])

    @cached_property
    def reference(self) -> FloatArray:
        """Reference positions (t + 1, n), NaN where a character had none."""
        return np.hstack([recording.reference_position for recording in self.recordings])

    @property
    def has_reference(self) -> bool:
        """Whether any character ever had one."""
        return bool(np.isfinite(self.reference).any())

    @property
    def episode_rows(self) -> IntArray:
        """Rows of the first states of episodes; the first row is one."""
        return self.recordings[0].episode_rows

    def balls(self, row: int) -> FloatArray:
        """Centres and radii (m, 4) of the balls that are there in a state, m."""
        recording = self.recordings[0]
        said = recording.balls[row] if recording.balls else None
        if said is None:
            return np.zeros((0, 4))
        first = int(self.episode_rows[np.searchsorted(self.episode_rows, row, side="right") - 1])
        thrown = [throw for each in recording.throws[first:row] for throw in each]
        radii = [throw.radius for throw in thrown] + [_RADIUS] * len(said.names)
        return np.column_stack((said.motion[:, :3], radii[: len(said.names)]))


def make_scene(recordings: Sequence[Recording]) -> Scene:
    """The scene of the characters of one world, over the ticks that there are of all of them.

    Raises:
        RecordingError: they are of several worlds, or have no tick in common.
    """
    worlds = sorted({recording.world.namespace for recording in recordings})
    if len(worlds) > 1:
        names = ", ".join(recording.name for recording in recordings)
        raise RecordingError(
            f"the recording has several worlds ({', '.join(map(repr, worlds))}); "
            f"name one character of these: {names}"
        )
    first = max(int(recording.stamps_ns[0]) for recording in recordings)
    last = min(int(recording.stamps_ns[-1]) for recording in recordings)
    if first > last:
        raise RecordingError("the recording has no tick that all its characters have")
    return Scene(tuple(_cut(recording, first, last) for recording in recordings))


def _cut(recording: Recording, first_ns: int, last_ns: int) -> Recording:
    """What is seen of a recording, from one stamp to another."""
    stamps = recording.stamps_ns
    begin, end = np.searchsorted(stamps, (first_ns, last_ns)).tolist()
    if (begin, end) == (0, len(stamps) - 1):
        return recording
    states, ticks = slice(begin, end + 1), slice(begin, end)
    return replace(
        recording,
        stamps_ns=stamps[states],
        published_ns=recording.published_ns[states],
        position=recording.position[states],
        velocity=recording.velocity[states],
        effort=recording.effort[ticks],
        reference_position=recording.reference_position[states],
        reference_velocity=recording.reference_velocity[states],
        contacts=recording.contacts[ticks],
        applied_wrench=recording.applied_wrench[ticks],
        throws=recording.throws[ticks],
        balls=recording.balls[states],
        commands=recording.commands[states],
    )


def nearest_rows(times: FloatArray, wanted: FloatArray) -> IntArray:
    """The states (p,) nearest to these times (p,) in s, of two that are as near the earlier one.

    `times` are those of the states (t + 1,), in order.
    """
    after = np.searchsorted(times, wanted - _ROUNDING).clip(1, max(len(times) - 1, 1))
    if len(times) == 1:
        return np.zeros_like(after)
    before = after - 1
    nearer = wanted - times[before] <= times[after] - wanted + _ROUNDING
    rows: IntArray = np.where(nearer, before, after)
    return rows
