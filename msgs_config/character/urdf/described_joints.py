"""The joints of a character's `robot_description`: those that URDF knows, and where they are.

A ball joint is three hinges between links without mass: yaw, pitch and roll, URDF's own angles
(about z, then the new y, then the new x). A sensor is a link without mass, fixed to the link that
it is on.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character, Joint, Link, Pose, Vector
from msgs_config.character.sensors import Sensor
from msgs_config.character.urdf.mimic import Mimic
from msgs_config.frame_names import BASE_FRAME
from msgs_config.geometry import elementary, rotations

_AT_PARENT = Pose()
_BALL_AXES: dict[str, tuple[Vector, float]] = {  # axis, and the largest angle, rad
    "yaw": ((0.0, 0.0, 1.0), math.pi),
    "pitch": ((0.0, 1.0, 0.0), 0.5 * math.pi),
    "roll": ((1.0, 0.0, 0.0), math.pi),
}


@dataclass(frozen=True)
class DescribedJoint:
    """A fixed joint, hinge or slider between two links of the description."""

    name: str
    type: JointType
    parent: str
    child: str
    pose: Pose = _AT_PARENT  # pose of the child in the parent at position 0
    axis: Vector = (0.0, 0.0, 0.0)  # axis in the child's frame
    lower: float = -math.inf  # rad or m
    upper: float = math.inf
    effort_limit: float = math.inf  # N m or N
    mimic: Mimic | None = None  # says which joint this one follows


class DescribedJoints:
    """The joints of the description, parents first, and their positions in a state."""

    def __init__(self, character: Character, base_frame: str = BASE_FRAME) -> None:
        """`base_frame` becomes the root, z up and x forward, unless a link has that name."""
        self._layout = character.layout
        self._links = character.frame_names | {sensor.name for sensor in character.sensors}
        self._names = {link.joint.name for link in character.links[1:]}
        self._names |= {frame.joint for frame in character.frames}
        root = character.links[0].name
        self.has_own_base = base_frame not in self._links
        self.root = base_frame if self.has_own_base else root
        self.turn_xyzw = rotations.ABOUT_X_QUARTER_TURN_XYZW  # turns the base link into the root
        if not (self.has_own_base and character.up_axis == "y"):
            self.turn_xyzw = np.array(rotations.IDENTITY_XYZW)
        joints: list[DescribedJoint] = []
        if self.has_own_base:
            pose = Pose.of_arrays(np.zeros(3), self.turn_xyzw)
            name = _unused(f"{base_frame}_joint", self._names)
            joints.append(DescribedJoint(name, JointType.FIXED, base_frame, root, pose))
        for link in character.links[1:]:
            joints += self._describe(link, character.links[link.parent].name)
        for frame in character.frames:
            joints.append(
                DescribedJoint(frame.joint, JointType.FIXED, frame.parent, frame.name, frame.pose)
            )
        joints += map(self._describe_sensor, character.sensors)
        self.joints = tuple(joints)

    def _describe(self, link: Link, parent: str) -> Iterator[DescribedJoint]:
        joint = link.joint
        if joint.type is not JointType.SPHERICAL:
            yield _as_it_is(joint, parent, link.name)
            return
        pose = joint.pose_in_parent
        for angle, (axis, largest) in _BALL_AXES.items():
            child = link.name
            if angle != "roll":
                child = _unused(f"{link.name}_{angle}", self._links)
            yield DescribedJoint(
                name=_unused(f"{joint.name}_{angle}", self._names),
                type=JointType.REVOLUTE,
                parent=parent,
                child=child,
                pose=pose,
                axis=axis,
                lower=-largest,
                upper=largest,
                effort_limit=joint.effort_limit,
            )
            parent, pose = child, _AT_PARENT

    def _describe_sensor(self, sensor: Sensor) -> DescribedJoint:
        pose = Pose(sensor.position, sensor.orientation_xyzw)
        name = _unused(f"{sensor.name}_joint", self._names)
        return DescribedJoint(name, JointType.FIXED, sensor.link, sensor.name, pose)

    @cached_property
    def fixed(self) -> tuple[DescribedJoint, ...]:
        """The joints that do not move."""
        return tuple(joint for joint in self.joints if joint.type is JointType.FIXED)

    @cached_property
    def moving(self) -> tuple[DescribedJoint, ...]:
        """The joints that move; `positions` and `poses` have their order."""
        return tuple(joint for joint in self.joints if joint.type is not JointType.FIXED)

    def positions(self, position: FloatArray) -> FloatArray:
        """Positions (m,) of the moving joints, rad or m, of the character's position (n,)."""
        angles = np.concatenate((position, self._ball_angles(position)))
        picked: FloatArray = angles[self._entries]
        return picked

    def poses(self, positions: FloatArray) -> FloatArray:
        """Positions and orientations xyzw (m, 7) of the moving joints' children in the parents."""
        half = 0.5 * positions
        turns = np.empty((len(half), 4))
        turns[:, :3] = self._axes * np.where(self._hinges, elementary.sin(half), 0.0)[:, np.newaxis]
        turns[:, 3] = np.where(self._hinges, elementary.cos(half), 1.0)
        slides = self._axes * np.where(self._hinges, 0.0, positions)[:, np.newaxis]
        poses = np.empty((len(half), 7))
        poses[:, :3] = self._origins[:, :3] + rotations.rotate(self._origins[:, 3:], slides)
        poses[:, 3:] = rotations.multiply(self._origins[:, 3:], turns)
        return poses

    def _ball_angles(self, position: FloatArray) -> FloatArray:
        """Yaw, pitch and roll (3 b,) of the ball joints, rad."""
        turns = rotations.matrix(rotations.exp(position[self._ball_entries]))
        return rotations.yaw_pitch_roll(turns).ravel()

    @cached_property
    def _ball_entries(self) -> IntArray:
        balls = [joint for joint in self._layout.joints if joint.type is JointType.SPHERICAL]
        rows = [np.arange(ball.start, ball.start + 3) for ball in balls]
        return np.array(rows, dtype=np.intp).reshape(-1, 3)

    @cached_property
    def _entries(self) -> list[int]:
        """Where each moving joint is among the character's position and the balls' angles."""
        entries, of_balls = list[int](), self._layout.size
        for joint in self._layout.joints:
            if joint.type is JointType.SPHERICAL:
                entries += range(of_balls, of_balls + 3)
                of_balls += 3
            elif joint.type is not JointType.FLOATING:
                entries.append(joint.start)
        return entries

    @cached_property
    def _hinges(self) -> BoolArray:
        return np.array([joint.type is JointType.REVOLUTE for joint in self.moving], dtype=np.bool_)

    @cached_property
    def _axes(self) -> FloatArray:
        return np.array([joint.axis for joint in self.moving]).reshape(-1, 3)

    @cached_property
    def _origins(self) -> FloatArray:
        return pose_rows(self.moving)


def pose_rows(joints: tuple[DescribedJoint, ...]) -> FloatArray:
    """Positions and orientations xyzw (m, 7) of joints' children in their parents at position 0."""
    rows = [(*joint.pose.position, *joint.pose.orientation_xyzw) for joint in joints]
    return np.array(rows).reshape(-1, 7)


def _as_it_is(joint: Joint, parent: str, child: str) -> DescribedJoint:
    return DescribedJoint(
        name=joint.name,
        type=joint.type,
        parent=parent,
        child=child,
        pose=joint.pose_in_parent,
        axis=joint.axis_in_child,
        lower=joint.lower,
        upper=joint.upper,
        effort_limit=joint.effort_limit,
        mimic=joint.mimic,
    )


def _unused(name: str, used: set[str]) -> str:
    """The name, or the next with underscores that is not used, which is used from then on."""
    while name in used:
        name += "_"
    used.add(name)
    return name
