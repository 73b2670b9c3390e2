"""Poses whose links are where they are wanted: weighted least squares within joint limits.

What is least is the sum over wanted places of `w r(e)`, with e what a place is off and r a square
that turns linear far away (the pseudo-Huber loss, Charbonnier et al. 1994), and of `m d^2`, with d
how far a coordinate is from that of a given pose. Each step is one of Levenberg and Marquardt's,
taken if it makes the sum less (Marquardt 1963); coordinates at a limit that would leave it stay out
of it (Bertsekas 1982, "Projected Newton methods", section 2). So a place that is out of reach draws
as strongly as one just beyond, and the pose comes to rest.

Three rounds follow each other, in each of which links that are to stay weigh more, and the given
pose less: the first finds the way, the last leaves no error of what can be had.

Coordinates are those of `msgs_config.compiled.kinematics`.
"""

import math
from typing import NamedTuple

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.compiled import linear
from msgs_config.compiled.decorator import compiled
from msgs_config.compiled.kinematics import (
    BALL,
    FLOATING,
    Body,
    find_frames,
    point_of,
    write_jacobian,
)
from msgs_config.compiled.rotations import product, rotation_vector

_HELD = np.array((1e2, 1e3, 1e4))  # weight of links that stay, by round
_NEAR = np.array((1e-3, 1e-5, 1e-8))  # m^2/rad^2: weight of the given pose, by round
_STEPS = 80  # in each round
_LINEAR_FROM_M = 0.3  # m off, from which on a place draws little more
_SMALLEST_STEP = 1e-9  # rad or m
_LEAST_GAIN = 1e-9  # of the sum, by which a step must make it less for another one to follow
_LEAST_DAMPING, _FIRST_DAMPING, _MOST_DAMPING = 1e-8, 1e-2, 1e6
_DAMPING_UP, _DAMPING_DOWN = 4.0, 0.2


class Wanted(NamedTuple):
    """Where points of links, and links themselves, are to be."""

    links: IntArray  # (t,)
    points: FloatArray  # (t, 3) in their links, m
    places: FloatArray  # (t, 3) in the world, m
    turns: FloatArray  # (t, 4) xyzw of the links in the world
    place_weights: FloatArray  # (t,)
    turn_weights: FloatArray  # (t,) m^2/rad^2; 0 where the turn is left free
    held: BoolArray  # (t,) which of them are links that stay


class Freedom(NamedTuple):
    """Which coordinates move, how far, and from where."""

    bases: FloatArray  # (l, 4) xyzw of each joint's base rotation
    near: FloatArray  # (n,) the coordinates of the given pose
    lower: FloatArray  # (n,)
    upper: FloatArray  # (n,)
    longest: FloatArray  # (l,) rad: bound of the length of each joint's rotation vector
    free: BoolArray  # (n,)
    metric: FloatArray  # (n,) what the square of a coordinate's change counts
    units: FloatArray  # (n,) likewise, in how far a step goes: 1 a rad^2, and more a m^2


@compiled
def find_errors(wanted: Wanted, frames: FloatArray, errors: FloatArray) -> None:
    """Write what each wanted place and turn is off (t, 6): m, and rad where it matters."""
    for t in range(len(wanted.links)):
        link = wanted.links[t]
        x, y, z = point_of(frames, link, wanted.points[t])
        errors[t, 0], errors[t, 1] = wanted.places[t, 0] - x, wanted.places[t, 1] - y
        errors[t, 2], errors[t, 3], errors[t, 4], errors[t, 5] = (
            wanted.places[t, 2] - z,
            0.0,
            0.0,
            0.0,
        )
        if wanted.turn_weights[t] > 0.0:
            here, end = frames[link], wanted.turns[t]
            back = (-here[3], -here[4], -here[5], here[6])
            turn = rotation_vector(product((end[0], end[1], end[2], end[3]), back))
            errors[t, 3], errors[t, 4], errors[t, 5] = turn


@compiled
def _off(errors: FloatArray, wanted: Wanted, t: int) -> tuple[float, float]:
    """Squares of what one wanted place and turn are off; m^2, the turn as its weight has it."""
    x, y, z, a, b, c = errors[t]
    return x * x + y * y + z * z, (a * a + b * b + c * c) * wanted.turn_weights[t]


@compiled
def _loss(
    wanted: Wanted, errors: FloatArray, q: FloatArray, freedom: Freedom, held: float, near: float
) -> float:
    """The sum that is made least."""
    loss, unit = 0.0, _LINEAR_FROM_M * _LINEAR_FROM_M
    for t in range(len(wanted.links)):
        place, turn = _off(errors, wanted, t)
        square = wanted.place_weights[t] * place + turn
        if wanted.held[t]:
            loss += held * square
        else:
            loss += 2.0 * unit * (math.sqrt(1.0 + square / unit) - 1.0)
    for i in range(len(q)):
        change = q[i] - freedom.near[i]
        loss += near * freedom.metric[i] * change * change
    return loss


@compiled
def _share(wanted: Wanted, errors: FloatArray, t: int, held: float) -> float:
    """How much the square of what is off counts at the present error."""
    if wanted.held[t]:
        return held
    place, turn = _off(errors, wanted, t)
    square = wanted.place_weights[t] * place + turn
    return 1.0 / math.sqrt(1.0 + square / (_LINEAR_FROM_M * _LINEAR_FROM_M))


@compiled
def _linearise(
    body: Body,
    wanted: Wanted,
    frames: FloatArray,
    errors: FloatArray,
    q: FloatArray,
    held: float,
    columns: FloatArray,
    rest: FloatArray,
) -> None:
    """Write the weighted Jacobian (n, 6 t) of what is wanted, and what is off (6 t,)."""
    columns[:] = 0.0
    for t in range(len(wanted.links)):
        root = math.sqrt(_share(wanted, errors, t, held))
        place = root * math.sqrt(wanted.place_weights[t])
        turn = root * math.sqrt(wanted.turn_weights[t])
        block = columns[:, 6 * t : 6 * t + 6]
        write_jacobian(body, frames, q, wanted.links[t], wanted.points[t], place, turn, block)
        for j in range(3):
            rest[6 * t + j] = place * errors[t, j]
            rest[6 * t + 3 + j] = turn * errors[t, 3 + j]


@compiled
def _step(
    columns: FloatArray,
    pull: FloatArray,
    q: FloatArray,
    freedom: Freedom,
    near: float,
    products: FloatArray,
    damping: float,
) -> FloatArray:
    """A damped step (n,) along what moves: the others, and those at a limit, stay."""
    moving, count = np.empty(len(q), dtype=np.intp), 0
    for i in range(len(q)):
        is_outward = (pull[i] > 0.0 and q[i] >= freedom.upper[i]) or (
            pull[i] < 0.0 and q[i] <= freedom.lower[i]
        )
        if freedom.free[i] and not is_outward:
            moving[count] = i
            count += 1
    matrix, right = np.empty((count, count)), np.empty((count, 1))
    for i in range(count):
        row = moving[i]
        for j in range(count):
            matrix[i, j] = products[row, moving[j]]
        matrix[i, i] += near * freedom.metric[row] + damping * freedom.units[row]
        right[i, 0] = pull[row]
    solution, step = linear.solve(matrix, 0.0, right), np.zeros(len(q))
    for i in range(count):
        step[moving[i]] = solution[i, 0]
    return step


@compiled
def _move(body: Body, q: FloatArray, step: FloatArray, freedom: Freedom) -> FloatArray:
    """The coordinates (n,) after a step (n,), within their limits."""
    moved = np.empty(len(q))
    for i in range(len(q)):
        moved[i] = min(max(q[i] + step[i], freedom.lower[i]), freedom.upper[i])
    for k in range(len(body.kinds)):
        kind = body.kinds[k]
        if kind in (BALL, FLOATING):
            i = body.starts[k] + (3 if kind == FLOATING else 0)
            length = math.sqrt(
                moved[i] * moved[i] + moved[i + 1] * moved[i + 1] + moved[i + 2] * moved[i + 2]
            )
            if length > freedom.longest[k]:
                for j in range(3):
                    moved[i + j] *= freedom.longest[k] / length
    for f in range(len(body.followers)):
        if freedom.free[body.leaders[f]]:
            moved[body.followers[f]] = body.ratios[f] * moved[body.leaders[f]] + body.shifts[f]
    return moved


@compiled
def _largest(step: FloatArray) -> float:
    largest = 0.0
    for i in range(len(step)):
        largest = max(largest, abs(step[i]))
    return largest


@compiled
def fit(body: Body, wanted: Wanted, freedom: Freedom, q: FloatArray) -> int:
    """Move coordinates (n,) to where what is wanted is off least; the number of steps tried."""
    frames, errors = np.empty((len(body.kinds), 7)), np.empty((len(wanted.links), 6))
    columns, rest = np.empty((len(q), errors.size)), np.empty(errors.size)
    tried = 0
    for stage in range(len(_HELD)):
        held, near, damping = _HELD[stage], _NEAR[stage], _FIRST_DAMPING
        find_frames(body, freedom.bases, q, frames)
        find_errors(wanted, frames, errors)
        loss, is_new = _loss(wanted, errors, q, freedom, held, near), True
        products, pull = np.empty((0, 0)), np.empty(0)
        for _ in range(_STEPS):
            tried += 1
            if is_new:
                _linearise(body, wanted, frames, errors, q, held, columns, rest)
                products = linear.gram(columns)
                pull = linear.times(columns, rest)
                pull -= near * freedom.metric * (q - freedom.near)
            step = _step(columns, pull, q, freedom, near, products, damping)
            moved = _move(body, q, step, freedom)
            find_frames(body, freedom.bases, moved, frames)
            find_errors(wanted, frames, errors)
            found = _loss(wanted, errors, moved, freedom, held, near)
            is_new = found < loss
            if is_new:
                is_settled = loss - found < _LEAST_GAIN * loss
                is_settled = is_settled or _largest(moved - q) < _SMALLEST_STEP
                loss, damping = found, max(_DAMPING_DOWN * damping, _LEAST_DAMPING)
                q[:] = moved
                if is_settled:
                    break
            else:
                damping *= _DAMPING_UP
                if damping > _MOST_DAMPING or _largest(step) < _SMALLEST_STEP:
                    break
    return tried
