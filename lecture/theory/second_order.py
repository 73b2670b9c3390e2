"""One mass under PD or PID control: closed forms, and the identification of a recorded motion.

m is the mass (kg), kp the stiffness (N/m), kd the damping (N s/m), ki the integral gain (N/(m s)),
h the control period (s). Sources: Astrom and Murray 2008, "Feedback Systems", chapters 6 and 10;
Tan, Liu and Turk 2011 for stable PD. The bounds follow from the poles of the recurrences
(semi-implicit Euler: the speed first, then the height with the new speed).
"""

import math
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray

_SETTLING_BAND = 0.02  # share of the way: the usual band of the settling time


def critical_damping(stiffness: float, mass: float) -> float:
    """The damping (N s/m) at which a mass no longer swings: `2 sqrt(kp m)`."""
    return 2.0 * math.sqrt(stiffness * mass)


def damping_ratio(stiffness: float, damping: float, mass: float) -> float:
    """`kd / (2 sqrt(kp m))`: below 1 it swings, above 1 it creeps."""
    return damping / critical_damping(stiffness, mass)


def stable_pd_damping_ratio(stiffness: float, damping: float, mass: float, period: float) -> float:
    """`(kd + kp h) / (2 sqrt(kp (m + kd h)))`: that of the mass that stable PD moves."""
    implicit = mass + damping * period
    return (damping + stiffness * period) / critical_damping(stiffness, implicit)


def overshoot(ratio: float) -> float:
    """Overshoot of a step response as a share of the step: `exp(-pi z / sqrt(1 - z^2))`."""
    return math.exp(-math.pi * ratio / math.sqrt(1.0 - ratio**2)) if ratio < 1.0 else 0.0


def largest_integral_gain(stiffness: float, damping: float, mass: float) -> float:
    """The integral gain (N/(m s)) at which PID begins to swing ever wider: `kp kd / m`."""
    return stiffness * damping / mass


def explicit_is_stable(stiffness: float, damping: float, mass: float, period: float) -> bool:
    """True if explicit PD is stable: `kp h^2 + 2 kd h < 4 m`."""
    return stiffness * period**2 + 2.0 * damping * period < 4.0 * mass


def stable_pd_is_stable(stiffness: float, damping: float, mass: float, period: float) -> bool:
    """True if stable PD is stable: `3 kp h^2 < 4 m + 2 kd h`."""
    return 3.0 * stiffness * period**2 < 4.0 * mass + 2.0 * damping * period


def largest_explicit_stiffness(mass: float, period: float) -> float:
    """The bound of explicit PD for critical damping: `(2 sqrt(2) - 2)^2 m / h^2`, in N/m.

    With `kd = 2 sqrt(kp m)` and `x = h sqrt(kp / m)` the bound is `x^2 + 4 x = 4`.
    """
    return (2.0 * math.sqrt(2.0) - 2.0) ** 2 * mass / period**2


def largest_stable_pd_stiffness(mass: float, period: float) -> float:
    """The bound of stable PD for critical damping: `4 m / h^2`, in N/m.

    With `kd = 2 sqrt(kp m)` and `x = h sqrt(kp / m)` the bound is `3 x^2 = 4 + 4 x`.
    """
    return 4.0 * mass / period**2


@dataclass(frozen=True)
class Oscillation:
    """Parameters of a motion of second order."""

    damping_ratio: float
    frequency: float  # undamped, rad/s
    rest: float  # height at which it comes to rest, or about which it swings, m


def identify(track: FloatArray, period: float) -> Oscillation:
    """The linear oscillation that a track (t,) in m, sampled every `period` s, obeys.

    It obeys `x[k+2] = a x[k+1] + b x[k] + c` exactly, if it is one; the poles `z` of that are
    `exp(s h)`, and `s^2 + 2 zeta omega s + omega^2 = 0`.
    """
    origin = track.mean()
    x = track - origin
    known = np.stack([x[1:-1], x[:-2], np.ones(len(x) - 2)], axis=1)
    (a, b, c), *_ = np.linalg.lstsq(known, x[2:], rcond=None)
    poles = np.log(np.roots([1.0, -a, -b]).astype(complex)) / period
    frequency = math.sqrt(abs(np.prod(poles).real))
    ratio = -float(np.sum(poles).real) / (2.0 * frequency)
    return Oscillation(ratio, frequency, float(origin + c / (1.0 - a - b)))


def measured_overshoot(track: FloatArray, rest: float) -> float:
    """Overshoot of a track (t,) beyond its rest, as a share of the way there."""
    way = rest - track[0]
    return max(0.0, float(((track - rest) / way).max()))


def settling_time(times: FloatArray, track: FloatArray, rest: float) -> float | None:
    """Time in s from which a track (t,) stays within 2 % of its way; None if it never does."""
    outside = np.flatnonzero(np.abs(track - rest) > _SETTLING_BAND * abs(rest - track[0]))
    if not len(outside):
        return 0.0
    after = int(outside[-1]) + 1
    return float(times[after]) if after < len(times) else None


def swings_wider(track: FloatArray, rest: float) -> bool:
    """True if a track (t,) is farther from its rest in its last quarter than in its second."""
    distance, quarter = np.abs(track - rest), len(track) // 4
    return bool(distance[-quarter:].max() > distance[quarter : 2 * quarter].max())


def step_response(
    times: FloatArray, stiffness: float, damping: float, mass: float, load: float
) -> FloatArray:
    """The height (t,) in m of a mass under PD towards 1 m, from rest at 0, in continuous time.

    The load (N) acts against the motion; the sum of two exponentials, `(1 + w t) exp(-w t)` where
    they are equal.
    """
    frequency = math.sqrt(stiffness / mass)
    ratio = damping_ratio(stiffness, damping, mass)
    rest = 1.0 - load / stiffness
    if abs(ratio - 1.0) < 1e-9:
        away: FloatArray = (1.0 + frequency * times) * np.exp(-frequency * times)
    else:
        root = np.sqrt(complex(ratio**2 - 1.0))
        first, second = frequency * (-ratio + root), frequency * (-ratio - root)
        both = second * np.exp(first * times) - first * np.exp(second * times)
        away = (both / (second - first)).real
    return rest * (1.0 - away)
