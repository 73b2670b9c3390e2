"""The motion that a policy tracks, in the frames of its terms.

It is the reference's; or in the network itself, which then says by its other outputs where joints
and bodies are at each of its time steps, as whole_body_tracking exports it (Liao et al. 2025,
"BeyondMimic").
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from msgs_config.arrays import FloatArray, SingleArray
from msgs_config.geometry import rotations

OUTPUTS = ("joint_pos", "joint_vel", "body_pos_w", "body_quat_w")
"""What a network says of its motion; quaternions are wxyz there."""


class Pose(NamedTuple):
    """Where a body is in the world."""

    position: FloatArray  # (3,) m
    xyzw: FloatArray  # (4,)

    def seen_from(self, other: "Pose") -> "Pose":
        """It in the frame of another one."""
        back = rotations.conjugate(other.xyzw)
        position = rotations.rotate(back, self.position - other.position)
        return Pose(position, rotations.multiply(back, self.xyzw))


class TrackedMotion(NamedTuple):
    """A motion at a time, of the m joints of a policy in its order."""

    position: FloatArray  # (m,) rad or m
    velocity: FloatArray  # (m,)
    anchor: Pose | None = None


def motion_of(outputs: Mapping[str, SingleArray], body: int) -> TrackedMotion:
    """The motion that a network's outputs say, with one of its bodies as the anchor."""
    position, velocity, places, turns = (np.asarray(outputs[name], float) for name in OUTPUTS)
    anchor = Pose(places[0, body], rotations.xyzw_from_wxyz(turns[0, body]))
    return TrackedMotion(position[0], velocity[0], anchor)


class Placement(NamedTuple):
    """A move over the ground: a turn about z, and from one place to another one."""

    about_z: FloatArray  # xyzw (4,)
    start: FloatArray  # (3,) m, at height 0
    end: FloatArray  # (3,) m, at height 0

    @classmethod
    def leading(cls, start: Pose, end: Pose) -> "Placement":
        """The move from where one pose is to where another one is.

        It turns as the x axis does over the ground in the rotation from one to the other.
        """
        between = rotations.multiply(end.xyzw, rotations.conjugate(start.xyzw))
        x, y, _ = rotations.matrix(between)[:, 0].tolist()
        turn = math.atan2(y, x)
        flat = np.array((1.0, 1.0, 0.0))
        return cls(rotations.about_z(turn), flat * start.position, flat * end.position)

    def moved(self, pose: Pose) -> Pose:
        """A pose after the move."""
        position = self.end + rotations.rotate(self.about_z, pose.position - self.start)
        return Pose(position, rotations.multiply(self.about_z, pose.xyzw))
