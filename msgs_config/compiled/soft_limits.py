"""Soft limits of ball joints: forces f >= 0 against bounds that are passed, implicit in a step h.

A soft limit is a spring and a damper outside of bounds on the components of a joint's rotation
vector r. With e the excess of a component over its bound, the force against it is
`f = k e + c de/dt`, and never one that draws it further out. As `dr/dt = J w`, with w the angular
velocity in the child frame and J the inverse of the right Jacobian of SO(3), its torque in the
child frame is `-J^T f`. The spring's potential is `V = k/2 e^2`; the damper only takes energy.

A limb is light, and a spring that stops it in a few degrees is far too stiff to be explicit. So e
and de/dt are those at the end of the engine's step h, with the velocity that the forces lead to:
`f = k (e + h u) + c u`, `u = de/dt - h A f`, where `A = J M^-1 J^T` of all bounds together. That is
stable for any k and c at any h (implicit Euler; as Tan, Liu and Turk 2011 do it for control), and
as h goes to zero it is the law above. Other forces on the limb are not foreseen.

Of the two rotation vectors of a turn, r and the longer way round, the one nearer to the bounds
counts, so that nothing jumps where r does, at an angle of pi.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.model import SoftLimit
from msgs_config.compiled import mass_matrix
from msgs_config.compiled.decorator import compiled
from msgs_config.compiled.mass_matrix import MassMatrix
from msgs_config.compiled.rotations import (
    quaternion,
    right_jacobian_inverse,
    rotation_vector,
    to_parent,
)
from msgs_config.geometry.scalars import Quaternion, Vector

_MOST_PIVOTS = 50
_ROUNDING = 1e-12  # share of a force that may be wrong without consequence


class SoftLimits(NamedTuple):
    """Bounds of k ball joints' rotation vectors."""

    positions: IntArray  # (k,) where each joint begins in a position
    velocities: IntArray  # (k,) where its angular velocity begins
    lower: FloatArray  # (k, 3) rad
    upper: FloatArray  # (k, 3) rad
    free: FloatArray  # (k,) rad, angle of the smallest turn that reaches a bound
    stiffness: FloatArray  # (k,) N m/rad
    damping: FloatArray  # (k,) N m s/rad


class PassedBounds(NamedTuple):
    """Room for m bounds that are passed in a step, and for what follows of them.

    More that are passed at once are left out.
    """

    rows: FloatArray  # (m, n) of J, outwards
    explicit: FloatArray  # (m,) N m, the force if nothing yielded
    implicit: FloatArray  # (m,) N m s^2/rad, what each rad/s^2 of yielding takes away of it
    coupling: FloatArray  # (m, m) the implicit share times A
    system: FloatArray  # (m, m + 1)
    forces: FloatArray  # (m,) N m
    pushing: BoolArray  # (m,)
    chosen: IntArray  # (m,)
    column: FloatArray  # (n,)


def make_soft_limits(
    limits: Sequence[SoftLimit], positions: Sequence[int], velocities: Sequence[int]
) -> SoftLimits:
    """The bounds of joints that begin at these entries of a position and of a velocity."""
    lower = np.array([limit.lower for limit in limits], dtype=float).reshape(-1, 3)
    upper = np.array([limit.upper for limit in limits], dtype=float).reshape(-1, 3)
    return SoftLimits(
        np.array(positions, dtype=np.intp),
        np.array(velocities, dtype=np.intp),
        lower,
        upper,
        np.minimum(-lower, upper).min(axis=1, initial=np.inf),
        np.array([limit.stiffness for limit in limits], dtype=float),
        np.array([limit.damping for limit in limits], dtype=float),
    )


def room_for_bounds(most: int, entries: int) -> PassedBounds:
    """Room for so many passed bounds of a character with n entries."""
    return PassedBounds(
        np.empty((most, entries)),
        np.empty(most),
        np.empty(most),
        np.empty((most, most)),
        np.empty((most, most + 1)),
        np.empty(most),
        np.empty(most, dtype=np.bool_),
        np.empty(most, dtype=np.intp),
        np.empty(entries),
    )


@compiled
def add_soft_limits(
    effort: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    period: float,
    limits: SoftLimits,
    mass: MassMatrix,
    room: PassedBounds,
) -> None:
    """Add to an effort (n,) what the soft limits do in a state, over a period in s.

    `position` (q,) has quaternions wxyz. `mass` is the mass matrix in the state, factorised.
    """
    count = 0
    for joint in range(len(limits.positions)):
        spin = _spin(joint, velocity, limits)
        turned = quaternion(position, limits.positions[joint])
        if not is_less(turned, limits.free[joint] - _reach(spin, period)):
            turn = rotation_vector(turned)
            count = _add_passed(joint, turn, spin, period, limits, room, count)
    find_forces(count, mass, room)
    for bound in range(count):
        force = max(room.forces[bound], 0.0)
        for entry in range(len(effort)):
            effort[entry] -= force * room.rows[bound, entry]


@compiled
def find_passed(
    position: FloatArray,
    velocity: FloatArray,
    period: float,
    limits: SoftLimits,
    room: PassedBounds,
) -> int:
    """Find the bounds that a state is beyond, or will pass in a period in s; how many there are.

    Position (n,) in message form, with rotation vectors.
    """
    count = 0
    for joint in range(len(limits.positions)):
        first = limits.positions[joint]
        turn = (position[first], position[first + 1], position[first + 2])
        spin = _spin(joint, velocity, limits)
        count = _add_passed(joint, turn, spin, period, limits, room, count)
    return count


@compiled
def _spin(joint: int, velocity: FloatArray, limits: SoftLimits) -> Vector:
    first = limits.velocities[joint]
    return velocity[first], velocity[first + 1], velocity[first + 2]


@compiled
def _reach(spin: Vector, period: float) -> float:
    """How far a rotation vector may get in a period: less than twice as far as its joint turns.

    That holds up to two thirds of a turn.
    """
    return 2.0 * period * math.sqrt(spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2])


@compiled
def _add_passed(
    joint: int,
    turn: Vector,
    spin: Vector,
    period: float,
    limits: SoftLimits,
    room: PassedBounds,
    count: int,
) -> int:
    """Add the bounds that a joint is beyond or about to pass; how many there are with them."""
    lower, upper = limits.lower[joint], limits.upper[joint]
    if not _is_near(turn, lower, upper, _reach(spin, period)):
        return count
    turn = nearer_to(turn, lower, upper)
    jacobian = right_jacobian_inverse(turn)
    rates = to_parent(jacobian, spin)
    stiffness, damping = limits.stiffness[joint], limits.damping[joint]
    first = limits.velocities[joint]
    for i in range(3):
        if count == len(room.explicit):
            break
        outward = math.copysign(1.0, 2.0 * (turn[i] + period * rates[i]) - lower[i] - upper[i])
        excess = outward * (turn[i] - (upper[i] if outward > 0.0 else lower[i]))
        following = excess + period * outward * rates[i]
        explicit = stiffness * following + damping * outward * rates[i]
        if max(excess, following) > 0.0 and explicit > 0.0:
            room.rows[count, :] = 0.0
            for j in range(3):
                room.rows[count, first + j] = outward * jacobian[i][j]
            room.explicit[count] = explicit
            room.implicit[count] = period * (stiffness * period + damping)
            count += 1
    return count


@compiled
def is_less(turn_xyzw: Quaternion, angle: float) -> bool:
    """Whether a turn is surely less than an angle in rad: quick, by sin x >= x - x^3 / 6."""
    x, y, z, _ = turn_xyzw
    half = min(0.499 * angle, 1.0)
    sine = half - half * half * half / 6.0
    return half > 0.0 and x * x + y * y + z * z < sine * sine


@compiled
def _is_near(turn: Vector, lower: FloatArray, upper: FloatArray, reach: float) -> bool:
    near = False
    for i in range(3):
        near |= turn[i] < lower[i] + reach or turn[i] > upper[i] - reach
    return near


@compiled
def nearer_to(turn: Vector, lower: FloatArray, upper: FloatArray) -> Vector:
    """Of a rotation vector and the longer way round the one nearer to the bounds."""
    x, y, z = turn
    angle = math.sqrt(x * x + y * y + z * z)
    if angle == 0.0:
        return turn
    factor = 1.0 - 2.0 * math.pi / angle
    long_way = (factor * x, factor * y, factor * z)
    nearer = _squared_excess(long_way, lower, upper) < _squared_excess(turn, lower, upper)
    return long_way if nearer else turn


@compiled
def _squared_excess(turn: Vector, lower: FloatArray, upper: FloatArray) -> float:
    square = 0.0
    for i in range(3):
        beyond = max(turn[i] - upper[i], lower[i] - turn[i], 0.0)
        square += beyond * beyond
    return square


@compiled
def find_forces(count: int, mass: MassMatrix, room: PassedBounds) -> None:
    """Find the forces, not negative but for rounding, of so many bounds that were passed.

    `mass` is the mass matrix in the state, factorised.
    """
    if count:
        _couple(count, mass, room)
        find_complementary_forces(count, room)


@compiled
def find_effort(effort: FloatArray, count: int, mass: MassMatrix, room: PassedBounds) -> None:
    """Find the effort (n,) of so many bounds that were passed, N m.

    `mass` is the mass matrix in the state, which is factorised here.
    """
    mass_matrix.factorise(mass)
    find_forces(count, mass, room)
    for entry in range(len(effort)):
        pushed = 0.0
        for bound in range(count):
            pushed += room.rows[bound, entry] * max(room.forces[bound], 0.0)
        effort[entry] = 0.0 - pushed


@compiled
def _couple(count: int, mass: MassMatrix, room: PassedBounds) -> None:
    """Work out how the bounds' forces take from each other: the implicit share times A."""
    for j in range(count):
        mass_matrix.solve(mass, room.rows[j], room.column)
        for i in range(count):
            entry = 0.0
            for k in range(len(room.column)):
                entry += room.rows[i, k] * room.column[k]
            room.coupling[i, j] = room.implicit[i] * entry


@compiled
def find_complementary_forces(count: int, room: PassedBounds) -> None:
    """Find forces that push and never draw: `f = max(0, explicit - coupling f)`.

    With all bounds pushing it is one linear system. A bound that would draw leaves it, one that
    lacks a push enters, the first such one at a time: that finds the one solution (Murty 1974,
    "Note on a Bard-type Scheme for Solving the Complementarity Problem").
    """
    room.pushing[:count] = True
    for _ in range(_MOST_PIVOTS):
        _solve_for_pushing(count, room)
        wrong = _first_wrong(count, room)
        if wrong < 0:
            return
        room.pushing[wrong] = not room.pushing[wrong]


@compiled
def _first_wrong(count: int, room: PassedBounds) -> int:
    """The first bound that draws, or that lacks a push; -1 if there is none."""
    for i in range(count):
        if room.pushing[i]:
            if room.forces[i] < 0.0:
                return i
        else:
            yielded = 0.0
            for j in range(count):
                yielded += room.coupling[i, j] * room.forces[j]
            if room.explicit[i] - yielded > _ROUNDING * room.explicit[i]:
                return i
    return -1


@compiled
def _solve_for_pushing(count: int, room: PassedBounds) -> None:
    """The forces of the bounds that push, `(1 + coupling) f = explicit`; the others' are zero.

    By elimination; the matrix is similar to a positive definite one, so no pivots are looked for.
    """
    size, system = 0, room.system
    for i in range(count):
        room.forces[i] = 0.0
        if room.pushing[i]:
            room.chosen[size] = i
            size += 1
    for i in range(size):
        for j in range(size):
            system[i, j] = room.coupling[room.chosen[i], room.chosen[j]]
        system[i, i] += 1.0
        system[i, size] = room.explicit[room.chosen[i]]
    for i in range(size):
        for k in range(i + 1, size):
            share = system[k, i] / system[i, i]
            for j in range(i + 1, size + 1):
                system[k, j] -= share * system[i, j]
    for i in range(size - 1, -1, -1):
        known = system[i, size]
        for j in range(i + 1, size):
            known -= system[i, j] * room.forces[room.chosen[j]]
        room.forces[room.chosen[i]] = known / system[i, i]
