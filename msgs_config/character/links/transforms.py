"""Rigid transforms in plain numbers, with each sum and product in Bullet's order.

The last bits of a link's frame are in every torque and state that follows. Recordings hold those of
Bullet, which read characters before this module did, and which reads the simulated body still. So
the doubles are the same as Bullet's (`LinearMath` in its source), on every engine.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple
from xml.etree import ElementTree

from msgs_config.character.model import Pose
from msgs_config.geometry.scalars import (
    NO_TURN,
    Axes,
    Quaternion,
    Vector,
    add,
    conjugate,
    scale,
    to_child,
    to_parent,
)


class Transform(NamedTuple):
    """Where a frame is in its parent: the rows of its rotation matrix, and its origin in m."""

    axes: Axes = NO_TURN
    origin: Vector = (0.0, 0.0, 0.0)

    def pose(self) -> Pose:
        """The same with a quaternion."""
        return Pose(self.origin, quaternion(self.axes))


IDENTITY = Transform()


def transposed(axes: Axes) -> Axes:
    """The rotation matrix of the opposite turn."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = axes
    return ((ax, bx, cx), (ay, by, cy), (az, bz, cz))


def inverse(transform: Transform) -> Transform:
    """The parent's place in the frame."""
    axes, (x, y, z) = transposed(transform.axes), transform.origin
    return Transform(axes, to_parent(axes, (-x, -y, -z)))


def compose(outer: Transform, inner: Transform) -> Transform:
    """The place of a frame that is `inner` in a frame that is `outer`."""
    first, second, third = (to_child(inner.axes, row) for row in outer.axes)
    return Transform((first, second, third), add(to_parent(outer.axes, inner.origin), outer.origin))


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product `a b`."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by + ay * bw + az * bx - ax * bz,
        aw * bz + az * bw + ax * by - ay * bx,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def rotate(q: Quaternion, vector: Vector) -> Vector:
    """A vector given in the child frame, in the parent frame: `q v q^-1`."""
    x, y, z, w = q
    vx, vy, vz = vector
    turned = (
        w * vx + y * vz - z * vy,
        w * vy + z * vx - x * vz,
        w * vz + x * vy - y * vx,
        -x * vx - y * vy - z * vz,
    )
    return multiply(turned, conjugate(q))[:3]


def quaternion(axes: Axes) -> Quaternion:
    """The quaternion xyzw of a rotation matrix (Shepperd 1978)."""
    diagonal = (axes[0][0], axes[1][1], axes[2][2])
    trace = diagonal[0] + diagonal[1] + diagonal[2]
    q = [0.0, 0.0, 0.0, 0.0]
    i = 3
    if trace > 0.0:
        root = math.sqrt(trace + 1.0)
        share = 0.5 / root
        for k in range(3):
            low, high = (k + 1) % 3, (k + 2) % 3
            q[k] = (axes[high][low] - axes[low][high]) * share
    else:
        i = 0 if diagonal[0] >= diagonal[1] else 1
        i = 2 if diagonal[i] < diagonal[2] else i
        j, k = (i + 1) % 3, (i + 2) % 3
        root = math.sqrt(diagonal[i] - diagonal[j] - diagonal[k] + 1.0)
        share = 0.5 / root
        q[3] = (axes[k][j] - axes[j][k]) * share
        q[j] = (axes[j][i] + axes[i][j]) * share
        q[k] = (axes[k][i] + axes[i][k]) * share
    q[i] = root * 0.5
    return (q[0], q[1], q[2], q[3])


def axes_of(q: Quaternion) -> Axes:
    """The rotation matrix of a quaternion xyzw of any length."""
    x, y, z, w = q
    factor = 2.0 / (x * x + y * y + z * z + w * w)
    xs, ys, zs = x * factor, y * factor, z * factor
    wx, wy, wz = w * xs, w * ys, w * zs
    xx, xy, xz = x * xs, x * ys, x * zs
    yy, yz, zz = y * ys, y * zs, z * zs
    return (
        (1.0 - (yy + zz), xy - wz, xz + wy),
        (xy + wz, 1.0 - (xx + zz), yz - wx),
        (xz - wy, yz + wx, 1.0 - (xx + yy)),
    )


def axes_of_roll_pitch_yaw(angles: Sequence[float]) -> Axes:
    """The rotation matrix of URDF's angles in rad: turn about x, then fixed y, then fixed z."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(a / 2.0), math.cos(a / 2.0)) for a in angles)
    x = sr * cp * cy - cr * sp * sy
    y = cr * sp * cy + sr * cp * sy
    z = cr * cp * sy - sr * sp * cy
    w = cr * cp * cy + sr * sp * sy
    share = 1.0 / math.sqrt(x * x + y * y + z * z + w * w)
    return axes_of((x * share, y * share, z * share, w * share))


def read_transform(element: ElementTree.Element | None, lengths: float) -> Transform:
    """Where an element's `<origin>` puts it, all lengths multiplied; without one nowhere else."""
    origin = None if element is None else element.find("origin")
    if origin is None:
        return IDENTITY
    x, y, z = map(float, origin.get("xyz", "0 0 0").split())
    angles = origin.get("rpy")
    axes = NO_TURN if angles is None else axes_of_roll_pitch_yaw([*map(float, angles.split())])
    return Transform(axes, scale(lengths, (x, y, z)))
