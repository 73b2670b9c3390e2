"""The soft limits in plain Python, entry by entry: what the compiled ones must equal to the bit."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character, SoftLimit
from msgs_config.geometry import fixed_order, scalars
from msgs_config.geometry.scalars import Vector

_MOST_PIVOTS = 50
_FORCE_ROUNDING = 1e-12  # share of a force that may be wrong without consequence


def soft_limit_effort(
    character: Character,
    model: DynamicsModel,
    step_s: float,
    position: FloatArray,
    velocity: FloatArray,
) -> FloatArray:
    """The effort (n,) of the soft limits in a state, each (n,), over an engine's step."""
    effort: FloatArray = np.zeros(len(velocity))
    bounds, rows = [], []
    for joint in character.moving_joints:
        entries = character.layout.joint(joint.name).entries
        turn, spin = position[entries].tolist(), velocity[entries].tolist()
        if joint.soft_limit is None or not _is_near(joint.soft_limit, turn, spin, step_s):
            continue
        for bound in _passed_bounds(joint.soft_limit, turn, spin, step_s):
            bounds.append(bound)
            rows.append(np.zeros(len(effort)))
            rows[-1][entries] = bound.row
    if bounds:
        model.update(position, velocity)
        jacobian = np.array(rows)
        forces = _complementary_forces(bounds, model.delassus_matrix(jacobian))
        effort -= fixed_order.apply(jacobian.T, forces)
    return effort


def _is_near(limit: SoftLimit, turn: Sequence[float], spin: Sequence[float], step_s: float) -> bool:
    u, v, w = spin
    reach = 2.0 * step_s * math.sqrt(u * u + v * v + w * w)
    return any(
        part < lower + reach or part > upper - reach
        for part, lower, upper in zip(turn, limit.lower, limit.upper, strict=True)
    )


class PassedBound(NamedTuple):
    """A bound of a soft limit that a joint is beyond, or is about to pass."""

    row: Vector  # row of J, outwards: `de/dt = row . w`, w the angular velocity in the child frame
    explicit: float  # N m, the force if nothing yielded
    implicit: float  # N m s^2/rad, what each rad/s^2 of yielding takes away of it


def _passed_bounds(
    limit: SoftLimit, turn: Sequence[float], spin: Sequence[float], step_s: float
) -> Iterator[PassedBound]:
    """The bounds that a joint is beyond, or will be in a step, and that push it back.

    Its rotation vector (3,) in rad, its angular velocity (3,) in the child frame in rad/s.
    """
    turn = _closest_rotation_vector(turn, limit)
    jacobian = scalars.right_jacobian_inverse(turn)
    rates = scalars.to_parent(jacobian, spin)
    for part, rate, row, lower, upper in zip(
        turn, rates, jacobian, limit.lower, limit.upper, strict=True
    ):
        outward = math.copysign(1.0, 2.0 * (part + step_s * rate) - lower - upper)
        excess = outward * (part - (upper if outward > 0.0 else lower))
        following = excess + step_s * outward * rate
        explicit = limit.stiffness * following + limit.damping * outward * rate
        if max(excess, following) > 0.0 and explicit > 0.0:
            across, along, about = row
            yield PassedBound(
                (outward * across, outward * along, outward * about),
                explicit,
                step_s * (limit.stiffness * step_s + limit.damping),
            )


def _closest_rotation_vector(turn: Sequence[float], limit: SoftLimit) -> Sequence[float]:
    """Of a rotation vector (3,) and the longer way round the one nearer to a limit's bounds."""
    x, y, z = turn
    angle = math.sqrt(x * x + y * y + z * z)
    if not angle:
        return turn
    factor = 1.0 - 2.0 * math.pi / angle
    long_way = (factor * x, factor * y, factor * z)
    return long_way if _squared_excess(long_way, limit) < _squared_excess(turn, limit) else turn


def _squared_excess(turn: Sequence[float], limit: SoftLimit) -> float:
    """The squared distance in rad^2 of a rotation vector (3,) from a limit's bounds."""
    square = 0.0
    for part, lower, upper in zip(turn, limit.lower, limit.upper, strict=True):
        beyond = max(part - upper, lower - part, 0.0)
        square += beyond * beyond
    return square


def _complementary_forces(bounds: Sequence[PassedBound], delassus: FloatArray) -> FloatArray:
    """Forces (m,) in N m that push at bounds and never draw: `f = max(0, explicit - implicit A f)`.

    `delassus` (m, m) is A, symmetrical: the accelerations that a unit of each force leads to. With
    all bounds pushing it is one linear system. A bound that would draw leaves it, one that lacks a
    push enters, the first such one at a time: that finds the one solution (Murty 1974, "Note on a
    Bard-type Scheme for Solving the Complementarity Problem").
    """
    coupling = [
        [bound.implicit * entry for entry in row]
        for bound, row in zip(bounds, delassus.tolist(), strict=True)
    ]
    pushing = [True] * len(bounds)
    forces = [0.0] * len(bounds)
    for _ in range(_MOST_PIVOTS):
        forces = _forces_of(bounds, coupling, pushing)
        for number, bound in enumerate(bounds):
            if pushing[number]:
                wrong = forces[number] < 0.0
            else:
                yielded = _dot(coupling[number], forces)
                wrong = bound.explicit - yielded > _FORCE_ROUNDING * bound.explicit
            if wrong:
                pushing[number] = not pushing[number]
                break
        else:
            break
    return np.maximum(forces, 0.0)


def _forces_of(
    bounds: Sequence[PassedBound], coupling: Sequence[Sequence[float]], pushing: Sequence[bool]
) -> list[float]:
    """The forces of the bounds that push, `(1 + coupling) f = explicit`; the others' are zero.

    By elimination; the matrix is similar to a positive definite one, so no pivots are looked for.
    """
    chosen = [number for number, pushes in enumerate(pushing) if pushes]
    rows = [[coupling[i][j] + (i == j) for j in chosen] + [bounds[i].explicit] for i in chosen]
    for place, row in enumerate(rows):
        for other in rows[place + 1 :]:
            share = other[place] / row[place]
            for column in range(place + 1, len(row)):
                other[column] -= share * row[column]
    forces = [0.0] * len(bounds)
    for place in range(len(chosen) - 1, -1, -1):
        row = rows[place]
        known = row[-1]
        for later in range(place + 1, len(chosen)):
            known -= row[later] * forces[chosen[later]]
        forces[chosen[place]] = known / row[place]
    return forces


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    product = 0.0
    for one, other in zip(a, b, strict=True):
        product += one * other
    return product
