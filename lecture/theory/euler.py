"""The motion of one rigid body by Newton's and Euler's laws, without any engine.

    m dv/dt = f,    I dw/dt + w x I w = tau,    tau = sum (tau_i + r_i x f_i)

Source: GAMES 105, lecture 9. I and w are in the body's principal axes here, f in the world's.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Vector
from msgs_config.geometry import rotations
from msgs_config.geometry.fixed_order import cross

_ZERO = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Load:
    """A force and a torque that keep their direction in the world, while the point turns along."""

    force: Vector = _ZERO  # N, world
    torque: Vector = _ZERO  # N m, world
    point: Vector = _ZERO  # the force acts here: m from the centre of mass, body axes


@dataclass(frozen=True)
class RigidBody:
    """Mass and principal moments of inertia."""

    mass: float  # kg
    inertia: FloatArray  # (3,) kg m^2


@dataclass(frozen=True)
class RigidBodyMotion:
    """The states of a rigid body at t times."""

    centre: FloatArray  # (t, 3) of mass, m, world
    turn_xyzw: FloatArray  # (t, 4)
    velocity: FloatArray  # (t, 3) m/s, world
    angular_velocity: FloatArray  # (t, 3) rad/s, body axes


def net_load(loads: Sequence[Load], turn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Force (3,) in N and torque (..., 3) in N m about the centre, world.

    `turn` (..., 3, 3) are rotation matrices of the body.
    """
    force, torque = np.zeros(3), np.zeros((*turn.shape[:-2], 3))
    for load in loads:
        force += load.force
        arm = np.einsum("...ij,j->...i", turn, np.array(load.point))
        torque += np.array(load.torque) + cross(arm, np.array(load.force))
    return force, torque


def angular_acceleration(
    inertia: FloatArray, angular_velocity: FloatArray, torque: FloatArray
) -> FloatArray:
    """`I^-1 (tau - w x I w)` in rad/s^2; all (..., 3) in body axes."""
    gyroscopic = cross(angular_velocity, inertia * angular_velocity)
    acceleration: FloatArray = (torque - gyroscopic) / inertia
    return acceleration


def move(
    body: RigidBody, start: RigidBodyMotion, loads: Sequence[Load], times: FloatArray
) -> RigidBodyMotion:
    """The motion that begins as `start` does, at rising times (t,) in s; the first is its.

    By Runge's and Kutta's method of fourth order, a step from time to time.
    """
    parts = (start.centre, start.turn_xyzw, start.velocity, start.angular_velocity)
    state = np.concatenate([part[0] for part in parts])
    states = [state]
    for step in np.diff(times).tolist():
        first = _rate(body, loads, state)
        second = _rate(body, loads, state + 0.5 * step * first)
        third = _rate(body, loads, state + 0.5 * step * second)
        fourth = _rate(body, loads, state + step * third)
        state = state + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        states.append(state)
    centre, turn, velocity, spin = np.split(np.array(states), (3, 7, 10), axis=1)
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    return RigidBodyMotion(centre, turn, velocity, spin)


def order_of(steps: FloatArray, errors: Sequence[float]) -> float:
    """The order of errors (k,) at steps (k,): the slope of their logarithms."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def _rate(body: RigidBody, loads: Sequence[Load], state: FloatArray) -> FloatArray:
    """The rate (13,) of centre, quaternion, velocity and angular velocity: `dq/dt = q w / 2`."""
    turn, velocity, spin = state[3:7], state[7:10], state[10:13]
    matrix = rotations.matrix(rotations.normalised(turn))
    force, torque = net_load(loads, matrix)
    torque_in_body = matrix.T @ torque
    vector, scalar = turn[:3], turn[3]
    turning = 0.5 * np.append(scalar * spin + cross(vector, spin), -vector @ spin)
    acceleration = angular_acceleration(body.inertia, spin, torque_in_body)
    return np.concatenate((velocity, turning, force / body.mass, acceleration))
