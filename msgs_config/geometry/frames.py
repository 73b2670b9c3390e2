"""One frame's rotation in plain numbers: on so few of them a fraction of the time of arrays.

Quaternions are xyzw; axes are rows of a rotation matrix, which turn coordinates of the child frame
into the parent frame. Sums have the order of `msgs_config.geometry.fixed_order`, so that a rotation
of `msgs_config.geometry.rotations` gives the same doubles.
"""

import math
from collections.abc import Sequence
from typing import TypeAlias

_TINY_DIVISOR = 1e-150  # keeps 0 / 0 away
_SMALL_HALF = 5e-3  # rad

Triple: TypeAlias = tuple[float, float, float]
Axes: TypeAlias = tuple[Triple, Triple, Triple]
Quaternion: TypeAlias = tuple[float, float, float, float]

NO_TURN: Axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""Axes that are the parent's: to turn by them alters nothing but the sign of zeros."""


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


def quaternion(rotation_vector: Sequence[float]) -> Quaternion:
    """The unit quaternion of a rotation vector in rad."""
    x, y, z = rotation_vector
    half = 0.5 * math.sqrt(x * x + y * y + z * z)
    share = 0.5 * math.sin(half) / max(half, _TINY_DIVISOR)
    return (x * share, y * share, z * share, math.cos(half))


def of_roll_pitch_yaw(angles: Sequence[float]) -> Quaternion:
    """The unit quaternion of URDF's angles in rad: turn about x, then fixed y, then fixed z."""
    roll, pitch, yaw = angles
    about_y_and_z = product(quaternion((0.0, 0.0, yaw)), quaternion((0.0, pitch, 0.0)))
    return product(about_y_and_z, quaternion((roll, 0.0, 0.0)))


def conjugate(q_xyzw: Sequence[float]) -> Quaternion:
    """The inverse of a unit quaternion."""
    x, y, z, w = q_xyzw
    return (-x, -y, -z, w)


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


def rotation_vector(q_xyzw: Sequence[float]) -> Triple:
    """The rotation vector in rad, of norm at most pi, of a unit quaternion."""
    x, y, z, w = q_xyzw
    sine = math.sqrt(x * x + y * y + z * z)
    if sine > _TINY_DIVISOR and w > 0.0:  # nearly always, and then with fewer calls
        share = 2.0 * math.atan2(sine, w) / sine
    else:
        share = math.copysign(2.0 * math.atan2(sine, abs(w)) / max(sine, _TINY_DIVISOR), w)
    return (x * share, y * share, z * share)


def right_jacobian_inverse(rotation_vector: Sequence[float]) -> Axes:
    """The matrix that turns an angular velocity in the child frame into a rotation vector's rate.

    `msgs_config.geometry.rotations` has the equation, and the same for arrays.
    """
    x, y, z = rotation_vector
    xx, yy, zz = x * x, y * y, z * z
    square = xx + yy + zz
    half = 0.5 * math.sqrt(square)
    if half < _SMALL_HALF:
        c = 1.0 / 12.0 + square / 720.0  # where the closed form would lose its digits
    else:
        c = (1.0 - half / math.tan(half)) / square
    hx, hy, hz = 0.5 * x, 0.5 * y, 0.5 * z
    xy, xz, yz = c * x * y, c * x * z, c * y * z
    return (
        (1.0 - c * (yy + zz), xy - hz, xz + hy),
        (xy + hz, 1.0 - c * (xx + zz), yz - hx),
        (xz - hy, yz + hx, 1.0 - c * (xx + yy)),
    )
