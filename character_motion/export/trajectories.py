"""What moves over time, and where links and balls are at equal steps of it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import floor

import numpy as np

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.model import Character, Shape
from msgs_config.clips.nearest_rows import nearest_rows
from msgs_config.errors import ConfigurationError
from msgs_config.geometry import rotations

_MOST_FRAMES = 100_000
_STEP_ROUNDING = 1e-6  # share of a step, so that the last frame is not lost to rounding

Progress = Callable[[int], None]
"""Is told how many frames there are so far."""


@dataclass(frozen=True)
class CharacterTrajectory:
    """The positions of one character at t times; rotations are in the quaternions alone."""

    name: str  # name in its world, or the character's own
    character: Character
    configurations: GeneralizedPosition  # (t, n) message form, (t, k, 4)
    color_number: int = 0  # which colours it has among those of its world


@dataclass(frozen=True)
class BallTrajectory:
    """Where a ball or box is at t times; NaN while it is not in the world."""

    name: str
    shape: Shape
    centres: FloatArray  # (t, 3) m, world
    turns_xyzw: FloatArray  # (t, 4)


@dataclass(frozen=True)
class LinkPoses:
    """The frames of l links in the world at f times."""

    origins: FloatArray  # (f, l, 3) m
    turns_xyzw: FloatArray  # (f, l, 4)


@dataclass(frozen=True)
class Trajectories:
    """All that moves in one world, at t times."""

    times: FloatArray  # (t,) s, rising from 0
    rate: float  # Hz, at which it is sampled unless told
    characters: tuple[CharacterTrajectory, ...]
    balls: tuple[BallTrajectory, ...] = ()
    cuts: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    """Rows that do not go on from the one before: the first ones of episodes."""
    has_plane: bool = True  # whether the ground is the plane z = 0

    def sample_times(
        self, start: float = 0.0, end: float | None = None, rate: float | None = None
    ) -> FloatArray:
        """Times (f,) in s, from a start on in equal steps to an end, by default the last time.

        Raises:
            ConfigurationError: there is no such part, or the rate is not possible.
        """
        last = float(self.times[-1])
        end, rate = last if end is None else end, self.rate if rate is None else rate
        if not 0.0 < rate < np.inf:
            raise ConfigurationError(f"{rate:g} frames a second; it must be positive and finite")
        if not 0.0 <= start <= end <= last + _STEP_ROUNDING:
            raise ConfigurationError(
                f"from {start:g} s to {end:g} s is not in the motion, which lasts {last:g} s"
            )
        count = (end - start) * rate + _STEP_ROUNDING
        if count >= _MOST_FRAMES:
            raise ConfigurationError(
                f"there would be {count:.0f} frames; it must be {_MOST_FRAMES} or fewer: choose a "
                "part, or fewer frames a second"
            )
        return start + np.arange(floor(count) + 1.0) / rate

    def link_poses(
        self, trajectory: CharacterTrajectory, times: FloatArray, progress: Progress | None = None
    ) -> LinkPoses:
        """Where the links of a character are at some times (f,) in s."""
        character = trajectory.character
        model, still = DynamicsModel(character), np.zeros(character.layout.size)
        origins = np.empty((len(times), len(character.links), 3))
        turns_xyzw = np.empty((len(times), len(character.links), 4))
        for frame, position in enumerate(self.positions(trajectory, times)):
            model.update(position, still)
            origins[frame], turns_xyzw[frame] = model.link_poses()
            if progress is not None:
                progress(frame + 1)
        return LinkPoses(origins, turns_xyzw)

    def positions(self, trajectory: CharacterTrajectory, times: FloatArray) -> FloatArray:
        """Positions (f, n), message form, at times (f,) in s; between two by the shortest turns."""
        layout, known = trajectory.character.layout, trajectory.configurations
        rows, shares = self._rows(times)
        after = np.minimum(rows + 1, len(self.times) - 1)
        before = GeneralizedPosition(known.position[rows], known.orientations_xyzw[rows])
        way = shares * layout.difference(
            before, GeneralizedPosition(known.position[after], known.orientations_xyzw[after])
        )
        positions = before.position + way
        turned = rotations.exp(way[:, layout.rotation_entries])
        turns = rotations.multiply(before.orientations_xyzw, turned)
        positions[:, layout.rotation_entries] = rotations.log(turns)
        return positions

    def _rows(self, times: FloatArray) -> tuple[IntArray, FloatArray]:
        """The last row (f,) before each time, and the share (f, 1) of the way to the next one."""
        if len(self.times) == 1:
            return np.zeros(len(times), dtype=np.intp), np.zeros((len(times), 1))
        rows = np.searchsorted(self.times, times, side="right").clip(1, len(self.times) - 1) - 1
        shares = ((times - self.times[rows]) / np.diff(self.times)[rows]).clip(0.0, 1.0)
        shares = np.where(np.isin(rows + 1, self.cuts), np.round(shares), shares)
        return rows, shares[:, np.newaxis]

    def sampled_balls(self, times: FloatArray) -> tuple[BallTrajectory, ...]:
        """The balls at some times (f,) in s, each as it is in the state nearest to it."""
        rows = nearest_rows(self.times, times)
        return tuple(
            BallTrajectory(each.name, each.shape, each.centres[rows], each.turns_xyzw[rows])
            for each in self.balls
        )
