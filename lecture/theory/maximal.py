"""Two rigid bodies on a ball joint in maximal coordinates: twelve velocities, and a force of joint.

    M dv/dt + C = f + J^T lambda,    J v = 0,    J = [1, -[r1]x, -1, [r2]x]

The velocities v are those of both centres of mass, with both angular velocities, in world axes; r1
and r2 are the arms from the centres to the joint, and lambda is the force of the joint on the first
body. Source: GAMES 105, lecture 9, "Dynamics of Articulated Rigid Bodies" and "Simulation of a
Rigid Body System". No engine is asked.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Vector
from msgs_config.geometry import rotations

_BODIES, _SPACE = 2, 3


@dataclass(frozen=True)
class JointedBody:
    """One of the two bodies."""

    mass: float  # kg
    inertia: FloatArray  # (3,) about the principal axes, which are the body's, kg m^2
    arm: Vector  # m from the centre of mass to the joint, body axes


@dataclass(frozen=True)
class PairState:
    """Where both bodies are and how they move; or, with a first axis of t, at t times."""

    centre: FloatArray  # (2, 3) of mass, m, world
    turn_xyzw: FloatArray  # (2, 4)
    velocity: FloatArray  # (2, 6) of the centre, m/s, and angular, rad/s, both in world axes


@dataclass(frozen=True)
class Equations:
    """The equation of motion of both bodies in one state."""

    mass: FloatArray  # M (12, 12)
    bias: FloatArray  # C (12,), `w x I w`
    force: FloatArray  # f (12,), the weight
    jacobian: FloatArray  # J (3, 12)
    drift: FloatArray  # (3,) m/s^2, `J' v`
    gap: FloatArray  # (3,) m, from the joint on the second body to that on the first

    def solve(self, gains: FloatArray, wanted: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The `x` (12,) and lambda (3,) of `M x = gains + J^T lambda`, `J x = wanted`."""
        size = len(self.mass)
        whole = np.zeros((size + _SPACE, size + _SPACE))
        whole[:size, :size] = self.mass
        whole[:size, size:] = -self.jacobian.T
        whole[size:, :size] = self.jacobian
        both = np.array(np.linalg.solve(whole, np.concatenate((gains, wanted))), dtype=float)
        return both[:size], both[size:]


def make_equations(bodies: Sequence[JointedBody], state: PairState, gravity: float) -> Equations:
    """M, C, f and J of both bodies under a gravity in m/s^2 along -z."""
    mass, bias, force = np.zeros((12, 12)), np.zeros(12), np.zeros(12)
    jacobian, drift, gap = np.zeros((_SPACE, 12)), np.zeros(_SPACE), np.zeros(_SPACE)
    turns = rotations.matrix(state.turn_xyzw)
    for row, (body, sign) in enumerate(zip(bodies, (1.0, -1.0), strict=True)):
        linear = slice(6 * row, 6 * row + 3)
        angular = slice(6 * row + 3, 6 * row + 6)
        inertia = turns[row] @ np.diag(body.inertia) @ turns[row].T
        spin, arm = state.velocity[row, 3:], turns[row] @ np.array(body.arm)
        mass[linear, linear] = body.mass * np.eye(_SPACE)
        mass[angular, angular] = inertia
        bias[angular] = np.cross(spin, inertia @ spin)
        force[linear] = (0.0, 0.0, -body.mass * gravity)
        jacobian[:, linear] = sign * np.eye(_SPACE)
        jacobian[:, angular] = -sign * cross_matrix(arm)
        drift += sign * np.cross(spin, np.cross(spin, arm))
        gap += sign * (state.centre[row] + arm)
    return Equations(mass, bias, force, jacobian, drift, gap)


def cross_matrix(vector: FloatArray) -> FloatArray:
    """The matrix `[r]x` (3, 3), whose product with u is `r x u`."""
    x, y, z = vector.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def joint_force(bodies: Sequence[JointedBody], state: PairState, gravity: float) -> FloatArray:
    """The force lambda (3,) in N of the joint on the first body, world, in continuous time.

    It keeps the joint together: `J dv/dt + J' v = 0`.
    """
    equations = make_equations(bodies, state, gravity)
    return equations.solve(equations.force - equations.bias, -equations.drift)[1]


def step_pair(
    bodies: Sequence[JointedBody],
    start: PairState,
    times: FloatArray,
    gravity: float,
    stabilisation: float = 0.0,
) -> tuple[PairState, FloatArray]:
    """The lecture's time steps: states at evenly spaced times (t,) in s, lambda (t - 1, 3) in N.

        M (v+ - v) / h + C = f + J^T lambda,    J v+ = c,    x+ = x + h v+,    q+ = q + h/2 w+ q

    and q+ is brought to length one. With `c = 0` what the joint has drifted stays; with a share b
    of `stabilisation`, `c = -b gap / h` takes so much of it away in each step (Baumgarte 1972).
    """
    step = float(times[1] - times[0])
    state, states, forces = start, [start], []
    for _ in times[1:]:
        equations = make_equations(bodies, state, gravity)
        momentum = equations.mass @ state.velocity.reshape(-1)
        velocity, impulse = equations.solve(
            momentum + step * (equations.force - equations.bias),
            -stabilisation / step * equations.gap,
        )
        forces.append(impulse / step)
        state = _moved(state, velocity.reshape(_BODIES, 6), step)
        states.append(state)
    return stacked(states), np.array(forces)


def _moved(state: PairState, velocity: FloatArray, step: float) -> PairState:
    """The state after a step in s with a velocity (2, 6)."""
    spin = np.concatenate((velocity[:, 3:], np.zeros((_BODIES, 1))), axis=1)
    turn = state.turn_xyzw + 0.5 * step * rotations.multiply(spin, state.turn_xyzw)
    centre = state.centre + step * velocity[:, :3]
    return PairState(centre, rotations.normalised(turn), velocity)


def move_pair(
    bodies: Sequence[JointedBody], start: PairState, times: FloatArray, gravity: float
) -> PairState:
    """The motion in continuous time, at times (t,) in s: Runge and Kutta's, a step a time.

    The joint keeps together by the acceleration alone, whose drift is of fourth order.
    """
    state, states = _joined(start), [start]
    for step in np.diff(times).tolist():
        first = _rate(bodies, state, gravity)
        second = _rate(bodies, state + 0.5 * step * first, gravity)
        third = _rate(bodies, state + 0.5 * step * second, gravity)
        fourth = _rate(bodies, state + step * third, gravity)
        state = state + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        states.append(_parted(state))
    return stacked(states)


def _rate(bodies: Sequence[JointedBody], numbers: FloatArray, gravity: float) -> FloatArray:
    """The rate (26,) of a state's numbers: `dq/dt = w q / 2`."""
    state = _parted(numbers)
    equations = make_equations(bodies, state, gravity)
    acceleration, _ = equations.solve(equations.force - equations.bias, -equations.drift)
    spin = np.concatenate((state.velocity[:, 3:], np.zeros((_BODIES, 1))), axis=1)
    turning = 0.5 * rotations.multiply(spin, numbers[6:14].reshape(_BODIES, 4))
    return np.concatenate((state.velocity[:, :3].reshape(-1), turning.reshape(-1), acceleration))


def _joined(state: PairState) -> FloatArray:
    parts = (state.centre, state.turn_xyzw, state.velocity)
    return np.concatenate([part.reshape(-1) for part in parts])


def _parted(numbers: FloatArray) -> PairState:
    turn = rotations.normalised(numbers[6:14].reshape(_BODIES, 4))
    return PairState(numbers[:6].reshape(_BODIES, 3), turn, numbers[14:].reshape(_BODIES, 6))


def stacked(states: Sequence[PairState]) -> PairState:
    """States at t times as one, whose arrays have a first axis of t."""
    return PairState(
        np.array([state.centre for state in states]),
        np.array([state.turn_xyzw for state in states]),
        np.array([state.velocity for state in states]),
    )


def gaps(bodies: Sequence[JointedBody], motion: PairState) -> FloatArray:
    """How far (t,) the joint is apart, m."""
    arms = rotations.rotate(motion.turn_xyzw, np.array([body.arm for body in bodies]))
    points = motion.centre + arms
    apart: FloatArray = np.linalg.norm(points[:, 0] - points[:, 1], axis=1)
    return apart
