"""What a BVH file contains, as it contains it: its own units, axes and channel orders."""

from dataclasses import dataclass
from itertools import accumulate

from msgs_config.arrays import FloatArray

POSITIONS = ("Xposition", "Yposition", "Zposition")
ROTATIONS = ("Xrotation", "Yrotation", "Zrotation")
CHANNELS = (*POSITIONS, *ROTATIONS)
"""The names of channels; positions are in the file's unit of length, rotations in degrees."""


@dataclass(frozen=True)
class EndSite:
    """The end of a chain of joints, a point without channels."""

    joint: int  # index of the joint that it belongs to
    offset: tuple[float, float, float]  # in the joint's frame, file units


@dataclass(frozen=True)
class Skeleton:
    """The j joints of a BVH file in its order, in which parents come before their children.

    All frames are parallel in the pose of zero rotations. A joint turns by its rotation channels
    in their order: `R = R_first R_second R_third`, from the joint's frame into its parent's.
    """

    names: tuple[str, ...]  # names of the j joints; the first is the root's
    parents: tuple[int, ...]  # index of each joint's parent; -1 of the root
    offsets: FloatArray  # (j, 3) of each joint in its parent's frame, file units
    channels: tuple[tuple[str, ...], ...]  # each joint's, from `CHANNELS`, in the file's order
    end_sites: tuple[EndSite, ...]

    @property
    def channel_starts(self) -> tuple[int, ...]:
        """Column of each joint's first channel among the values of a frame."""
        return tuple(accumulate(map(len, self.channels[:-1]), initial=0))

    @property
    def channel_count(self) -> int:
        """Number c of values in a frame."""
        return sum(map(len, self.channels))


@dataclass(frozen=True)
class BvhMotion:
    """A skeleton and its motion."""

    skeleton: Skeleton
    frame_time: float  # s
    values: FloatArray  # (f, c) of each frame's channels, joint by joint; file units and degrees
