"""What of a state is compared with the reference, in compiled code."""

from typing import NamedTuple

import numpy as np

from controller_node.planner.compiled.decorator import compiled
from controller_node.planner.compiled.law import Joints
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.compiled import mass_matrix
from msgs_config.compiled.mass_matrix import Tree
from msgs_config.compiled.rotations import axes, quaternion, to_parent, turn_between

STEP_TIME = 0.2  # s: feet go ahead of a pushed centre of mass by this times its velocity


class FeatureLayout(NamedTuple):
    """Where the parts of features are, and those of a frame of `write_frame`."""

    joints: int  # entries of the actuated joints, n - 6
    ends: int  # end effectors

    @property
    def sizes(self) -> tuple[int, ...]:
        """Entries of each part, in the order of `write_features`."""
        return 3, self.joints, 3, self.joints, 3, 3, 3, 3 * self.ends

    @property
    def centre(self) -> int:
        """Where the centre of mass begins."""
        return 6 + 2 * self.joints

    @property
    def first_end(self) -> int:
        """Where the end effectors begin."""
        return self.centre + 9

    @property
    def size(self) -> int:
        """Length f of a row of features."""
        return self.first_end + 3 * self.ends

    @property
    def frame_sizes(self) -> tuple[int, ...]:
        """Entries of each part of a frame, in the order of `write_frame`."""
        return 3, 3, 3, 3, 3 * self.ends, self.joints

    @property
    def frame_size(self) -> int:
        """Length d of a frame."""
        return 12 + 3 * self.ends + self.joints


class Watched(NamedTuple):
    """What the features are made of."""

    end_effectors: IntArray  # (k,) MuJoCo's numbers of these bodies
    mass: float  # kg


@compiled
def write_features(
    row: FloatArray,
    target: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    mass: FloatArray,
    points: FloatArray,
    centre: FloatArray,
    tree: Tree,
    joints: Joints,
    watched: Watched,
) -> None:
    """Write the features (f,) of a state against the rotations of a target position.

    In this order: rotation of the root (3,) and of the joints (n - 6,) from the target's, its
    frames, rad or m; velocity of the root's rotation (3,) and of the joints (n - 6,); centre of
    mass (3,) m and its velocity (3,) m/s; angular momentum about it (3,) N m s; places of the end
    effectors (3 k,) m; all in world axes but the joints' and the root's own.

    Args:
        row: The result (f,).
        target: Position that MuJoCo has of the reference.
        position: Position of the state.
        velocity: Of the state (n,).
        mass: Entries (e,) of the mass matrix in the state.
        points: Origins (bodies, 3) of the links, m.
        centre: Centre of mass (3,), m.
        tree: Where the mass matrix's entries are.
        joints: Where the joints are.
        watched: What else there is to look at.
    """
    last, root = 2 * len(velocity) - 6, quaternion(position, 3)
    turn = turn_between(quaternion(target, 3), root)
    row[0], row[1], row[2] = turn
    _write_joints(row, target, position, joints)
    row[last // 2 : last] = velocity[3:]
    _write_momentum(row[last:], position, velocity, mass, centre, root, tree, watched.mass)
    for k in range(len(watched.end_effectors)):
        for i in range(3):
            row[last + 9 + 3 * k + i] = points[watched.end_effectors[k], i]


@compiled
def _write_momentum(
    row: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    mass: FloatArray,
    centre: FloatArray,
    root: tuple[float, float, float, float],
    tree: Tree,
    whole: float,
) -> None:
    """Write centre of mass, its velocity and the angular momentum about it, three entries each."""
    momentum = np.empty(6)
    mass_matrix.base_momentum(mass, tree, velocity, momentum)
    spin = to_parent(axes(root), (momentum[3], momentum[4], momentum[5]))
    x, y, z = centre[0] - position[0], centre[1] - position[1], centre[2] - position[2]
    for i in range(3):
        row[i] = centre[i]
        row[3 + i] = momentum[i] / whole
    row[6] = spin[0] - (y * momentum[2] - z * momentum[1])
    row[7] = spin[1] - (z * momentum[0] - x * momentum[2])
    row[8] = spin[2] - (x * momentum[1] - y * momentum[0])


@compiled
def _write_joints(
    row: FloatArray, target: FloatArray, position: FloatArray, joints: Joints
) -> None:
    """Write the joints' rotations and displacements from the target's after the root's rotation."""
    for k in range(len(joints.ball_positions)):
        start = joints.ball_positions[k]
        turn = turn_between(quaternion(target, start), quaternion(position, start))
        for i in range(3):
            row[joints.ball_velocities[k] - 3 + i] = turn[i]
    for k in range(len(joints.scalar_positions)):
        entry = joints.scalar_positions[k]
        row[joints.scalar_velocities[k] - 3] = position[entry] - target[entry]
