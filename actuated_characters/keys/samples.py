"""The motion that keys are to follow, how near they must stay, and coordinates to find them in."""

from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.layout import SCALAR, GeneralizedPosition, JointLayout, JointType
from msgs_config.errors import ConfigurationError
from msgs_config.geometry import rotations


@dataclass(frozen=True)
class Tolerances:
    """How far the path may be from the motion: the root's place and sliders, and rotations."""

    angle: float = 0.05  # rad
    place: float = 0.01  # m

    def __post_init__(self) -> None:
        """Raises ConfigurationError if one is not positive."""
        for name, value, unit in (("angle", self.angle, "rad"), ("place", self.place, "m")):
            if not 0.0 < value < np.inf:
                raise ConfigurationError(f"--{name} is {value:g} {unit}; it must be more than 0")

    def of_vectors(self, layout: JointLayout) -> FloatArray:
        """The tolerance (b,) of each physical vector of a layout, in rad or m."""
        tolerances = []
        for joint in layout.joints:
            slides = joint.type in (JointType.PRISMATIC, JointType.FLOATING)
            tolerances.append(self.place if slides else self.angle)
            if joint.type not in (*SCALAR, JointType.SPHERICAL):
                tolerances.append(self.angle)
        return np.array(tolerances)


@dataclass(frozen=True)
class Samples:
    """A motion at m moments: frames are the even ones, between two of them is one more."""

    times: FloatArray  # (m,) s, rising from 0
    configurations: GeneralizedPosition  # (m, n), (m, k, 4)

    def __getitem__(self, rows: IntArray | slice) -> "Samples":
        """Some of the moments, in order."""
        whole = self.configurations
        return Samples(
            self.times[rows],
            GeneralizedPosition(whole.position[rows], whole.orientations_xyzw[rows]),
        )

    def at(self, layout: JointLayout, times: FloatArray) -> GeneralizedPosition:
        """The motion at other times (p,) in s within it, with constant velocities in between."""
        rows = np.searchsorted(self.times, times, side="right").clip(1, len(self.times) - 1) - 1
        start, end = self[rows], self[rows + 1]
        share = ((times - start.times) / (end.times - start.times)).clip(0.0, 1.0)
        way = spatial_difference(layout, start.configurations, end.configurations)
        return moved(layout, start.configurations, share[:, np.newaxis] * way)


def half_frames(
    layout: JointLayout, times: FloatArray, configurations: GeneralizedPosition
) -> Samples:
    """A clip of frames at times (f,) in s, with the moments halfway between its frames."""
    between = 0.5 * (times[1:] + times[:-1])
    frames = Samples(times, configurations)
    every = np.empty(2 * len(times) - 1)
    every[::2], every[1::2] = times, between
    return Samples(every, frames.at(layout, every))


def spatial_difference(
    layout: JointLayout, start: GeneralizedPosition, end: GeneralizedPosition
) -> FloatArray:
    """Difference (..., n) from `start` to `end`: rad and m, a rotation's in the parent's frame."""
    difference: FloatArray = end.position - start.position
    turns = rotations.multiply(end.orientations_xyzw, rotations.conjugate(start.orientations_xyzw))
    difference[..., layout.rotation_entries] = rotations.log(turns)
    return difference


def moved(layout: JointLayout, start: GeneralizedPosition, way: FloatArray) -> GeneralizedPosition:
    """Configurations moved by differences (..., n), the inverse of `spatial_difference`."""
    entries = layout.rotation_entries
    turns = rotations.multiply(rotations.exp(way[..., entries]), start.orientations_xyzw)
    positions = start.position + way
    positions[..., entries] = rotations.log(turns)
    return GeneralizedPosition(positions, turns)


def unrolled(layout: JointLayout, samples: Samples) -> FloatArray:
    """Coordinates (m, n) in rad and m that begin at zero and grow as the motion moves.

    Those of a rotation are its angular velocity in the parent's frame, summed up over time; so
    they pass any number of turns, and small differences of them are rotation vectors.
    """
    steps = spatial_difference(layout, samples[:-1].configurations, samples[1:].configurations)
    return np.concatenate((np.zeros((1, layout.size)), np.cumsum(steps, axis=0)))
