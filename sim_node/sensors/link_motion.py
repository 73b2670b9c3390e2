"""Where one link is and how it moves, by the character's state alone.

The engine's own velocities of links need a call for all of them; what a sensor reads is a function
of published states, which a recording can repeat.
"""

from collections.abc import Sequence
from typing import NamedTuple

from msgs_config.character.layout import JointType
from msgs_config.character.model import Character, Joint, Pose
from msgs_config.geometry import scalars

_NO_VECTOR = (0.0, 0.0, 0.0)


class FrameMotion(NamedTuple):
    """A frame in the world, and its motion."""

    origin: scalars.Vector  # m
    turn_xyzw: scalars.Quaternion
    velocity: scalars.Vector  # the origin's, m/s, world axes
    angular_velocity: scalars.Vector  # rad/s, in the frame itself

    def at(self, position: Sequence[float], orientation_xyzw: Sequence[float]) -> "FrameMotion":
        """The motion of a frame that is fixed to this one, in the pose given in it."""
        axes = scalars.axes(self.turn_xyzw)
        x, y, z = scalars.to_parent(axes, position)
        vx, vy, vz = scalars.to_parent(axes, scalars.cross(self.angular_velocity, position))
        (ox, oy, oz), (wx, wy, wz) = self.origin, self.velocity
        into_frame = scalars.axes(scalars.conjugate(orientation_xyzw))
        return FrameMotion(
            (ox + x, oy + y, oz + z),
            scalars.multiply(self.turn_xyzw, orientation_xyzw),
            (wx + vx, wy + vy, wz + vz),
            scalars.to_parent(into_frame, self.angular_velocity),
        )


AT_REST = FrameMotion(_NO_VECTOR, (0.0, 0.0, 0.0, 1.0), _NO_VECTOR, _NO_VECTOR)
"""The motion of the world itself."""


class LinkKinematics:
    """The motion of one link: of the base, and through the joints from there to the link."""

    def __init__(self, character: Character, link: str) -> None:
        """Find the joints between the base and the link of that name."""
        names = [each.name for each in character.links]
        row, path = names.index(link), list[Joint]()
        while row > 0:
            path.append(character.links[row].joint)
            row = character.links[row].parent
        self._floats = character.layout.has_floating_base
        self._base: Pose = character.links[0].joint.pose_in_parent
        entries = {joint.name: joint.entries for joint in character.layout.joints}
        self._joints = [(joint, entries.get(joint.name, slice(0, 0))) for joint in reversed(path)]

    def motion(self, position: Sequence[float], velocity: Sequence[float]) -> FrameMotion:
        """The link's motion in a state (n,), message form."""
        moving = FrameMotion(
            self._base.position, self._base.orientation_xyzw, _NO_VECTOR, _NO_VECTOR
        )
        if self._floats:
            x, y, z, *turn = position[:6]
            vx, vy, vz, wx, wy, wz = velocity[:6]
            moving = FrameMotion((x, y, z), scalars.exp(turn), (vx, vy, vz), (wx, wy, wz))
        for joint, entries in self._joints:
            pose = joint.pose_in_parent
            moving = moving.at(pose.position, pose.orientation_xyzw)
            if joint.type is not JointType.FIXED:
                moving = _move(moving, joint, position[entries], velocity[entries])
        return moving

    def orientation(self, position: Sequence[float]) -> scalars.Quaternion:
        """The link's orientation xyzw in a position (n,), message form; the same as `motion`'s."""
        turn = self._base.orientation_xyzw
        if self._floats:
            turn = scalars.exp(position[3:6])
        for joint, entries in self._joints:
            turn = scalars.multiply(turn, joint.pose_in_parent.orientation_xyzw)
            if joint.type is JointType.SPHERICAL:
                turn = scalars.multiply(turn, scalars.exp(position[entries]))
            elif joint.type is JointType.REVOLUTE:
                (angle,), (x, y, z) = position[entries], joint.axis_in_child
                turned = scalars.exp((angle * x, angle * y, angle * z))
                turn = scalars.multiply(turn, turned)
        return turn


def _move(
    still: FrameMotion, joint: Joint, position: Sequence[float], velocity: Sequence[float]
) -> FrameMotion:
    """The motion of a joint's child; `still` is that at position and velocity 0."""
    if joint.type is JointType.PRISMATIC:
        (shift,), (speed,), (x, y, z) = position, velocity, joint.axis_in_child
        vx, vy, vz = scalars.to_parent(
            scalars.axes(still.turn_xyzw), (speed * x, speed * y, speed * z)
        )
        moved = still.at((shift * x, shift * y, shift * z), AT_REST.turn_xyzw)
        wx, wy, wz = moved.velocity
        return moved._replace(velocity=(wx + vx, wy + vy, wz + vz))
    if joint.type is JointType.REVOLUTE:
        (angle,), (rate,), (x, y, z) = position, velocity, joint.axis_in_child
        position, velocity = (angle * x, angle * y, angle * z), (rate * x, rate * y, rate * z)
    turned = still.at(_NO_VECTOR, scalars.exp(position))
    (vx, vy, vz), (wx, wy, wz) = velocity, turned.angular_velocity
    return turned._replace(angular_velocity=(wx + vx, wy + vy, wz + vz))
