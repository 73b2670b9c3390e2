"""Rotations in compiled code: those of `msgs_config.geometry.scalars`, in the same doubles."""

from msgs_config.arrays import FloatArray
from msgs_config.compiled.decorator import compiled
from msgs_config.geometry import scalars
from msgs_config.geometry.scalars import Quaternion, Vector

axes = compiled(scalars.axes)
product = compiled(scalars.multiply)
right_jacobian_inverse = compiled(scalars.right_jacobian_inverse)
rotation_vector = compiled(scalars.log)
to_parent = compiled(scalars.to_parent)
yaw_of = compiled(scalars.yaw)


@compiled
def quaternion(position: FloatArray, start: int) -> Quaternion:
    """The quaternion xyzw that stands in MuJoCo's position, as wxyz, from an entry on."""
    return position[start + 1], position[start + 2], position[start + 3], position[start]


@compiled
def turn_between(start_xyzw: Quaternion, end_xyzw: Quaternion) -> Vector:
    """The rotation vector in rad of `start^-1 end`, in the frame of `start`."""
    x, y, z, w = start_xyzw
    return rotation_vector(product((-x, -y, -z, w), end_xyzw))
