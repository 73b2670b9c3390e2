"""Measures of tracking: errors, overshoot, lag, time of a fall; and their theory."""

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.metrics import error_measures
from msgs_config.arrays import FloatArray


def joint_errors(run: Recording, reference: FloatArray | None = None) -> FloatArray:
    """Angle (r, j) in rad of each of j hinges and balls from where it is to be.

    `reference` (r, n) is that of the first r states; by default the run's own, before each tick.
    """
    desired = run.reference_position[:-1] if reference is None else reference
    return error_measures.joint_errors(run.layout, run.position[: len(desired)], desired)


def root_force_share(run: Recording, ticks: int | None = None) -> float:
    """Size of the root's force over the character's weight, mean over so many first ticks."""
    weight = run.character.mass * float(run.parameters["gravity"])
    return float(np.linalg.norm(run.effort[:ticks, :3], axis=1).mean()) / weight


def overshoot(angle: FloatArray, reference: FloatArray) -> float:
    """Overshoot of an angle (t,) beyond the extremes of its reference (t,), over their distance.

    Negative where it stays within both. Of a step it is the overshoot of the step's response.
    """
    beyond = max(float(angle.max() - reference.max()), float(reference.min() - angle.min()))
    return beyond / float(np.ptp(reference))


def lag(angle: FloatArray, reference: FloatArray, period: float, longest: float) -> float:
    """Time in s by which an angle (t,) comes after its reference (t,); negative if before it.

    It is where their correlation is largest, between two samples by the parabola through three.

    Args:
        angle: What was reached, one sample each `period`.
        reference: What was desired at the same times.
        period: Time from sample to sample, s.
        longest: Lags up to this one, s, are looked at; less than half a cycle of a cyclic motion.
    """
    most = min(round(longest / period), (len(reference) - 2) // 2)
    middle = reference[most : len(reference) - most]
    shifted = np.lib.stride_tricks.sliding_window_view(angle, len(middle))  # shifts: -most to most
    shifted = shifted - shifted.mean(axis=1, keepdims=True)
    lengths = np.linalg.norm(shifted, axis=1)
    products = shifted @ middle  # rows without a mean: that of `middle` adds nothing
    correlation = np.divide(products, lengths, out=np.zeros_like(lengths), where=lengths > 0.0)
    best = int(correlation.argmax())
    between = 0.0
    if 0 < best < 2 * most:
        before, at, after = correlation[best - 1 : best + 2].tolist()
        curvature = before - 2.0 * at + after
        between = 0.5 * (before - after) / curvature if curvature else 0.0
    return (best - most + between) * period


def inertialess_response(
    reference: FloatArray, velocity: FloatArray, stiffness: float, damping: float, period: float
) -> FloatArray:
    """Angle (t,) in rad of a joint without inertia that stable PD leads along a reference.

    The law (Tan, Liu, Turk 2011) is then `kp (r - q - h v) + kd (s - v) = 0`, the reference r and
    its velocity s taken at t + h: a first-order filter. With s = 0 a slow motion lags by `kd / kp`.

    Args:
        reference: r (t,), rad, one sample each `period`.
        velocity: s (t,), rad/s; zero where it is not followed.
        stiffness: kp, N m/rad.
        damping: kd, N m s/rad.
        period: h, of control, s.
    """
    effective_damping = damping + stiffness * period
    angle = reference.copy()
    for k, (desired, speed) in enumerate(zip(reference[1:], velocity[1:], strict=True)):
        angle[k + 1] = angle[k] + period * (
            (stiffness * (desired - angle[k]) + damping * speed) / effective_damping
        )
    return angle


def delayed_spectral_radius(
    mass_matrix: FloatArray,
    stiffness: FloatArray,
    damping: FloatArray,
    period: float,
    *,
    delay_ticks: int,
    substeps: int = 1,
) -> float:
    """Growth a tick of small deviations from rest under stable PD whose efforts come late.

    Below 1 the loop is stable. In stable PD (Tan, Liu, Turk 2011) the effort of a tick is
    `M a(k)` with `(M + Kd h) a(k) = -Kp x(k) - (Kd + Kp h) v(k)`, where the engine has not the
    inertia `Kd h`. Late by d ticks it leads to `v(k + 1) = v(k) + h a(k - d)`; the engine takes s
    semi-implicit steps a tick, so `x(k + 1) = x(k) + h v(k) + h^2 (s + 1) / (2 s) a(k - d)`.

    Args:
        mass_matrix: M (n, n): kg, kg m^2.
        stiffness: Diagonal of Kp (n,): N m/rad or N/m.
        damping: Diagonal of Kd (n,): N m s/rad or N s/m.
        period: h, of control, s.
        delay_ticks: d.
        substeps: s.
    """
    size, blocks = len(stiffness), 2 + delay_ticks
    implicit = mass_matrix + np.diag(damping * period)
    # blocks: position, velocity, and what was asked for a tick ago, two ticks ago, ...
    every = np.eye(blocks * size).reshape(blocks, size, blocks * size)
    asked = np.zeros((size, blocks * size))
    asked[:, :size] = -np.linalg.solve(implicit, np.diag(stiffness))
    asked[:, size : 2 * size] = -np.linalg.solve(implicit, np.diag(damping + stiffness * period))
    acting = every[-1] if delay_ticks else asked
    moved = period * period * (substeps + 1) / (2 * substeps)
    position = every[0] + period * every[1] + moved * acting
    velocity = every[1] + period * acting
    matrix = np.concatenate((position, velocity, *([asked] * bool(delay_ticks)), *every[2:-1]))
    return float(np.abs(np.linalg.eigvals(matrix)).max())
