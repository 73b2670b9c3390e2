"""Rotations in compiled code: those of `msgs_config.geometry.frames`, in the same doubles."""

from controller_node.planner.compiled.decorator import compiled
from msgs_config.arrays import FloatArray
from msgs_config.geometry import frames
from msgs_config.geometry.frames import Quaternion, Triple

axes = compiled(frames.axes)
product = compiled(frames.product)
right_jacobian_inverse = compiled(frames.right_jacobian_inverse)
rotation_vector = compiled(frames.rotation_vector)
to_parent = compiled(frames.to_parent)


@compiled
def quaternion(position: FloatArray, start: int) -> Quaternion:
    """The quaternion xyzw that stands in MuJoCo's position, as wxyz, from an entry on."""
    return position[start + 1], position[start + 2], position[start + 3], position[start]


@compiled
def turn_between(start_xyzw: Quaternion, end_xyzw: Quaternion) -> Triple:
    """The rotation vector in rad of `start^-1 end`, in the frame of `start`."""
    x, y, z, w = start_xyzw
    return rotation_vector(product((-x, -y, -z, w), end_xyzw))
