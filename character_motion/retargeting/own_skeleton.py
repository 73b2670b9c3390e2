"""BVH files of a character's own skeleton, such as `export` writes: taken as they are."""

import numpy as np

from character_motion.bvh.kinematics import forward_kinematics
from character_motion.bvh.skeleton import BvhMotion
from character_motion.export.bvh_motion import to_bvh
from character_motion.export.trajectories import LinkPoses
from character_motion.export.upright import UPRIGHT_XYZW
from character_motion.retargeting.optimisation.joint_angles import joint_angles
from character_motion.retargeting.target_body import TargetBody
from msgs_config.character.layout import GeneralizedPosition, JointType
from msgs_config.geometry import rotations

_MAX_OFFSET_ERROR = 1e-4  # m, of offsets in the character's size


def own_motion(motion: BvhMotion, target: TargetBody) -> GeneralizedPosition | None:
    """The motion (f, n) that a file of the character's own skeleton has; None of another one.

    The file is y up and forward is z, in any unit of length.
    """
    character, skeleton = target.character, motion.skeleton
    at_rest = LinkPoses(target.origins[np.newaxis], target.turns_xyzw[np.newaxis])
    own = to_bvh(character, at_rest, 1.0).skeleton
    types = {joint.type for joint in character.moving_joints}
    if skeleton.names != own.names or skeleton.parents != own.parents:
        return None
    lengths = np.linalg.norm(own.offsets[1:], axis=1).sum()
    scale = np.linalg.norm(skeleton.offsets[1:], axis=1).sum() / max(lengths, 1e-9)
    apart = np.abs(skeleton.offsets[1:] / max(scale, 1e-9) - own.offsets[1:])
    if not scale > 0.0 or float(apart.max()) > _MAX_OFFSET_ERROR or JointType.PRISMATIC in types:
        return None
    poses = forward_kinematics(motion)
    down = rotations.conjugate(UPRIGHT_XYZW)
    turns = rotations.multiply(rotations.multiply(down, poses.orientations_xyzw), UPRIGHT_XYZW)
    rows = [
        row
        for row, link in enumerate(character.links)
        if row == 0 or link.joint.type is not JointType.FIXED
    ]
    by_link = {
        row: rotations.multiply(turns[:, joint], target.turns_xyzw[row])
        for joint, row in enumerate(rows)
    }
    places = rotations.rotate(down, poses.positions[:, 0] / scale)
    return joint_angles(character, (places, by_link[0]), by_link)
