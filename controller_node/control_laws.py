"""Control laws: pure functions from state, reference and gains to a generalised effort (n,).

Errors are those of `JointLayout.difference`: in rad or m, a rotation's as a rotation vector in the
child frame. Efforts are in N m or N, in the frames of docs/design.md.
"""

import numpy as np

from msgs_config.arrays import FloatArray


def pd_effort(
    stiffness: FloatArray,  # (n,) N m/rad or N/m
    damping: FloatArray,  # (n,) N m s/rad or N s/m
    error: FloatArray,  # (n,) reference against state
    velocity_error: FloatArray,  # (n,) reference minus state
) -> FloatArray:
    """Proportional-derivative control, explicit: `Kp e + Kd de/dt`.

    On a mass m at a control period h it is stable for `kp h^2 + 2 kd h < 4 m`.
    """
    return stiffness * error + damping * velocity_error


def stable_pd_effort(
    mass_matrix: FloatArray,  # (n, n), with passive damping D that of M + D h
    bias: FloatArray,  # (n,) Coriolis, centrifugal and gravity, and D v
    stiffness: FloatArray,  # (n,)
    damping: FloatArray,  # (n,)
    next_error: FloatArray,  # (n,) reference at t + h against the state at t
    velocity: FloatArray,  # (n,)
    reference_velocity: FloatArray,  # (n,) at t + h
    period: float,  # h, s
) -> FloatArray:
    """Stable PD: the law of the state at the end of the control period, solved for now.

    With the acceleration `a` of `(M + Kd h) a = Kp (e - h v) + Kd (vr - v) - C` the effort is
    `Kp (e - h v) + Kd (vr - v - h a)`. Contact forces are not foreseen. Joints, ball joints and a
    floating base go through one solve. On a mass m it is stable for `3 kp h^2 < 4 m + 2 kd h`.

    Source: Tan, Liu and Turk 2011, "Stable Proportional-Derivative Controllers".
    """
    explicit = stiffness * (next_error - period * velocity) + damping * (
        reference_velocity - velocity
    )
    implicit_mass = mass_matrix + np.diag(damping * period)
    acceleration = np.linalg.solve(implicit_mass, explicit - bias)
    return explicit - damping * period * acceleration
