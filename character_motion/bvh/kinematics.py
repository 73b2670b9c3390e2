"""Where the joints of a BVH motion are: its forward kinematics, in the file's units and axes."""

from dataclasses import dataclass

import numpy as np

from character_motion.bvh.skeleton import POSITIONS, ROTATIONS, BvhMotion, Skeleton
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations


@dataclass(frozen=True)
class JointPoses:
    """Where the j joints and the e end sites of a skeleton are in f frames; file units and axes."""

    positions: FloatArray  # (f, j, 3)
    orientations_xyzw: FloatArray  # (f, j, 4), without jumps of sign from frame to frame
    end_positions: FloatArray  # (f, e, 3)


def forward_kinematics(motion: BvhMotion) -> JointPoses:
    """The poses of all joints in all frames."""
    skeleton = motion.skeleton
    translations = local_translations(motion)
    turns = local_rotations(motion)
    positions, orientations = np.empty_like(translations), np.empty_like(turns)
    for joint, parent in enumerate(skeleton.parents):
        positions[:, joint], orientations[:, joint] = translations[:, joint], turns[:, joint]
        if parent >= 0:
            turn = orientations[:, parent]
            shift = rotations.rotate(turn, translations[:, joint])
            positions[:, joint] = positions[:, parent] + shift
            orientations[:, joint] = rotations.multiply(turn, turns[:, joint])
    ends = np.empty((len(positions), len(skeleton.end_sites), 3))
    for index, site in enumerate(skeleton.end_sites):
        shift = rotations.rotate(orientations[:, site.joint], np.array(site.offset))
        ends[:, index] = positions[:, site.joint] + shift
    return JointPoses(positions, continuous(orientations), ends)


def rest_positions(skeleton: Skeleton) -> FloatArray:
    """Positions (j, 3) of the joints in the pose of zero rotations, the root at its offset."""
    positions = skeleton.offsets.copy()
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            positions[joint] += positions[parent]
    return positions


def local_translations(motion: BvhMotion) -> FloatArray:
    """Position (f, j, 3) of each joint in its parent's frame, file units.

    Position channels stand in place of the joint's offset, as most writers mean them. Of a joint
    below the root they are added to it where this keeps the length of its bone better.
    """
    skeleton = motion.skeleton
    translations = np.tile(skeleton.offsets, (len(motion.values), 1, 1))
    for joint, (start, names) in enumerate(
        zip(skeleton.channel_starts, skeleton.channels, strict=True)
    ):
        given = [name for name in names if name in POSITIONS]
        if not given:
            continue
        axes = [POSITIONS.index(name) for name in given]
        columns = [start + names.index(name) for name in given]
        offset = skeleton.offsets[joint]
        instead = translations[:, joint].copy()
        instead[:, axes] = motion.values[:, columns]
        added = translations[:, joint].copy()
        added[:, axes] += motion.values[:, columns]
        stretch = [
            np.abs(np.linalg.norm(each, axis=-1) - np.linalg.norm(offset)).mean()
            for each in (instead, added)
        ]
        is_added = joint > 0 and stretch[1] < stretch[0]
        translations[:, joint] = added if is_added else instead
    return translations


def local_rotations(motion: BvhMotion) -> FloatArray:
    """Turn (f, j, 4), xyzw, of each joint against its parent: its channels in their order."""
    skeleton = motion.skeleton
    turns = np.zeros((len(motion.values), len(skeleton.names), 4))
    turns[..., 3] = 1.0
    half = np.radians(0.5 * motion.values)
    sines, cosines = np.sin(half), np.cos(half)
    for joint, (start, names) in enumerate(
        zip(skeleton.channel_starts, skeleton.channels, strict=True)
    ):
        for column, name in enumerate(names, start=start):
            if name in ROTATIONS:
                about = np.zeros((len(half), 4))
                about[:, ROTATIONS.index(name)], about[:, 3] = sines[:, column], cosines[:, column]
                turns[:, joint] = rotations.multiply(turns[:, joint], about)
    return turns


def continuous(orientations_xyzw: FloatArray) -> FloatArray:
    """Quaternions (f, ..., 4) with the signs that make each one near to the frame's before."""
    near = (orientations_xyzw[1:] * orientations_xyzw[:-1]).sum(axis=-1) >= 0.0
    flips = np.cumprod(np.where(near, 1.0, -1.0), axis=0)
    result: FloatArray = orientations_xyzw.copy()
    result[1:] *= flips[..., np.newaxis]
    return result
