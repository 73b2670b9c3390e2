"""A character as inverse kinematics takes it: its links, its limits, and what moves readily."""

from collections.abc import Sequence

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.compiled import kinematics

LEVER_M = 0.2
"""m: a rad counts as so much."""

_LEAST_COUNT, _CARRIED_COUNT = 0.3, 30.0  # what a rad counts that moves no mass, and more for all
_KINDS = {
    JointType.FIXED: kinematics.FIXED,
    JointType.REVOLUTE: kinematics.HINGE,
    JointType.PRISMATIC: kinematics.SLIDER,
    JointType.SPHERICAL: kinematics.BALL,
    JointType.FLOATING: kinematics.FLOATING,
}


def rows_of(rows: Sequence[object], width: int) -> FloatArray:
    """Rows as an array (r, width), also where there are none."""
    return np.array(rows, dtype=float).reshape(-1, width)


def body_of(character: Character) -> kinematics.Body:
    """The links and joints of a character, in their order."""
    joints, layout = [link.joint for link in character.links], character.layout
    moves = [joint.type is not JointType.FIXED for joint in joints]
    coupling, poses = character.coupling, [joint.pose_in_parent for joint in joints]
    return kinematics.Body(
        np.array([link.parent for link in character.links], dtype=np.intp),
        np.array([_KINDS[joint.type] for joint in joints], dtype=np.intp),
        np.array(
            [
                layout.joint(joint.name).start if moving else 0
                for joint, moving in zip(joints, moves, strict=True)
            ],
            dtype=np.intp,
        ),
        rows_of([pose.position for pose in poses], 3),
        rows_of([pose.orientation_xyzw for pose in poses], 4),
        rows_of([joint.axis_in_child for joint in joints], 3),
        coupling.followers,
        coupling.leaders,
        coupling.multipliers,
        coupling.offsets,
    )


def bounds_of(character: Character) -> tuple[FloatArray, FloatArray]:
    """Lower and upper bound (n,) of each entry, of ball joints those of their soft limits."""
    lower, upper = character.coupling.leader_bounds(*character.position_bounds())
    for joint in character.moving_joints:
        if joint.soft_limit is not None:
            entries = character.layout.joint(joint.name).entries
            lower[entries], upper[entries] = joint.soft_limit.lower, joint.soft_limit.upper
    return lower, upper


def units_of(character: Character) -> FloatArray:
    """What the square of a rad of each entry counts (n,): 1, and that of a m more."""
    units = np.ones(character.layout.size)
    for joint in character.layout.joints:
        if joint.type is JointType.PRISMATIC:
            units[joint.entries] = 1.0 / (LEVER_M * LEVER_M)
        elif joint.type is JointType.FLOATING:
            units[joint.vectors[0]] = 1.0 / (LEVER_M * LEVER_M)
    return units


def loads_of(character: Character) -> FloatArray:
    """How much less readily each entry (n,) moves than one that carries nothing.

    It grows with the square of the share of the mass that moves along, so that an arm reaches
    before the trunk bends. Joints weighted by loads: Whitney 1972, "The mathematics of coordinated
    control of prosthetic arms and manipulators".
    """
    loads = np.ones(character.layout.size)
    for link, share in zip(character.links, _carried_shares(character), strict=True):
        if link.joint.type is not JointType.FIXED:
            entries = character.layout.joint(link.joint.name).entries
            loads[entries] = _LEAST_COUNT + _CARRIED_COUNT * share * share
    return loads


def _carried_shares(character: Character) -> list[float]:
    """The share of the whole mass that each link has with those that it carries."""
    carried = [link.mass for link in character.links]
    for row in range(len(carried) - 1, 0, -1):  # each link comes after its parent
        parent = character.links[row].parent
        if parent >= 0:
            carried[parent] += carried[row]
    whole = character.mass
    return [mass / whole if whole > 0.0 else 0.0 for mass in carried]
