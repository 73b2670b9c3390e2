"""The forces of the lecture, and the bound of explicit PD."""

import math


def pd_force(error: float, error_rate: float, stiffness: float, damping: float) -> float:
    return stiffness * error + damping * error_rate


def critical_damping(stiffness: float, mass: float) -> float:
    return 2.0 * math.sqrt(stiffness * mass)


def pid_force(
    error: float,
    error_rate: float,
    integral: float,
    stiffness: float,
    damping: float,
    integral_gain: float,
) -> float:
    return pd_force(error, error_rate, stiffness, damping) + integral_gain * integral


def largest_stiffness(damping: float, mass: float, period: float) -> float:
    return (4.0 * mass - 2.0 * damping * period) / period**2
