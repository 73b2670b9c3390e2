"""The legs of a character: a ball joint, a hinge and a ball joint, and their inverse kinematics."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character, ShapeType
from msgs_config.errors import ConfigurationError
from msgs_config.geometry import rotations
from msgs_config.geometry.scalars import (
    Quaternion,
    Vector,
    add,
    conjugate,
    cross,
    dot,
    log,
    multiply,
    norm,
    of_axes,
    rotate,
    scale,
    subtract,
)

_STRAIGHT = 1e-3  # m, at most, of knee and ankle from the vertical through the hip at angle 0
_BENT = 0.05  # rad, of the knee at least: a straight leg has no direction to bend
_MAX_KNEE_ANGLE = 2.4  # rad, of the knee at most


class LegAngles(NamedTuple):
    """Joint positions of a leg, message form."""

    hip: Vector  # rad, rotation vector
    knee: float  # rad
    ankle: Vector  # rad, rotation vector


class FootPose(NamedTuple):
    """The middle of a sole in the world, m, and how the foot is turned against standing."""

    sole: Vector
    turn: Quaternion


@dataclass(frozen=True)
class Leg:
    """A leg, in the frames of its links; `upright` turns each link to how it stands."""

    hip_entries: slice
    knee_entry: int
    ankle_entries: slice
    thigh_link: int
    foot_link: int
    foot_inertia: float  # kg m^2, the least about an axis through the ankle
    hip_in_root: Vector  # m, at rest
    thigh_length: float  # m
    shin_length: float  # m
    knee_sign: float  # 1 or -1: sign of the knee's angle where the shin goes backwards
    upright: tuple[Quaternion, Quaternion, Quaternion]  # thigh, shin, foot, in world
    fixed: tuple[Quaternion, Quaternion]  # turns of hip and ankle in their parents at angle 0
    sole_in_foot: Vector  # m, the middle of the sole, in the foot's link frame
    half_length: float  # m, of the sole
    half_width: float  # m

    @cached_property
    def entries(self) -> list[int]:
        """Those of all its joints."""
        hip, ankle = self.hip_entries, self.ankle_entries
        return [
            *range(hip.start, hip.stop),
            self.knee_entry,
            *range(ankle.start, ankle.stop),
        ]

    def hip(self, root: Vector, root_xyzw: Quaternion) -> Vector:
        """Where the hip is, m, world."""
        return add(root, rotate(root_xyzw, self.hip_in_root))

    def angles(
        self, root: Vector, root_xyzw: Quaternion, foot: FootPose, facing: Vector
    ) -> LegAngles:
        """The joint positions at which the foot has a pose; as near to it as the leg reaches.

        The knee bends in the plane of the leg that `facing`, a horizontal direction to the left,
        is normal to.
        """
        hip = self.hip(root, root_xyzw)
        foot_xyzw = multiply(foot.turn, self.upright[2])
        ankle = subtract(foot.sole, rotate(foot_xyzw, self.sole_in_foot))
        reach = subtract(ankle, hip)
        thigh, shin = self.thigh_length, self.shin_length
        distance = min(max(norm(reach), self._distance(_MAX_KNEE_ANGLE)), self._distance(_BENT))
        along = scale(1.0 / max(norm(reach), 1e-9), reach)
        left = subtract(facing, scale(dot(facing, along), along))
        left = scale(1.0 / max(norm(left), 1e-9), left)
        cosine = (distance * distance - thigh * thigh - shin * shin) / (2.0 * thigh * shin)
        flexion = math.acos(min(max(cosine, -1.0), 1.0))
        lead = math.atan2(shin * math.sin(flexion), thigh + shin * math.cos(flexion))
        thigh_xyzw = multiply(_hanging(along, left, -lead), self.upright[0])
        shin_xyzw = multiply(_hanging(along, left, flexion - lead), self.upright[1])
        hip_turn = multiply(conjugate(multiply(root_xyzw, self.fixed[0])), thigh_xyzw)
        ankle_turn = multiply(conjugate(multiply(shin_xyzw, self.fixed[1])), foot_xyzw)
        return LegAngles(log(hip_turn), self.knee_sign * flexion, log(ankle_turn))

    def _distance(self, flexion: float) -> float:
        """From hip to ankle, m, where the knee is bent by an angle."""
        a, b = self.thigh_length, self.shin_length
        return math.sqrt(a * a + b * b + 2.0 * a * b * math.cos(flexion))


def _hanging(along: Vector, left: Vector, angle: float) -> Quaternion:
    """How a part of a leg that points `along`, then turned about left, is turned from standing."""
    ahead = cross(left, along)
    cosine, sine = math.cos(angle), math.sin(angle)
    down = add(scale(cosine, along), scale(sine, ahead))
    up = scale(-1.0, down)
    return of_axes(cross(left, up), left, up)


def make_leg(character: Character, hip: str, knee: str, ankle: str) -> Leg:
    """The leg of three joints of a character.

    Raises:
        ConfigurationError: they are not a ball joint, a hinge about the sideways axis and a ball
            joint one below the other, straight at angle 0, with a box as the sole.
    """
    thigh, shin, foot = _leg_links(character, hip, knee, ankle)
    layout = character.layout
    origins, turns = standing_frames(character)
    places = [origins[row] for row in (thigh, shin, foot)]
    upright = [turns[row] for row in (thigh, shin, foot)]
    if not _hangs(places):
        raise ConfigurationError(
            f"the leg of '{hip}', '{knee}' and '{ankle}' must hang straight down at angle 0"
        )
    axis = rotate(upright[1], character.links[shin].joint.axis_in_child)
    if abs(axis[1]) < 0.999:
        raise ConfigurationError(f"joint '{knee}' of a leg must turn about the sideways axis")
    # parts between root and hip are fixed to the root
    fixed = [
        multiply(conjugate(turns[parent]), turns[row])
        for parent, row in ((0, thigh), (character.links[foot].parent, foot))
    ]
    sole, half_length, half_width = _sole(character, foot, upright[2])
    return Leg(
        hip_entries=layout.joint(hip).entries,
        knee_entry=layout.joint(knee).start,
        ankle_entries=layout.joint(ankle).entries,
        thigh_link=thigh,
        foot_link=foot,
        foot_inertia=_least_inertia(character, foot),
        hip_in_root=rotate(conjugate(turns[0]), places[0]),
        thigh_length=places[0][2] - places[1][2],
        shin_length=places[1][2] - places[2][2],
        knee_sign=math.copysign(1.0, axis[1]),
        upright=(upright[0], upright[1], upright[2]),
        fixed=(fixed[0], fixed[1]),
        sole_in_foot=sole,
        half_length=half_length,
        half_width=half_width,
    )


def _leg_links(character: Character, hip: str, knee: str, ankle: str) -> list[int]:
    """The links below three joints. Raises ConfigurationError if they are of other types."""
    links = {link.joint.name: row for row, link in enumerate(character.links)}
    wanted = {hip: JointType.SPHERICAL, knee: JointType.REVOLUTE, ankle: JointType.SPHERICAL}
    for name, kind in wanted.items():
        joint = character.links[links[name]].joint
        if joint.type is not kind:
            raise ConfigurationError(
                f"joint '{name}' is {joint.type.value}; in a leg it must be {kind.value}"
            )
    return [links[name] for name in wanted]


def _hangs(places: list[Vector]) -> bool:
    """Whether knee and ankle are straight below the hip; m, where the character stands."""
    hip, *others = places
    for other in others:
        x, y, _ = subtract(hip, other)
        if math.sqrt(x * x + y * y) > _STRAIGHT or other[2] >= hip[2]:
            return False
    return True


def standing_frames(character: Character) -> tuple[list[Vector], list[Quaternion]]:
    """Origin, m, and orientation of each link at angles 0, upright, facing along x."""
    model, layout = DynamicsModel(character), character.layout
    standing = np.zeros(layout.size)
    facing = rotations.about_z(-character.placement.yaw)
    upright = rotations.multiply(facing, rotations.exp(np.array(character.rest_position[3:6])))
    standing[3:6] = rotations.log(upright)
    model.update(standing, np.zeros(layout.size))
    origins, turns = model.link_poses()
    places: list[Vector] = [(x, y, z) for x, y, z in origins.tolist()]
    return places, [(x, y, z, w) for x, y, z, w in turns.tolist()]


def _sole(character: Character, foot: int, upright_xyzw: Quaternion) -> tuple[Vector, float, float]:
    """Middle of the sole in the link frame, m, half its length ahead and half its width, m."""
    link = character.links[foot]
    boxes = [shape for shape in link.collision_shapes or link.shapes if shape.type is ShapeType.BOX]
    if not boxes:
        raise ConfigurationError(f"the foot '{link.name}' has no box, so no sole")
    pose, half = boxes[0].pose, 0.5 * np.array(boxes[0].size)
    turn = multiply(upright_xyzw, pose.orientation_xyzw)
    edges = [
        rotate(turn, (1.0, 0.0, 0.0)),
        rotate(turn, (0.0, 1.0, 0.0)),
        rotate(turn, (0.0, 0.0, 1.0)),
    ]
    a, b, c = half.tolist()
    x, y, z = edges
    extent = [abs(x[axis]) * a + abs(y[axis]) * b + abs(z[axis]) * c for axis in range(3)]
    middle = rotate(upright_xyzw, pose.position)
    sole = rotate(conjugate(upright_xyzw), (middle[0], middle[1], middle[2] - extent[2]))
    return sole, extent[0], extent[1]


def _least_inertia(character: Character, foot: int) -> float:
    """The least inertia of a foot about the axes through its ankle, kg m^2."""
    link = character.links[foot]
    x, y, z = link.inertial_pose.position
    arm = x * x + y * y + z * z
    return min(link.inertia_diagonal) + link.mass * (arm - max(x * x, y * y, z * z))
