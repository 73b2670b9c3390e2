"""The legs of a character: where their feet are in a pose, and poses whose feet are elsewhere."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import SCALAR, GeneralizedPosition, JointType
from msgs_config.character.model import Character
from msgs_config.compiled import limb
from msgs_config.compiled.limb import Limb
from msgs_config.geometry import rotations

_KINDS = {
    JointType.FIXED: limb.FIXED,
    JointType.REVOLUTE: limb.HINGE,
    JointType.PRISMATIC: limb.SLIDER,
    JointType.SPHERICAL: limb.BALL,
}
_DIRECTIONS = 6  # degrees of freedom from which on a foot's orientation can be kept, too


@dataclass(frozen=True)
class _Leg:
    """A leg, and where its joints stand in a pose."""

    limb: Limb
    numbers: tuple[tuple[int, int], ...]  # rows of its joints, and entries of the position
    turns: tuple[tuple[int, int], ...]  # likewise of balls, and rows of the orientations

    def joints(self, pose: GeneralizedPosition) -> FloatArray:
        """Its joints (m, 4) as `limb` takes them."""
        joints = np.zeros((len(self.limb.kinds), 4))
        for row, entry in self.numbers:
            joints[row, 0] = pose.position[entry]
        for row, entry in self.turns:
            joints[row] = pose.orientations_xyzw[entry]
        return joints


class Legs:
    """The legs of a character with a floating base, in the order of its `feet`."""

    def __init__(self, character: Character) -> None:
        self._legs = [_leg(character, name) for name in character.feet]

    def feet(self, pose: GeneralizedPosition) -> GeneralizedPosition:
        """The feet's places (3f,) in m and orientations (f, 4) in the world, in a pose."""
        place, turn = pose.position[:3], pose.orientations_xyzw[0]
        places, turns = np.zeros((len(self._legs), 3)), np.zeros((len(self._legs), 4))
        for row, leg in enumerate(self._legs):
            frames = np.empty((len(leg.limb.kinds), 7))
            limb.find_frames(leg.limb, leg.joints(pose), frames)
            places[row] = place + rotations.rotate(turn, frames[-1, :3])
            turns[row] = rotations.multiply(turn, frames[-1, 3:])
        return GeneralizedPosition(places.ravel(), turns)

    def reach(self, pose: GeneralizedPosition, feet: GeneralizedPosition) -> None:
        """Move the legs of a pose so that its feet are there; only its `orientations_xyzw` count.

        The arrays of the pose are written to; its rotation vectors stay as they are.
        """
        place, back = pose.position[:3], rotations.conjugate(pose.orientations_xyzw[0])
        places = rotations.rotate(back, feet.position.reshape(-1, 3) - place)
        turns = rotations.multiply(back, feet.orientations_xyzw)
        for leg, end in zip(self._legs, np.concatenate((places, turns), axis=1), strict=True):
            joints = leg.joints(pose)
            limb.reach(leg.limb, joints, end)
            for row, entry in leg.numbers:
                pose.position[entry] = joints[row, 0]
            for row, entry in leg.turns:
                pose.orientations_xyzw[entry] = joints[row]


def _leg(character: Character, foot: str) -> _Leg:
    links, names = character.links, [link.name for link in character.links]
    index, chain = names.index(foot), list[int]()
    while links[index].parent >= 0:
        chain.insert(0, index)
        index = links[index].parent
    layout, joints = character.layout, [links[each].joint for each in chain]
    turning = [joint.name for joint in layout.joints if joint.rotation is not None]
    freedom = sum(len(joint.type.suffixes) for joint in joints)
    poses = [joint.pose_in_parent for joint in joints]
    return _Leg(
        Limb(
            np.array([_KINDS[joint.type] for joint in joints], dtype=np.intp),
            _array([pose.position for pose in poses]),
            _array([pose.orientation_xyzw for pose in poses]),
            _array([joint.axis_in_child for joint in joints]),
            _array([joint.lower for joint in joints]),
            _array([joint.upper for joint in joints]),
            _DIRECTIONS if freedom >= _DIRECTIONS else 3,
        ),
        tuple(
            (row, layout.joint(joint.name).start)
            for row, joint in enumerate(joints)
            if joint.type in SCALAR
        ),
        tuple(
            (row, turning.index(joint.name))
            for row, joint in enumerate(joints)
            if joint.type is JointType.SPHERICAL
        ),
    )


def _array(rows: Sequence[object]) -> FloatArray:
    return np.array(rows, dtype=float)
