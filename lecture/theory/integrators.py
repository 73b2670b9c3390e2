"""Time steps of a point and of a turning body: by Euler, explicit and semi-implicit.

Explicit Euler moves by the velocity of before, `x+ = x + h v`; the semi-implicit one of the lecture
by the new one, `x+ = x + h v+`. A turn goes by the angular velocity w: `q+ = q + h/2 w q`, brought
to length one or not, or by the exponential map, `q+ = exp(h w) q`, which turns by the angle h |w|.
Sources: GAMES 105, lecture 9, "Simulation of a Rigid Body System"; Hairer, Lubich and Wanner 2006,
"Geometric Numerical Integration", chapter I.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from lecture.theory.euler import RigidBodyMotion
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations


def swing(
    frequency: float, start: tuple[float, float], step: float, count: int, *, explicit: bool
) -> FloatArray:
    """Positions and velocities (count + 1, 2) of `x'' = -frequency^2 x`, m and m/s.

    Explicitly its energy grows by the factor `1 + (h frequency)^2` in each step; semi-implicitly
    `v^2 + (frequency x)^2 - h frequency^2 x v` stays as it is, so the energy only wavers.
    """
    states = [start]
    for _ in range(count):
        x, v = states[-1]
        after = v - step * frequency**2 * x
        states.append((x + step * (v if explicit else after), after))
    return np.array(states)


def swing_energy(frequency: float, states: FloatArray) -> FloatArray:
    """Energy (t,) of states (t, 2) of a swing of 1 kg, J."""
    energy: FloatArray = 0.5 * states[:, 1] ** 2 + 0.5 * (frequency * states[:, 0]) ** 2
    return energy


def fall_off(gravity: float, step: float, times: FloatArray, *, explicit: bool) -> FloatArray:
    """How far (t,) in m above its parabola a falling point is: `g h t / 2`, or so much below."""
    above: FloatArray = (0.5 if explicit else -0.5) * gravity * step * times
    return above


def _by_rate(turn: FloatArray, spin: FloatArray, step: float) -> FloatArray:
    """`q + h/2 w q`, whose length is `sqrt(1 + (h |w| / 2)^2)` times that of q."""
    vector = np.concatenate((spin, np.zeros((*spin.shape[:-1], 1))), axis=-1)
    return turn + 0.5 * step * rotations.multiply(vector, turn)


def _normalised(turn: FloatArray, spin: FloatArray, step: float) -> FloatArray:
    return rotations.normalised(_by_rate(turn, spin, step))


def _exponential(turn: FloatArray, spin: FloatArray, step: float) -> FloatArray:
    return rotations.multiply(rotations.exp(step * spin), turn)


@dataclass(frozen=True)
class TurnRule:
    """How a quaternion is brought to the end of a step."""

    update: Callable[[FloatArray, FloatArray, float], FloatArray]  # q (..., 4), w (..., 3), h
    explicit: bool = False  # whether by the angular velocity of before


TURN_RULES: Mapping[str, TurnRule] = {
    "explicit": TurnRule(_normalised, explicit=True),
    "not normalised": TurnRule(_by_rate),
    "normalised": TurnRule(_normalised),
    "exponential map": TurnRule(_exponential),
}
"""The rules by name, all but the first semi-implicit; angular velocities in world axes, rad/s."""


def tumble(
    inertia: FloatArray, turn: FloatArray, spin: FloatArray, times: FloatArray, rule: TurnRule
) -> tuple[FloatArray, FloatArray]:
    """A body that nothing acts on: quaternions (t, 4), and angular velocities (t, 3), world.

        I (w+ - w) / h + w x I w = 0,    I = R I0 R^T

    Args:
        inertia: Principal moments (3,), kg m^2.
        turn: The first quaternion xyzw (4,).
        spin: The first angular velocity (3,) in rad/s, world axes.
        times: Evenly spaced, s.
        rule: Brings the quaternion to the end of a step.
    """
    step = float(times[1] - times[0])
    turns, spins = [turn], [spin]
    for _ in times[1:]:
        axes = rotations.matrix(turns[-1])
        whole = axes @ np.diag(inertia) @ axes.T
        before = spins[-1]
        after = before - step * np.linalg.solve(whole, np.cross(before, whole @ before))
        turns.append(rule.update(turns[-1], before if rule.explicit else after, step))
        spins.append(after)
    return np.array(turns), np.array(spins)


def ticks_off(rule: TurnRule, motion: RigidBodyMotion, step: float) -> FloatArray:
    """The angle (t,) in rad between each turn and the one that a rule makes of that before it.

    The motion is (t + 1) states, `step` s apart.
    """
    spins = rotations.rotate(motion.turn_xyzw, motion.angular_velocity)
    by = spins[:-1] if rule.explicit else spins[1:]
    predicted = rotations.normalised(rule.update(motion.turn_xyzw[:-1], by, step))
    return rotations.angle_between(predicted, motion.turn_xyzw[1:])


def energy_and_momentum(
    inertia: FloatArray, turn: FloatArray, spin: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Energy (t,) in J, and angular momentum (t, 3) in kg m^2/s, world axes.

    Of quaternions (t, 4) of any length, and angular velocities (t, 3) in rad/s, world axes.
    """
    unit = rotations.normalised(turn)
    in_body = rotations.rotate(rotations.conjugate(unit), spin)
    energy: FloatArray = 0.5 * (inertia * in_body**2).sum(axis=1)
    return energy, rotations.rotate(unit, inertia * in_body)
