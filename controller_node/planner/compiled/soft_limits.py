"""The simulator's soft limits of ball joints (`sim_node.physics.passive_forces`) in compiled code.

Forces f >= 0 against bounds that are passed, implicit in a step h: `f = max(0, e - i A f)` with
`A = J M^-1 J^T`. The equations and their sources are there.
"""

import math
from typing import NamedTuple

from controller_node.planner.compiled import mass_matrix
from controller_node.planner.compiled.decorator import compiled
from controller_node.planner.compiled.mass_matrix import MassMatrix
from controller_node.planner.compiled.rotations import (
    quaternion,
    right_jacobian_inverse,
    rotation_vector,
    to_parent,
)
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.geometry.scalars import Quaternion, Vector

MOST_BOUNDS = 32
"""More that are passed at once are left out."""

_MOST_PIVOTS = 50
_ROUNDING = 1e-12


class SoftLimits(NamedTuple):
    """Bounds of k ball joints' rotation vectors."""

    positions: IntArray  # (k,) where each joint's quaternion begins
    velocities: IntArray  # (k,) where its angular velocity begins
    lower: FloatArray  # (k, 3) rad
    upper: FloatArray  # (k, 3) rad
    free: FloatArray  # (k,) rad, angle of the smallest turn that reaches a bound
    stiffness: FloatArray  # (k,) N m/rad
    damping: FloatArray  # (k,) N m s/rad


class PassedBounds(NamedTuple):
    """Room for the bounds that are passed in a step, and for what follows of them."""

    rows: FloatArray  # (m, n) of J, outwards
    explicit: FloatArray  # (m,) N m, the force if nothing yielded
    implicit: FloatArray  # (m,) N m s^2/rad, what each rad/s^2 of yielding takes away of it
    coupling: FloatArray  # (m, m) the implicit share times A
    system: FloatArray  # (m, m + 1)
    forces: FloatArray  # (m,) N m
    pushing: BoolArray  # (m,)
    chosen: IntArray  # (m,)
    column: FloatArray  # (n,)


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

    `mass` is the mass matrix in the state, factorised.
    """
    count = 0
    for joint in range(len(limits.positions)):
        count = _find_passed(joint, position, velocity, period, limits, room, count)
    if not count:
        return
    _couple(count, mass, room)
    _find_forces(count, room)
    for bound in range(count):
        force = max(room.forces[bound], 0.0)
        for entry in range(len(effort)):
            effort[entry] -= force * room.rows[bound, entry]


@compiled
def _find_passed(
    joint: int,
    position: FloatArray,
    velocity: FloatArray,
    period: float,
    limits: SoftLimits,
    room: PassedBounds,
    count: int,
) -> int:
    """Add the bounds that a joint is beyond or about to pass; how many there are with them."""
    first = limits.velocities[joint]
    spin = (velocity[first], velocity[first + 1], velocity[first + 2])
    lower, upper = limits.lower[joint], limits.upper[joint]
    turned = quaternion(position, limits.positions[joint])
    reach = 2.0 * period * math.sqrt(spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2])
    if is_less(turned, limits.free[joint] - reach):
        return count
    turn = rotation_vector(turned)
    if not _is_near(turn, lower, upper, reach):
        return count
    turn = _nearer_to(turn, lower, upper)
    jacobian = right_jacobian_inverse(turn)
    rates = to_parent(jacobian, spin)
    stiffness, damping = limits.stiffness[joint], limits.damping[joint]
    for i in range(3):
        if count == MOST_BOUNDS:
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
def _nearer_to(turn: Vector, lower: FloatArray, upper: FloatArray) -> Vector:
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
def _find_forces(count: int, room: PassedBounds) -> None:
    """Find forces that push and never draw, by principal pivoting (Murty 1974)."""
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
    """The forces of the bounds that push, `(1 + coupling) f = explicit`; the others' are zero."""
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
