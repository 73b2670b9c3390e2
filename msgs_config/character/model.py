"""Description of a character: links, joints, masses, shapes, frames, gains and defaults.

Both sides build theirs from this one description: the simulator its body, the controller its
model of the dynamics. All frames are URDF link frames; lengths in m, masses in kg.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.joints.coupling import Coupling
from msgs_config.character.layout import ROOT, JointLayout, JointType
from msgs_config.character.sensors import Sensor
from msgs_config.character.urdf.file_formats.vocabulary import LeftOut
from msgs_config.character.urdf.mimic import Mimic
from msgs_config.character.urdf.reading import ReadUrdf, read_robot
from msgs_config.errors import LayoutError
from msgs_config.geometry import fixed_order, rotations
from msgs_config.geometry.rotations import IDENTITY_XYZW

ROOT_TORQUE = ROOT + "_r"
"""Name of the gains of the floating base's rotation; those of its translation are `root`."""

Vector = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]
Quaternion = Quadruple

GREY = (0.7, 0.7, 0.7, 1.0)
"""The colour rgba of a shape that has none."""


@dataclass(frozen=True)
class Pose:
    """Position (m) and orientation of a frame in another."""

    position: Vector = (0.0, 0.0, 0.0)
    orientation_xyzw: Quaternion = IDENTITY_XYZW

    @classmethod
    def of_arrays(cls, position: FloatArray, orientation_xyzw: FloatArray) -> "Pose":
        """From a position (3,) in m and an orientation (4,)."""
        x, y, z = position.tolist()
        qx, qy, qz, qw = orientation_xyzw.tolist()
        return cls((x, y, z), (qx, qy, qz, qw))

    def scaled(self, scale: float) -> "Pose":
        """The pose with all lengths multiplied."""
        x, y, z = self.position
        return replace(self, position=(scale * x, scale * y, scale * z))


class ShapeType(Enum):
    """Kind of a shape, and the meaning of its `size`; axes of symmetry are z."""

    BOX = "box"  # edges x, y, z
    SPHERE = "sphere"  # radius
    CYLINDER = "cylinder"  # radius, length
    CAPSULE = "capsule"  # radius, length of the cylinder between the two half spheres
    MESH = "mesh"  # scale along x, y, z of what the file says


@dataclass(frozen=True)
class Shape:
    """A shape that is seen or touched. `pose` is in the link frame, `mesh` an absolute path."""

    type: ShapeType
    size: tuple[float, ...]  # m; for a mesh factors
    pose: Pose = Pose()
    color_rgba: Quadruple = GREY
    mesh: str = ""

    def without_capsule(self) -> tuple["Shape", ...]:
        """The shape itself, or a capsule's cylinder and two spheres."""
        if self.type is not ShapeType.CAPSULE:
            return (self,)
        radius, length = self.size
        x, y, z = rotations.rotate(
            np.array(self.pose.orientation_xyzw), np.array((0.0, 0.0, 0.5 * length))
        ).tolist()
        px, py, pz = self.pose.position
        ends = (px + x, py + y, pz + z), (px - x, py - y, pz - z)
        spheres = [
            replace(self, type=ShapeType.SPHERE, size=(radius,), pose=Pose(end)) for end in ends
        ]
        return (replace(self, type=ShapeType.CYLINDER), *spheres)


@dataclass(frozen=True)
class SoftLimit:
    """Bounds of a ball joint's rotation vector, kept by a spring and a damper outside of them."""

    lower: Vector  # rad
    upper: Vector  # rad
    stiffness: float  # N m/rad
    damping: float  # N m s/rad


@dataclass(frozen=True)
class Joint:
    """Joint of a link to its parent; of a base link, to the world."""

    name: str
    type: JointType
    axis_in_child: Vector = (0.0, 0.0, 0.0)
    pose_in_parent: Pose = Pose()
    lower: float = -np.inf  # rad or m
    upper: float = np.inf
    effort_limit: float = np.inf  # N m or N, of the vector's norm for a ball joint
    damping: float = 0.0  # passive; N m s/rad or N s/m
    friction: float = 0.0  # passive, of a hinge or slider; the most that it has, N m or N
    armature: float = 0.0  # of its motor's rotor, added to the mass matrix; kg m^2 or kg
    mimic: Mimic | None = None  # says what a hinge or slider follows, which follows none itself
    soft_limit: SoftLimit | None = None  # a ball joint may have one


@dataclass(frozen=True)
class Link:
    """One rigid body. `parent` is its index in `Character.links`, -1 for the base."""

    name: str
    parent: int
    joint: Joint
    mass: float
    inertia_diagonal: Vector  # kg m^2, in the inertial frame
    inertial_pose: Pose  # pose of the principal axes in the link frame
    shapes: tuple[Shape, ...] = ()  # the shapes that are seen
    collision_shapes: tuple[Shape, ...] = ()
    mass_factor: float = 1.0  # by which mass and inertia are another than its file says

    def inertia_in_link_axes(self) -> FloatArray:
        """Its inertia (3, 3) about its centre of mass along its own axes, kg m^2."""
        axes = rotations.matrix(np.array(self.inertial_pose.orientation_xyzw))
        return fixed_order.product(axes * np.array(self.inertia_diagonal), axes.T)


def layout_of(links: Iterable[Link]) -> JointLayout:
    """The order of the degrees of freedom of links, listed depth-first; raises LayoutError."""
    joints = [link.joint for link in links]
    return JointLayout(
        ((joint.name, joint.type) for joint in joints),
        (joint.name for joint in joints if joint.mimic is not None),
    )


@dataclass(frozen=True)
class Gains:
    """Gains of a joint, of its error, of that one's rate, and of its integral over time."""

    stiffness: float = 0.0  # N m/rad or N/m
    damping: float = 0.0  # N m s/rad or N s/m
    integral: float = 0.0  # N m/(rad s) or N/(m s)


@dataclass(frozen=True)
class Planning:
    """Settings that differ where joint torques are planned."""

    sigma: dict[str, float | Vector] = field(default_factory=dict)
    """By joint: how far its reference may be moved, rad or m; the measure of offsets."""
    gains: dict[str, Gains] = field(default_factory=dict)
    """By joint, instead of its others."""


@dataclass(frozen=True)
class ClipFormat:
    """Where a character's motion clips lie, which joints their columns are, and how they count."""

    pattern: str = ""  # a path with one '*', the clip's name
    joints: tuple[str, ...] = ()
    up_axis: str = "z"
    quaternion: str = "wxyz"
    base_rotation: Vector = (0.0, 0.0, 0.0)  # rad, rotation vector: the root's axes in their base's
    signs: dict[str, float] = field(default_factory=dict)
    """By joint: 1 or -1, of its angle in a clip."""
    offsets: dict[str, float] = field(default_factory=dict)
    """By joint, rad or m: added to its angle after the sign."""


@dataclass(frozen=True)
class Frame:
    """A link of the URDF that has no mass and is fixed to another, of which it is a part here."""

    name: str
    parent: str  # a link, or another frame
    joint: str  # the URDF's, between the two
    pose: Pose  # pose in the parent


@dataclass(frozen=True)
class UrdfOptions:
    """How the URDF is to be read: what the simulator needs to load the same body."""

    urdf_path: Path
    urdf_text: str = field(repr=False)
    scale: float = 1.0
    fixed_base: bool = False
    inertia_from_file: bool = False
    self_collision: bool = False
    fill_inertia: bool = False  # fills that of links with a mass but no inertia, see `repair_urdf`
    collisions: bool = True  # false: nothing of it collides, and meshes may be missing
    mimics: bool = True  # false: joints that mimic others are joints as any

    @cached_property
    def _read(self) -> ReadUrdf:
        return read_robot(self.urdf_path, self.urdf_text)

    @property
    def robot(self) -> ElementTree.Element:
        """The root of what counts in the URDF; to be copied before it is changed."""
        return self._read.robot

    @property
    def remarks(self) -> tuple[LeftOut, ...]:
        """A line for each kind of what does not count in the URDF, or counts otherwise."""
        return self._read.remarks


@dataclass(frozen=True)
class Placement:
    """Where a character's own world stands in the world: turned about z by `yaw`, then moved."""

    x: float = 0.0  # m
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0  # rad

    def moved(
        self, positions: FloatArray, orientations_xyzw: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Positions (..., 3) in m and orientations (..., 4) of the own world, in the world."""
        if self == Placement():
            return positions, orientations_xyzw  # unchanged to the last bit
        turn = rotations.about_z(self.yaw)
        return (
            rotations.rotate(turn, positions) + np.array((self.x, self.y, self.z)),
            rotations.multiply(turn, orientations_xyzw),
        )


@dataclass(frozen=True)
class Character:
    """A character: its body and its defaults. Links and joints are listed depth-first."""

    name: str
    file: Path
    file_text: str = field(repr=False)
    loading: UrdfOptions
    links: tuple[Link, ...]
    gains: dict[str, Gains]  # by joint; the base's force and torque under `root` and `root_r`
    rest_position: tuple[float, ...]  # (n,), message form
    clips: ClipFormat
    feet: tuple[str, ...] = ()  # the links that it stands on
    planning: Planning = Planning()
    warnings: tuple[str, ...] = ()  # tell of likely mistakes in its files
    placement: Placement = Placement()
    sensors: tuple[Sensor, ...] = ()
    up_axis: str = "z"
    """The axis of the base link that points up where the character stands; y or z."""
    frames: tuple[Frame, ...] = ()
    """Links of the URDF that are parts of others here; a frame that others are in comes first."""

    @cached_property
    def layout(self) -> JointLayout:
        """The order of the character's degrees of freedom."""
        return layout_of(self.links)

    @cached_property
    def coupling(self) -> Coupling:
        """The joints that follow others."""
        joints = self.moving_joints
        return Coupling(self.layout, {j.name: j.mimic for j in joints if j.mimic is not None})

    @cached_property
    def end_effectors(self) -> tuple[int, ...]:
        """Links that carry no other, as indices of `links`."""
        parents = {link.parent for link in self.links}
        return tuple(index for index in range(len(self.links)) if index not in parents)

    @property
    def leaders(self) -> dict[str, str]:
        """The leader of each joint that mimics one, by the follower's name."""
        return {j.name: j.mimic.leader for j in self.moving_joints if j.mimic is not None}

    def check_driven(self, names: Iterable[str]) -> None:
        """Raise LayoutError unless all joints named exist and none mimics another."""
        names = tuple(names)
        self.layout.mask(names)
        for name, leader in self.leaders.items():
            if name in names:
                raise LayoutError(
                    f"commanded_joints: '{name}' mimics '{leader}' and has no motor; leave it out"
                )

    def without_constraints(self) -> "Character":
        """The character without friction and coupling of its joints, which the engine solves."""
        links = [
            replace(link, joint=replace(link.joint, friction=0.0, mimic=None))
            for link in self.links
        ]
        return replace(self, links=tuple(links))

    @property
    def frame_names(self) -> set[str]:
        """The names of all links of the URDF, with those that are parts of others."""
        return {link.name for link in self.links} | {frame.name for frame in self.frames}

    def placed(self, placement: Placement) -> "Character":
        """The character as it was loaded, with its fixed base or its rest pose's root moved."""
        if placement == Placement():
            return self
        if self.layout.has_floating_base:
            rest = np.array(self.rest_position)
            origin, turn = placement.moved(rest[:3], rotations.exp(rest[3:6]))
            rest[:3], rest[3:6] = origin, rotations.log(turn)
            return replace(self, placement=placement, rest_position=tuple(rest.tolist()))
        base = self.links[0]
        pose = base.joint.pose_in_parent
        origin, turn = placement.moved(np.array(pose.position), np.array(pose.orientation_xyzw))
        joint = replace(base.joint, pose_in_parent=Pose.of_arrays(origin, turn))
        links = (replace(base, joint=joint), *self.links[1:])
        return replace(self, placement=placement, links=links)

    @property
    def mass(self) -> float:
        """Mass of all links together, kg."""
        return math.fsum(link.mass for link in self.links)

    @property
    def moving_joints(self) -> list[Joint]:
        """The joints of the layout, in its order."""
        return [link.joint for link in self.links if link.joint.type is not JointType.FIXED]

    @property
    def vector_names(self) -> list[str]:
        """Name of each physical vector of the layout: the joint's, `root_r` for root torque."""
        names = [joint.name for joint in self.moving_joints]
        return [ROOT, ROOT_TORQUE, *names[1:]] if self.layout.has_floating_base else names

    def effort_limits(self) -> FloatArray:
        """Limit (b,) of the norm of each physical vector of the layout, N m or N."""
        limits: list[float] = []
        for joint in self.moving_joints:
            limits += [joint.effort_limit] * len(self.layout.joint(joint.name).vectors)
        return np.array(limits)

    def passive_damping(self) -> FloatArray:
        """Passive damping (n,) of each entry, N m s/rad or N s/m."""
        damping = np.zeros(self.layout.size)
        for joint in self.moving_joints:
            damping[self.layout.joint(joint.name).entries] = joint.damping
        return damping

    def armature(self) -> FloatArray:
        """What motors add to each entry (n,) of the mass matrix's diagonal, kg m^2 or kg."""
        armature = np.zeros(self.layout.size)
        for joint in self.moving_joints:
            armature[self.layout.joint(joint.name).entries] = joint.armature
        return armature

    def position_bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bound (n,) of each entry; infinite where the joint has none."""
        lower, upper = np.full(self.layout.size, -np.inf), np.full(self.layout.size, np.inf)
        for joint in self.moving_joints:
            entries = self.layout.joint(joint.name).entries
            lower[entries], upper[entries] = joint.lower, joint.upper
        return lower, upper
