"""Rotations as unit quaternions (xyzw) and rotation vectors, on arrays of any batch shape.

A quaternion `q` of shape (..., 4) turns coordinates of the child frame into the parent frame.
`exp` and `log` below are those of SO(3) (Solà, Deray and Atchuthan 2018, "A micro Lie theory").
"""

import math

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.geometry import elementary, fixed_order

IDENTITY_XYZW = (0.0, 0.0, 0.0, 1.0)
# It keeps 0 / 0 away; the product with a vector of length zero is zero all the same.
_TINY_DIVISOR = 1e-150

_SMALL_ANGLE = 1e-2  # rad
_SERIES_END = 10.0  # rad^2, just over half a turn, where 15 terms give all digits

_CONJUGATE = np.array([-1.0, -1.0, -1.0, 1.0])

# The Hamilton product `a b`, a row a component: which of b's goes with a's x, y, z and w; its sign.
_PARTNERS = np.array([[3, 2, 1, 0], [2, 3, 0, 1], [1, 0, 3, 2], [0, 1, 2, 3]])
_PARTNER_SIGNS = np.array([[1, 1, -1, 1], [-1, 1, 1, 1], [1, -1, 1, 1], [-1, -1, -1, 1]]) * 1.0

# The rotation matrix of q, a row an entry: which of the products xx, xy, xz, xw, yx, ... ww; signs.
_PAIRS = np.array(
    [
        *([0, 5, 10, 15], [1, 4, 11, 14], [2, 7, 8, 13]),
        *([1, 4, 11, 14], [0, 5, 10, 15], [3, 6, 9, 12]),
        *([2, 7, 8, 13], [3, 6, 9, 12], [0, 5, 10, 15]),
    ]
)
_PAIR_SIGNS = 1.0 * np.array(
    [
        *([1, -1, -1, 1], [1, 1, -1, -1], [1, 1, 1, 1]),
        *([1, 1, 1, 1], [-1, 1, -1, 1], [-1, 1, 1, -1]),
        *([1, -1, 1, -1], [1, 1, 1, 1], [-1, -1, 1, 1]),
    ]
)


def multiply(a_xyzw: FloatArray, b_xyzw: FloatArray) -> FloatArray:
    """Hamilton product `a b`: turn by b first, then by a; (..., 4) each, broadcast."""
    return fixed_order.apply(b_xyzw.take(_PARTNERS, axis=-1) * _PARTNER_SIGNS, a_xyzw)


def conjugate(q_xyzw: FloatArray) -> FloatArray:
    """The inverse of unit quaternions (..., 4)."""
    inverse: FloatArray = q_xyzw * _CONJUGATE
    return inverse


def matrix(q_xyzw: FloatArray) -> FloatArray:
    """Rotation matrices (..., 3, 3): their columns are the child's axes in the parent frame."""
    shape = q_xyzw.shape[:-1]
    pairs = (q_xyzw[..., :, np.newaxis] * q_xyzw[..., np.newaxis, :]).reshape(*shape, 16)
    entries = fixed_order.total(pairs.take(_PAIRS, axis=-1) * _PAIR_SIGNS)
    return entries.reshape(*shape, 3, 3)


def _length(vectors: FloatArray) -> FloatArray:
    """Lengths (..., 1) of vectors (..., m)."""
    return fixed_order.norm(vectors)[..., np.newaxis]


def rotate(q_xyzw: FloatArray, vector: FloatArray) -> FloatArray:
    """Vectors (..., 3) given in the child frame, in the parent frame; same unit as given."""
    return fixed_order.apply(matrix(q_xyzw), vector)


def exp(rotation_vector: FloatArray) -> FloatArray:
    """Unit quaternions xyzw (..., 4) of rotation vectors (..., 3) in rad."""
    half_angle = 0.5 * _length(rotation_vector)
    q_xyzw = np.empty((*rotation_vector.shape[:-1], 4))
    q_xyzw[..., :3] = rotation_vector * (
        0.5 * elementary.sin(half_angle) / np.maximum(half_angle, _TINY_DIVISOR)
    )
    q_xyzw[..., 3:] = elementary.cos(half_angle)
    return q_xyzw


def log(q_xyzw: FloatArray) -> FloatArray:
    """Rotation vectors (..., 3) in rad, of norm at most pi, of unit quaternions (..., 4).

    Of the two quaternions of a rotation the one with w >= 0 is meant, so that the angle is the
    shorter one.
    """
    axis, w = q_xyzw[..., :3], q_xyzw[..., 3:]
    sine = _length(axis)
    angle = 2.0 * elementary.arctan2(sine, np.abs(w))
    return axis * np.copysign(angle / np.maximum(sine, _TINY_DIVISOR), w)


def right_jacobian_inverse(rotation_vector: FloatArray) -> FloatArray:
    """Matrices (..., 3, 3) that turn an angular velocity into the rate of a rotation vector.

    The angular velocity is in the child frame; vectors (..., 3) in rad, of norm below 2 pi. With
    `K v = r x v` and angle a it is `1 + K/2 + (1/a^2 - (1 + cos a) / (2 a sin a)) K^2`.

    Source: Solà, Deray and Atchuthan 2018, equation 144.
    """
    angle = _length(rotation_vector)[..., np.newaxis]
    half = np.maximum(0.5 * angle, 0.5 * _SMALL_ANGLE)
    closed = (1.0 - half / elementary.tan(half)) / (4.0 * half * half)
    series = 1.0 / 12.0 + angle * angle / 720.0  # here the closed form would lose its digits
    cross = _cross_matrix(rotation_vector)
    inverse: FloatArray = (
        np.eye(3)
        + 0.5 * cross
        + np.where(angle < _SMALL_ANGLE, series, closed) * fixed_order.product(cross, cross)
    )
    return inverse


def angular_motion(
    rotation_vector: FloatArray, rate: FloatArray, second_rate: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Angular velocity and acceleration (..., 3) of `exp(r(t))`, in the child frame.

    From the rotation vector r in rad, its rate in rad/s and the rate's in rad/s^2, of one shape.
    With angle a the velocity is `Jr u = u - A r x u + B r x (r x u)` of u, the rate of r, where
    `A = (1 - cos a) / a^2` and `B = (a - sin a) / a^3`; the acceleration is its derivative.

    Source of Jr: Solà, Deray and Atchuthan 2018, equation 143.
    """
    r, u = rotation_vector, rate
    along, speed = _dot(r, u), _dot(u, u)
    a, b, a_slope, b_slope = _jacobian_coefficients(_dot(r, r))
    rates = np.array((u, second_rate))
    once = fixed_order.cross(r, rates)
    twice = fixed_order.cross(r, once)
    velocity, acceleration = rates - a * once + b * twice
    acceleration += b * (speed * r - along * u)  # u x (r x u)
    acceleration -= along * (a_slope * once[0] - b_slope * twice[0])
    return velocity, acceleration


def rotation_vector_rates(
    rotation_vector: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The inverse of `angular_motion`: rate and second rate (..., 3) of a rotation vector.

    From an angular velocity in rad/s and acceleration in rad/s^2 in the child frame, of one shape
    with the rotation vectors, which are in rad and of norm below 2 pi.
    """
    inverse = right_jacobian_inverse(rotation_vector)
    rate = fixed_order.apply(inverse, velocity)
    _, convective = angular_motion(rotation_vector, rate, np.zeros_like(rate))
    return rate, fixed_order.apply(inverse, acceleration - convective)


def _jacobian_coefficients(
    square: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """A and B of the right Jacobian, and `dA/da / a` and `dB/da / a`, of squared angles a^2.

    Up to half a turn by their power series: there, at small angles, the closed forms lose digits.
    """
    powers = fixed_order.powers(np.minimum(square, _SERIES_END), _JACOBIAN_SERIES.shape[-1])
    a, b, a_slope, b_slope = np.moveaxis(fixed_order.apply(_JACOBIAN_SERIES, powers), -1, 0)
    large = square > _SERIES_END
    if large.any():
        square = np.maximum(square, _SERIES_END)
        angle, fourth = np.sqrt(square), square * square
        sine, versine = elementary.sin(angle), 1.0 - elementary.cos(angle)
        a = np.where(large, versine / square, a)
        b = np.where(large, (angle - sine) / (angle * square), b)
        a_slope = np.where(large, (angle * sine - 2.0 * versine) / fourth, a_slope)
        closed = (3.0 * sine + angle * versine - 3.0 * angle) / (angle * fourth)
        b_slope = np.where(large, closed, b_slope)
    return a, b, a_slope, b_slope


def _jacobian_series(terms: int) -> FloatArray:
    """Coefficients (4, terms) of the powers of a^2 in A, B, `dA/da / a` and `dB/da / a`."""
    order = range(terms + 1)
    a = np.array([(-1.0) ** k / math.factorial(2 * k + 2) for k in order])
    b = np.array([(-1.0) ** k / math.factorial(2 * k + 3) for k in order])
    rise = 2.0 * np.arange(1, len(order))  # d/da / a of a^(2 k) is 2 k a^(2 k - 2)
    return np.array([a[:-1], b[:-1], rise * a[1:], rise * b[1:]])


_JACOBIAN_SERIES = _jacobian_series(15)


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Scalar products (..., 1) of vectors (..., m)."""
    return fixed_order.dot(a, b)[..., np.newaxis]


def _cross_matrix(vectors: FloatArray) -> FloatArray:
    """Matrices (..., 3, 3) whose product with u is the vector product `v x u`."""
    return fixed_order.cross(vectors[..., np.newaxis, :], np.eye(3)).swapaxes(-1, -2)


def normalised(q_xyzw: FloatArray) -> FloatArray:
    """Quaternions (..., 4) scaled to length one."""
    return q_xyzw / _length(q_xyzw)


def angle_between(a_xyzw: FloatArray, b_xyzw: FloatArray) -> FloatArray:
    """Angle (...) in rad, 0 to pi, that turns a into b."""
    return _length(log(multiply(conjugate(a_xyzw), b_xyzw)))[..., 0]


def yaw(q_xyzw: FloatArray) -> FloatArray:
    """Angle (...) in rad, -pi to pi, about the parent's z: the twist of swing and twist."""
    z, w = q_xyzw[..., 2], q_xyzw[..., 3]
    angle: FloatArray = 2.0 * elementary.arctan2(z * np.copysign(1.0, w), np.abs(w))
    return angle


def yaw_pitch_roll(axes: FloatArray) -> FloatArray:
    """The angles (..., 3) in rad whose turns about z, y and x, in this order, are axes (..., 3, 3).

    So `axes = Rz(yaw) Ry(pitch) Rx(roll)`; URDF's `rpy` has them the other way round. Pitch is
    within a quarter turn. Where it is one, any yaw will do: pitch and roll are what remains of the
    axes when this yaw is taken off them.
    """
    yaw = elementary.arctan2(axes[..., 1, 0], axes[..., 0, 0])
    sine, cosine = elementary.sin(yaw), elementary.cos(yaw)
    level = cosine * axes[..., 0, 0] + sine * axes[..., 1, 0]
    pitch = elementary.arctan2(-axes[..., 2, 0], level)
    roll = elementary.arctan2(
        sine * axes[..., 0, 2] - cosine * axes[..., 1, 2],
        cosine * axes[..., 1, 1] - sine * axes[..., 0, 1],
    )
    return np.stack((yaw, pitch, roll), axis=-1)


def about_z(angle: float) -> FloatArray:
    """The quaternion xyzw (4,) of a turn by `angle` rad about z."""
    return np.array([0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)])


def from_z(direction: FloatArray) -> FloatArray:
    """The shortest turn xyzw (4,) that leads z to a direction (3,) of any length but zero."""
    x, y, z = (direction / fixed_order.norm(direction)).tolist()
    if z < -1.0 + 1e-9:
        return np.array((1.0, 0.0, 0.0, 0.0))
    return normalised(np.array((-y, x, 0.0, 1.0 + z)))


ABOUT_X_QUARTER_TURN_XYZW = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
"""Turns a y-up model or clip into the z-up world."""


def xyzw_from_wxyz(q_wxyz: FloatArray) -> FloatArray:
    """Reorder quaternions (..., 4), scalar first to scalar last."""
    return np.roll(q_wxyz, -1, axis=-1)


def wxyz_from_xyzw(q_xyzw: FloatArray) -> FloatArray:
    """Reorder quaternions (..., 4), scalar last to scalar first."""
    return np.roll(q_xyzw, 1, axis=-1)
