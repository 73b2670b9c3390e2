"""Where links and what is on them are, whose frames are a URDF's.

MuJoCo has a joint anywhere in its body, turned by nothing of its own; of several the first moves
all others (`mj_kinematics`): `T = T_body A_1 R_1 A_1^-1 A_2 R_2 A_2^-1 ...`, with the moves A_i to
the anchors. In a URDF a link begins at its joint. So a body's link lies at its last joint's anchor,
with the body's axes, and before it there is a link without mass at each other joint's. A position
`q` counts from the joint's `ref`, whose move back is in the place of the joint.
"""

import mujoco
import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.mjcf.robot import own_joints
from msgs_config.geometry import rotations

_SLIDER, _HINGE = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)


def turn_of(quaternion_wxyz: FloatArray) -> FloatArray:
    """The turn xyzw (4,) of one of MuJoCo's quaternions."""
    return rotations.xyzw_from_wxyz(np.array(quaternion_wxyz, dtype=float))


def anchor(model: mujoco.MjModel, body: int) -> FloatArray:
    """Where the link of a body begins (3,), m, in the body; nowhere else without a joint."""
    joints = own_joints(model, body)
    return np.array(model.jnt_pos[joints[-1]]) if joints else np.zeros(3)


def link_places(model: mujoco.MjModel, body: int) -> list[tuple[FloatArray, FloatArray]]:
    """The places of a body's links, each in the one before, the first in the parent's link.

    Position (3,) in m and axes (3, 3); as many as the body has joints, or one.
    """
    turn = turn_of(model.body_quat[body])
    origin = np.array(model.body_pos[body]) - anchor(model, int(model.body_parentid[body]))
    before = np.zeros(3)
    places = []
    for joint in own_joints(model, body):
        position, axes = origin + rotations.rotate(turn, model.jnt_pos[joint] - before), turn
        position, axes = _before_ref(model, joint, position, axes)
        places.append((position, rotations.matrix(axes)))
        turn, origin = np.array(rotations.IDENTITY_XYZW), np.zeros(3)
        before = np.array(model.jnt_pos[joint])
    return places or [(origin, rotations.matrix(turn))]


def _before_ref(
    model: mujoco.MjModel, joint: int, position: FloatArray, turn: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The place of a joint where its position is 0, from that where it is at its reference."""
    if model.jnt_type[joint] not in (_SLIDER, _HINGE):
        return position, turn
    back = -model.qpos0[model.jnt_qposadr[joint]] * np.array(model.jnt_axis[joint])
    if not back.any():
        return position, turn
    if model.jnt_type[joint] == _SLIDER:
        return position + rotations.rotate(turn, back), turn
    return position, rotations.multiply(turn, rotations.exp(back))
