"""One rotation at a time, as tuples of floats: the algebra of `rotations` in a tenth of its time.

A quaternion (x, y, z, w) turns coordinates of the child frame into the parent frame. The functions
take `+ - * /`, `sqrt` and the C library's elementary functions alone, in a fixed order.
"""

import math
from typing import TypeAlias

Vector: TypeAlias = tuple[float, float, float]
QuaternionXyzw: TypeAlias = tuple[float, float, float, float]

IDENTITY: QuaternionXyzw = (0.0, 0.0, 0.0, 1.0)
_TINY_DIVISOR = 1e-150  # keeps 0 / 0 away


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


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product `a x b`."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def norm(a: Vector) -> float:
    """Euclidean length."""
    return math.sqrt(dot(a, a))


def multiply(a: QuaternionXyzw, b: QuaternionXyzw) -> QuaternionXyzw:
    """Hamilton product `a b`: turn by b first, then by a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def conjugate(q: QuaternionXyzw) -> QuaternionXyzw:
    """The inverse of a unit quaternion."""
    return (-q[0], -q[1], -q[2], q[3])


def rotate(q: QuaternionXyzw, v: Vector) -> Vector:
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


def exp(rotation_vector: Vector) -> QuaternionXyzw:
    """The unit quaternion of a rotation vector in rad."""
    half = 0.5 * norm(rotation_vector)
    share = 0.5 * math.sin(half) / max(half, _TINY_DIVISOR) if half > 0.0 else 0.5
    x, y, z = scale(share, rotation_vector)
    return (x, y, z, math.cos(half))


def log(q: QuaternionXyzw) -> Vector:
    """The rotation vector in rad, of norm at most pi, of a unit quaternion."""
    axis = (q[0], q[1], q[2])
    sine = norm(axis)
    if sine == 0.0:
        return (0.0, 0.0, 0.0)
    angle = 2.0 * math.atan2(sine, abs(q[3]))
    return scale(math.copysign(angle / sine, q[3]), axis)


def about_x(angle: float) -> QuaternionXyzw:
    """A turn about x by an angle in rad."""
    return (math.sin(0.5 * angle), 0.0, 0.0, math.cos(0.5 * angle))


def about_y(angle: float) -> QuaternionXyzw:
    """A turn about y by an angle in rad."""
    return (0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle))


def about_z(angle: float) -> QuaternionXyzw:
    """A turn about z by an angle in rad."""
    return (0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle))


def yaw(q: QuaternionXyzw) -> float:
    """Angle in rad, -pi to pi, about the parent's z: the twist of swing and twist."""
    return 2.0 * math.atan2(q[2] * math.copysign(1.0, q[3]), abs(q[3]))


def of_axes(x: Vector, y: Vector, z: Vector) -> QuaternionXyzw:
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
