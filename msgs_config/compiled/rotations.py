"""Rotations in compiled code: those of `msgs_config.geometry.scalars`, in the same doubles."""

from msgs_config.arrays import FloatArray
from msgs_config.compiled.decorator import compiled
from msgs_config.geometry import scalars
from msgs_config.geometry.scalars import Quaternion, Vector

axes = compiled(scalars.axes)
exp = compiled(scalars.exp)
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


@compiled
def blend_turns(start: FloatArray, end: FloatArray, share: float, blended: FloatArray) -> None:
    """Write turns xyzw (k, 4) that are a share of the shorter way from some to others (k, 4)."""
    for row in range(len(start)):
        a = (start[row, 0], start[row, 1], start[row, 2], start[row, 3])
        b = (end[row, 0], end[row, 1], end[row, 2], end[row, 3])
        x, y, z = turn_between(a, b)
        turn = product(a, exp((share * x, share * y, share * z)))
        blended[row, 0], blended[row, 1], blended[row, 2], blended[row, 3] = turn
