"""One vector or rotation at a time, in plain numbers: a fraction of the time of arrays.

Quaternions are xyzw, and turn coordinates of the child frame into the parent frame; so do axes,
which are the rows of a rotation matrix. Sums have the order of `msgs_config.geometry.fixed_order`,
so that functions of `msgs_config.geometry.rotations` with the same names give the same doubles, but
for `rotate` and `right_jacobian_inverse`, which are written otherwise.
"""

import math
from collections.abc import Sequence
from typing import TypeAlias

_TINY_DIVISOR = 1e-150  # keeps 0 / 0 away
_SMALL_HALF = 5e-3  # rad

Vector: TypeAlias = tuple[float, float, float]
Axes: TypeAlias = tuple[Vector, Vector, Vector]
Quaternion: TypeAlias = tuple[float, float, float, float]

IDENTITY: Quaternion = (0.0, 0.0, 0.0, 1.0)
"""The quaternion of no turn."""
NO_TURN: Axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""Axes that are the parent's: to turn by them alters nothing but the sign of zeros."""


def add(a: Vector, b: Vector) -> Vector:
    """The sum of two vectors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Vector, b: Vector) -> Vector:
    """The difference `a - b`."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(factor: float, a: Vector) -> Vector:
    """A vector times a factor."""
    return (factor * a[0], factor * a[1], factor * a[2])


def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def norm(a: Vector) -> float:
    """Euclidean length."""
    return math.sqrt(dot(a, a))


def multiply(a_xyzw: Sequence[float], b_xyzw: Sequence[float]) -> Quaternion:
    """Hamilton product `a b`: turn by b first, then by a."""
    ax, ay, az, aw = a_xyzw
    bx, by, bz, bw = b_xyzw
    return (
        ax * bw + ay * bz - az * by + aw * bx,
        -ax * bz + ay * bw + az * bx + aw * by,
        ax * by - ay * bx + az * bw + aw * bz,
        -ax * bx - ay * by - az * bz + aw * bw,
    )


def exp(rotation_vector: Sequence[float]) -> Quaternion:
    """The unit quaternion of a rotation vector in rad."""
    x, y, z = rotation_vector
    half = 0.5 * math.sqrt(x * x + y * y + z * z)
    share = 0.5 * math.sin(half) / max(half, _TINY_DIVISOR)
    return (x * share, y * share, z * share, math.cos(half))


def of_roll_pitch_yaw(angles: Sequence[float]) -> Quaternion:
    """The unit quaternion of URDF's angles in rad: turn about x, then fixed y, then fixed z."""
    roll, pitch, yaw = angles
    about_y_and_z = multiply(exp((0.0, 0.0, yaw)), exp((0.0, pitch, 0.0)))
    return multiply(about_y_and_z, exp((roll, 0.0, 0.0)))


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


def to_parent(turn: Axes, vector: Sequence[float]) -> Vector:
    """A vector of the child frame, in the parent frame."""
    x, y, z = vector
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = turn
    return (ax * x + ay * y + az * z, bx * x + by * y + bz * z, cx * x + cy * y + cz * z)


def to_child(turn: Axes, vector: Sequence[float]) -> Vector:
    """A vector of the parent frame, in the child frame."""
    x, y, z = vector
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = turn
    return (ax * x + bx * y + cx * z, ay * x + by * y + cy * z, az * x + bz * y + cz * z)


def cross(a: Sequence[float], b: Sequence[float]) -> Vector:
    """The vector product `a x b`."""
    ax, ay, az = a
    bx, by, bz = b
    return (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


def log(q_xyzw: Sequence[float]) -> Vector:
    """The rotation vector in rad, of norm at most pi, of a unit quaternion."""
    x, y, z, w = q_xyzw
    sine = math.sqrt(x * x + y * y + z * z)
    if sine > _TINY_DIVISOR and w > 0.0:  # the usual case, in fewer calls
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
        c = 1.0 / 12.0 + square / 720.0  # here the closed form would lose its digits
    else:
        c = (1.0 - half / math.tan(half)) / square
    hx, hy, hz = 0.5 * x, 0.5 * y, 0.5 * z
    xy, xz, yz = c * x * y, c * x * z, c * y * z
    return (
        (1.0 - c * (yy + zz), xy - hz, xz + hy),
        (xy + hz, 1.0 - c * (xx + zz), yz - hx),
        (xz - hy, yz + hx, 1.0 - c * (xx + yy)),
    )


def rotate(q: Quaternion, v: Vector) -> Vector:
    """A vector given in the child frame, in the parent frame: `v + 2 w (u x v) + 2 u x (u x v)`."""
    u = (q[0], q[1], q[2])
    once = cross(u, v)
    twice = cross(u, once)
    w = q[3]
    return (
        v[0] + 2.0 * (w * once[0] + twice[0]),
        v[1] + 2.0 * (w * once[1] + twice[1]),
        v[2] + 2.0 * (w * once[2] + twice[2]),
    )


def about_x(angle: float) -> Quaternion:
    """A turn about x by an angle in rad."""
    return (math.sin(0.5 * angle), 0.0, 0.0, math.cos(0.5 * angle))


def about_y(angle: float) -> Quaternion:
    """A turn about y by an angle in rad."""
    return (0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle))


def about_z(angle: float) -> Quaternion:
    """A turn about z by an angle in rad."""
    return (0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle))


def yaw(q: Quaternion) -> float:
    """Angle in rad, -pi to pi, about the parent's z: the twist of swing and twist."""
    return 2.0 * math.atan2(q[2] * math.copysign(1.0, q[3]), abs(q[3]))


def of_axes(x: Vector, y: Vector, z: Vector) -> Quaternion:
    """The quaternion of a frame whose axes, orthonormal, are given in the parent frame.

    Source: Shepperd 1978: the largest of the four components is found first.
    """
    trace = x[0] + y[1] + z[2]
    squares = (x[0], y[1], z[2], trace)
    largest = squares.index(max(squares))
    if largest == 3:
        q = (y[2] - z[1], z[0] - x[2], x[1] - y[0], 1.0 + trace)
    elif largest == 0:
        q = (1.0 + 2.0 * x[0] - trace, x[1] + y[0], z[0] + x[2], y[2] - z[1])
    elif largest == 1:
        q = (x[1] + y[0], 1.0 + 2.0 * y[1] - trace, y[2] + z[1], z[0] - x[2])
    else:
        q = (z[0] + x[2], y[2] + z[1], 1.0 + 2.0 * z[2] - trace, x[1] - y[0])
    length = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (q[0] / length, q[1] / length, q[2] / length, q[3] / length)
