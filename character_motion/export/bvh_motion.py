"""The motion of a character as BVH: y up, forward is z, and a joint for each that moves."""

import numpy as np

from character_motion.bvh.euler_angles import euler_angles
from character_motion.bvh.skeleton import POSITIONS, BvhMotion, EndSite, Skeleton
from character_motion.export.trajectories import LinkPoses
from character_motion.export.upright import UPRIGHT_XYZW
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import still_model
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.geometry import rotations

_SHORTEST_BONE = 1e-3  # m
_STUB = np.array([0.0, 0.1, 0.0])  # m: the end of a chain of which nothing says where it is


def to_bvh(
    character: Character, poses: LinkPoses, rate: float, order: str = "ZXY", scale: float = 1.0
) -> BvhMotion:
    """The poses of a character's links as BVH.

    Where all angles are zero, the base is upright and the joints are at zero. The root has
    positions and rotations, a joint that turns has rotations, and one that slides has positions,
    too, which stand in place of its offset. A chain ends at the farthest link that is fixed to its
    last joint, or else at the centre of mass of that joint's link.

    Args:
        character: The one whose links these are.
        poses: In f frames.
        rate: Frames a second, Hz.
        order: Of the rotations, such as `"ZXY"`.
        scale: Units of length of the file that make a metre.
    """
    joints = _Joints(character)
    skeleton = joints.skeleton(order, scale)
    places, turns = joints.in_parents(poses)
    angles = np.degrees(euler_angles(turns, order))
    columns = [
        part[:, joint]
        for joint, channels in enumerate(skeleton.channels)
        for part in ((scale * places, angles) if POSITIONS[0] in channels else (angles,))
    ]
    return BvhMotion(skeleton, 1.0 / rate, np.concatenate(columns, axis=1))


class _Joints:
    """The j joints of a character that BVH has: the base, and those that move."""

    def __init__(self, character: Character) -> None:
        self._character, links = character, character.links
        joint_of: list[int] = []  # the joint that each link hangs on
        self._links: list[int] = []  # the row of each joint's link
        self._parents: list[int] = []
        for row, link in enumerate(links):
            if row == 0 or link.joint.type is not JointType.FIXED:
                self._parents.append(joint_of[link.parent] if row else -1)
                joint_of.append(len(self._links))
                self._links.append(row)
            else:
                joint_of.append(joint_of[link.parent])
        self._joint_of = np.array(joint_of)
        rest = np.zeros(character.layout.size)
        if character.layout.has_floating_base:
            rest[:6] = character.rest_position[:6]
        origins, self._rest_turns = still_model(character, rest).link_poses()
        self._rest_origins = rotations.rotate(UPRIGHT_XYZW, origins)

    def skeleton(self, order: str, scale: float) -> Skeleton:
        """The joints at rest, with rotations in an order; so many units of length in a metre."""
        character, at_rest = self._character, self._rest_origins[self._links]
        offsets = np.concatenate((np.zeros((1, 3)), at_rest[1:] - at_rest[self._parents[1:]]))
        joints = [character.links[row].joint for row in self._links]
        turning = tuple(f"{axis}rotation" for axis in order)
        channels = tuple(
            (*POSITIONS, *turning) if joint is joints[0] or joint.type is JointType.PRISMATIC
            else turning
            for joint in joints
        )  # fmt: skip
        ends = []
        for joint in sorted({*range(len(joints))} - {*self._parents}):
            x, y, z = (scale * self._end(joint, offsets[joint])).tolist()
            ends.append(EndSite(joint, (x, y, z)))
        names = tuple("_".join(joint.name.split()) for joint in joints)
        return Skeleton(names, tuple(self._parents), scale * offsets, channels, tuple(ends))

    def in_parents(self, poses: LinkPoses) -> tuple[FloatArray, FloatArray]:
        """Where each joint is (f, j, 3), m, and how it has turned since rest (f, j, 4).

        In the frame of its parent; the root's in the file's world.
        """
        at_rest, upright = self._rest_turns[self._links], UPRIGHT_XYZW
        turns = rotations.multiply(poses.turns_xyzw[:, self._links], rotations.conjugate(at_rest))
        turns = rotations.multiply(rotations.multiply(upright, turns), rotations.conjugate(upright))
        places = rotations.rotate(upright, poses.origins[:, self._links])
        back = rotations.conjugate(turns[:, self._parents[1:]])
        places[:, 1:] = rotations.rotate(back, places[:, 1:] - places[:, self._parents[1:]])
        turns[:, 1:] = rotations.multiply(back, turns[:, 1:])
        return places, rotations.normalised(turns)

    def _end(self, joint: int, offset: FloatArray) -> FloatArray:
        """The end (3,) of a chain in the frame of its last joint, m, axes of the file."""
        row = self._links[joint]
        fixed = self._rest_origins[self._joint_of == joint] - self._rest_origins[row]
        farthest = fixed[np.argmax(np.linalg.norm(fixed, axis=1))]
        inertial = np.array(self._character.links[row].inertial_pose.position)
        turn = rotations.multiply(UPRIGHT_XYZW, self._rest_turns[row])
        for end in (farthest, rotations.rotate(turn, inertial), 0.5 * offset):
            if np.linalg.norm(end) > _SHORTEST_BONE:
                return end
        return _STUB
