"""One frame's rotation in plain numbers: on so few of them a fraction of the time of arrays.

Quaternions are xyzw; axes are rows of a rotation matrix, which turn coordinates of the child frame
into the parent frame. Sums have the order of `msgs_config.geometry.fixed_order`, so that a rotation
of `msgs_config.rotations` gives the same doubles.
"""

from collections.abc import Sequence
from typing import TypeAlias

Triple: TypeAlias = tuple[float, float, float]
Axes: TypeAlias = tuple[Triple, Triple, Triple]
Quaternion: TypeAlias = tuple[float, float, float, float]


def product(a_xyzw: Sequence[float], b_xyzw: Sequence[float]) -> Quaternion:
    """Hamilton product `a b`: turn by b first, then by a."""
    ax, ay, az, aw = a_xyzw
    bx, by, bz, bw = b_xyzw
    return (
        ax * bw + ay * bz - az * by + aw * bx,
        -ax * bz + ay * bw + az * bx + aw * by,
        ax * by - ay * bx + az * bw + aw * bz,
        -ax * bx - ay * by - az * bz + aw * bw,
    )


def axes(q_xyzw: Quaternion) -> Axes:
    """The rotation matrix of a unit quaternion."""
    x, y, z, w = q_xyzw
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    xy, xz, yz, xw, yw, zw = x * y, x * z, y * z, x * w, y * w, z * w
    return (
        (xx - yy - zz + ww, xy + xy - zw - zw, xz + yw + xz + yw),
        (xy + xy + zw + zw, -xx + yy - zz + ww, -xw + yz + yz - xw),
        (xz - yw + xz - yw, xw + yz + yz + xw, -xx - yy + zz + ww),
    )


def to_parent(turn: Axes, vector: Sequence[float]) -> Triple:
    """A vector of the child frame, in the parent frame."""
    x, y, z = vector
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = turn
    return (ax * x + ay * y + az * z, bx * x + by * y + bz * z, cx * x + cy * y + cz * z)


def to_child(turn: Axes, vector: Sequence[float]) -> Triple:
    """A vector of the parent frame, in the child frame."""
    x, y, z = vector
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = turn
    return (ax * x + bx * y + cx * z, ay * x + by * y + cy * z, az * x + bz * y + cz * z)


def cross(a: Sequence[float], b: Sequence[float]) -> Triple:
    """The vector product `a x b`."""
    ax, ay, az = a
    bx, by, bz = b
    return (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
