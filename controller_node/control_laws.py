"""Control laws: pure functions from state, reference and gains to a generalised effort (n,).

Errors are those of `JointLayout.difference`: in rad or m, a rotation's as a rotation vector in the
child frame. Efforts are in N m or N, in the frames of docs/design.md. A law without stiffness or
integral gain is the one with those gains at zero.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.layout import JointLayout

Solver: TypeAlias = Callable[[FloatArray, FloatArray], FloatArray]
"""`(force, added) -> a`: the acceleration (n,) of `(M + diag(added)) a = force`."""


def pd_effort(
    stiffness: FloatArray,  # (n,) N m/rad or N/m
    damping: FloatArray,  # (n,) N m s/rad or N s/m
    error: FloatArray,  # (n,) reference against state
    velocity_error: FloatArray,  # (n,) reference minus state
) -> FloatArray:
    """Proportional-derivative control, explicit: `Kp e + Kd de/dt`.

    On a mass m it holds a constant load f at the error `f / kp`, is critically damped at
    `kd = 2 sqrt(kp m)`, and at a control period h is stable for `kp h^2 + 2 kd h < 4 m`.
    """
    return stiffness * error + damping * velocity_error


def pid_effort(
    stiffness: FloatArray,  # (n,) N m/rad or N/m
    damping: FloatArray,  # (n,) N m s/rad or N s/m
    integral_gain: FloatArray,  # (n,) N m/(rad s) or N/(m s)
    error: FloatArray,  # (n,) reference against state
    velocity_error: FloatArray,  # (n,) reference minus state
    integral: FloatArray,  # (n,) of the error over time, rad s or m s
) -> FloatArray:
    """Proportional-integral-derivative control: PD, and `Ki` times the integral of the error.

    It leaves no steady-state error. On a mass m it is stable for `0 < ki < kp kd / m`.
    """
    return pd_effort(stiffness, damping, error, velocity_error) + integral_gain * integral


def anti_windup_mask(
    effort: FloatArray,  # (n,) that the integral takes part in, not clipped
    clipped: FloatArray,  # (n,) what the limits leave of it
    error: FloatArray,  # (n,)
    layout: JointLayout,
) -> BoolArray:
    """Which entries' (n,) integrals must not grow: of vectors that the error drives beyond limits.

    That is anti-windup by conditional integration: Astrom and Hagglund 2006, "Advanced PID
    Control", section 3.5.
    """
    beyond = layout.vector_sums(np.abs(effort - clipped)) > 0.0
    further = layout.vector_sums(effort * error) > 0.0
    return np.repeat(beyond & further, layout.vector_lengths)


def stable_pd_effort(
    solve: Solver,  # with passive damping D of M + D h
    bias: FloatArray,  # (n,) Coriolis, centrifugal and gravity, and D v
    stiffness: FloatArray,  # (n,)
    damping: FloatArray,  # (n,)
    next_error: FloatArray,  # (n,) reference at t + h against the state at t
    velocity: FloatArray,  # (n,)
    reference_velocity: FloatArray,  # (n,) at t + h
    period: float,  # h, s
    feedforward: FloatArray | float = 0.0,  # (n,) F, what acts beside the PD control
) -> FloatArray:
    """Stable PD: the law of the state at the end of the control period, solved for now.

    With the acceleration `a` of `(M + Kd h) a = F + Kp (e - h v) + Kd (vr - v) - C` the effort is
    `F + Kp (e - h v) + Kd (vr - v - h a)`. Contact forces are not foreseen. Joints, ball joints and
    a floating base go through one solve. On a mass m it is stable for `3 kp h^2 < 4 m + 2 kd h`.

    Source: Tan, Liu and Turk 2011, "Stable Proportional-Derivative Controllers". Computed torque is
    the same with inverse dynamics as F: Siciliano et al. 2009, "Robotics", section 8.5.
    """
    implicit = damping * period
    known = (
        feedforward
        + stiffness * (next_error - period * velocity)
        + damping * (reference_velocity - velocity)
    )
    effort: FloatArray = known - implicit * solve(known - bias, implicit)
    return effort
