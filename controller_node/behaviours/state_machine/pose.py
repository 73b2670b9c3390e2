"""The joints' targets of a state: positions, and velocities that lead on from them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from controller_node.behaviours.state_machine import laws
from controller_node.behaviours.state_machine.body import BodyState, vector
from controller_node.behaviours.state_machine.description import STANCE, JointTarget, Machine, State
from controller_node.behaviours.state_machine.legs.leg import FootPose, Leg
from controller_node.behaviours.state_machine.situation import Situation
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout, JointType
from msgs_config.character.model import Character
from msgs_config.geometry.scalars import (
    Quaternion,
    Vector,
    about_x,
    about_y,
    about_z,
    add,
    conjugate,
    exp,
    log,
    multiply,
    rotate,
    scale,
    subtract,
    yaw,
)

_LEFT = (0.0, 1.0, 0.0)


@dataclass(frozen=True)
class _Joint:
    """A joint that a target may be of."""

    entries: slice
    is_ball: bool
    parent: int
    upright: Quaternion  # the child link's orientation where the character stands
    fixed: Quaternion  # turn of the child in its parent at angle 0
    mirror: float  # 1 or -1: sign of a hinge's angle on the other side

    def mirrored(self, value: Vector) -> Vector:
        """A rotation vector in joint axes, on the other side of the body."""
        x, y, z = rotate(self.upright, value)
        return rotate(conjugate(self.upright), (-x, y, -z))


@dataclass
class TargetPose:
    """Targets of all entries, message form."""

    position: FloatArray  # (n,)
    velocity: FloatArray  # (n,)
    acceleration: FloatArray  # (n,), of legs that go somewhere


class PoseMaker:
    """Makes the targets of each tick."""

    def __init__(
        self,
        character: Character,
        machine: Machine,
        legs: Mapping[str, Leg],
        # The orientation of each link of a character that stands and faces along x.
        upright: list[Quaternion],
        period: float,  # s
    ) -> None:
        self._layout: JointLayout = character.layout
        self._machine, self._legs, self._period = machine, legs, period
        self._rest = np.array(character.rest_position)
        self._joints = _joints(character, upright)

    def free(self, state: State, at: Situation) -> TargetPose:
        """The targets of a state's own joints; all others have those of the rest pose."""
        pose = TargetPose(
            self._rest.copy(), np.zeros(self._layout.size), np.zeros(self._layout.size)
        )
        pose.position[:6] = at.body.position[:6]
        for target in state.targets:
            joint = self._joints[self._machine.joint(target.joint, at.stance)]
            if target.likeness is not None:
                lead, rate = at.lead(at.stance if target.likeness.role == STANCE else at.swing)
                share = self._mirrored(joint, target.likeness.share, at)
                rest = self._mirrored(joint, target.value, at)
                pose.position[joint.entries] = add(rest, scale(lead, share))
                pose.velocity[joint.entries] = scale(rate, share)
            elif joint.is_ball:
                pose.position[joint.entries] = self._ball(joint, target, at)
            else:
                angle = target.value[0] * (1.0 if at.mirror > 0.0 else joint.mirror)
                pose.position[joint.entries] = angle
        return pose

    @staticmethod
    def _mirrored(joint: _Joint, value: Vector, at: Situation) -> Vector:
        """A rotation vector in joint axes, as it is for the present swing foot."""
        return value if at.mirror > 0.0 else joint.mirrored(value)

    def _ball(self, joint: _Joint, target: JointTarget, at: Situation) -> Vector:
        """The rotation vector of a ball joint's target, mirrored where the right foot swings."""
        if not target.in_world:
            return self._mirrored(joint, target.value, at)
        roll, pitch, turn = target.value
        gains, mirror = target.feedback, at.mirror
        forward = laws.feedback_angle(-pitch, at.centre[0], at.velocity[0], *gains.sagittal)
        left = laws.feedback_angle(mirror * roll, at.centre[1], at.velocity[1], *gains.coronal)
        wanted = multiply(
            about_z(at.course.heading + mirror * turn), multiply(about_y(-forward), about_x(left))
        )
        child = multiply(wanted, joint.upright)
        parent = at.body.turns[joint.parent]
        return log(multiply(conjugate(multiply(parent, joint.fixed)), child))

    def set_leg(
        self, pose: TargetPose, side: str, body: BodyState, feet: Sequence[FootPose]
    ) -> None:
        """Have a leg lead its foot through three poses, a period apart, while the root moves on."""
        leg, period = self._legs[side], self._period
        vx, vy, vz, wx, wy, wz = body.velocity[:6].tolist()
        angles = []
        for number, foot in enumerate(feet):
            time = number * period
            root = add(body.root, scale(time, (vx, vy, vz)))
            root_xyzw = multiply(body.root_xyzw, exp(scale(time, (wx, wy, wz))))
            angles.append(leg.angles(root, root_xyzw, foot, _facing(foot)))
        here, there, on = angles
        rate = 1.0 / period
        for entries, start, middle, end in (
            (leg.hip_entries, here.hip, there.hip, on.hip),
            (leg.ankle_entries, here.ankle, there.ankle, on.ankle),
        ):
            first, second = _way(start, middle), _way(middle, end)
            pose.position[entries] = start
            pose.velocity[entries] = scale(rate, first)
            pose.acceleration[entries] = scale(rate * rate, subtract(second, first))
        bend, later = there.knee - here.knee, on.knee - there.knee
        pose.position[leg.knee_entry] = here.knee
        pose.velocity[leg.knee_entry] = rate * bend
        pose.acceleration[leg.knee_entry] = rate * rate * (later - bend)

    def follow_leg(self, pose: TargetPose, side: str, body: BodyState) -> None:
        """Have a leg's targets be where it is: nothing is asked of its joints."""
        leg = self._legs[side]
        for entries in (leg.hip_entries, leg.ankle_entries):
            pose.position[entries] = body.position[entries]
            pose.velocity[entries] = body.velocity[entries]
        pose.position[leg.knee_entry] = body.position[leg.knee_entry]
        pose.velocity[leg.knee_entry] = body.velocity[leg.knee_entry]

    def between(self, start: FloatArray, end: FloatArray, share: float) -> FloatArray:
        """Positions (n,) a share of the way from one to another, rotations the shorter way."""
        layout = self._layout
        a, b = layout.configuration(start), layout.configuration(end)
        way = layout.difference(a, b)
        mixed: FloatArray = start + share * way
        for entries in layout.rotation_entries:
            x, y, z = start[entries].tolist()
            turn = exp(scale(share, vector(way[entries])))
            mixed[entries] = log(multiply(exp((x, y, z)), turn))
        return mixed


def _way(start: Vector, end: Vector) -> Vector:
    """The rotation vector, in the child's axes, from one rotation vector to another."""
    return log(multiply(conjugate(exp(start)), exp(end)))


def _facing(foot: FootPose) -> Vector:
    return rotate(about_z(yaw(foot.turn)), _LEFT)


def _joints(character: Character, upright: list[Quaternion]) -> dict[str, _Joint]:
    """The driven joints of a character by name."""
    joints = {}
    for row, link in enumerate(character.links):
        joint = link.joint
        if joint.type in (JointType.FIXED, JointType.FLOATING):
            continue
        axis = rotate(upright[row], joint.axis_in_child)
        joints[joint.name] = _Joint(
            entries=character.layout.joint(joint.name).entries,
            is_ball=joint.type is JointType.SPHERICAL,
            parent=link.parent,
            upright=upright[row],
            fixed=multiply(conjugate(upright[link.parent]), upright[row]),
            mirror=1.0 if abs(axis[1]) > abs(axis[0]) + abs(axis[2]) else -1.0,
        )
    return joints
