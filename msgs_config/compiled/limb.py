"""Where the end of a limb is, and the turns of its joints that bring it somewhere.

Inverse kinematics by damped least squares: a step of the joints is `J^T (J J^T + d^2 I)^-1 e`, with
e what the end is off and J its Jacobian (Wampler 1986; Nakamura and Hanafusa 1986). The number of
steps is fixed, so the joints are a smooth function of where the end is to be; a limb that is too
short stretches towards it.
"""

import math
from typing import NamedTuple

import numpy as np

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.compiled import linear
from msgs_config.compiled.decorator import compiled
from msgs_config.compiled.rotations import axes, exp, product, rotation_vector, to_parent
from msgs_config.geometry import scalars
from msgs_config.geometry.scalars import Quaternion, Vector

_STEPS = 8
_DAMPING = 0.06  # m
_LEVER = 0.2  # m: a rad of the end counts as so much

FIXED, HINGE, SLIDER, BALL = 0, 1, 2, 3
"""Kinds of a limb's joints."""

_cross = compiled(scalars.cross)


class Limb(NamedTuple):
    """The links from a base, whose frame it is in, to an end, and their joints."""

    kinds: IntArray  # (m,)
    places: FloatArray  # (m, 3) of each link in the one before, m
    turns: FloatArray  # (m, 4) xyzw, likewise
    axes: FloatArray  # (m, 3) of hinges and sliders, in their own link
    lower: FloatArray  # (m,) bounds of hinges and sliders, rad or m
    upper: FloatArray  # (m,)
    directions: int  # that count: 6, or 3 where the end's orientation is left free


@compiled
def _joint(limb: Limb, joints: FloatArray, k: int) -> tuple[Vector, Quaternion]:
    """The place and turn of a link in the one before, as its joint stands."""
    place = (limb.places[k, 0], limb.places[k, 1], limb.places[k, 2])
    turn = (limb.turns[k, 0], limb.turns[k, 1], limb.turns[k, 2], limb.turns[k, 3])
    x, y, z = limb.axes[k]
    if limb.kinds[k] == BALL:
        turn = product(turn, (joints[k, 0], joints[k, 1], joints[k, 2], joints[k, 3]))
    elif limb.kinds[k] == HINGE:
        angle = joints[k, 0]
        turn = product(turn, exp((angle * x, angle * y, angle * z)))
    elif limb.kinds[k] == SLIDER:
        way = joints[k, 0]
        a, b, c = to_parent(axes(turn), (way * x, way * y, way * z))
        place = (place[0] + a, place[1] + b, place[2] + c)
    return place, turn


@compiled
def find_frames(limb: Limb, joints: FloatArray, frames: FloatArray) -> None:
    """Write the frames (m, 7) of all links in the base's: places, turns xyzw.

    A hinge's or slider's position stands first in its row of `joints` (m, 4), of a ball its xyzw.
    """
    place, turn = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
    for k in range(len(limb.kinds)):
        own_place, own_turn = _joint(limb, joints, k)
        x, y, z = to_parent(axes(turn), own_place)
        place, turn = (place[0] + x, place[1] + y, place[2] + z), product(turn, own_turn)
        frames[k, 0], frames[k, 1], frames[k, 2] = place
        frames[k, 3], frames[k, 4], frames[k, 5], frames[k, 6] = turn


@compiled
def reach(limb: Limb, joints: FloatArray, end: FloatArray) -> None:
    """Move joints (m, 4) so that the last link is at `end` (7,), in the base's frame."""
    frames, error = np.empty((len(limb.kinds), 7)), np.empty((limb.directions, 1))
    columns = np.zeros((limb.directions, 3 * len(limb.kinds)))
    for _ in range(_STEPS):
        find_frames(limb, joints, frames)
        _write_error(error, frames[-1], end)
        _write_jacobian(columns, limb, frames)
        share = linear.solve(linear.gram(columns), _DAMPING * _DAMPING, error)[:, 0]
        _move(limb, joints, linear.times(columns.T.copy(), share))


@compiled
def _write_error(error: FloatArray, here: FloatArray, end: FloatArray) -> None:
    """Write what a frame (7,) is off (d, 1), in the base's axes."""
    for i in range(3):
        error[i, 0] = end[i] - here[i]
    if len(error) == 6:
        back = (-here[3], -here[4], -here[5], here[6])
        turn = rotation_vector(product((end[3], end[4], end[5], end[6]), back))
        for i in range(3):
            error[3 + i, 0] = _LEVER * turn[i]


@compiled
def _write_jacobian(columns: FloatArray, limb: Limb, frames: FloatArray) -> None:
    """Write how the end moves (d, 3m) as joints do: three columns each, a ball's own axes."""
    end = frames[-1]
    for k in range(len(limb.kinds)):
        kind, here = limb.kinds[k], frames[k]
        turn = axes((here[3], here[4], here[5], here[6]))
        arm = (end[0] - here[0], end[1] - here[1], end[2] - here[2])
        for i in range(3 if kind == BALL else (0 if kind == FIXED else 1)):
            unit = (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)
            if kind != BALL:
                unit = (limb.axes[k, 0], limb.axes[k, 1], limb.axes[k, 2])
            axis = to_parent(turn, unit)
            moved = axis if kind == SLIDER else _cross(axis, arm)
            for j in range(3):
                columns[j, 3 * k + i] = moved[j]
                if len(columns) == 6:
                    columns[3 + j, 3 * k + i] = 0.0 if kind == SLIDER else _LEVER * axis[j]


@compiled
def _move(limb: Limb, joints: FloatArray, step: FloatArray) -> None:
    """Move joints by a step (3m,), hinges and sliders within their bounds."""
    for k in range(len(limb.kinds)):
        if limb.kinds[k] == BALL:
            turn = (joints[k, 0], joints[k, 1], joints[k, 2], joints[k, 3])
            a, b, c, d = product(turn, exp((step[3 * k], step[3 * k + 1], step[3 * k + 2])))
            size = math.sqrt(a * a + b * b + c * c + d * d)
            joints[k, 0], joints[k, 1] = a / size, b / size
            joints[k, 2], joints[k, 3] = c / size, d / size
        elif limb.kinds[k] != FIXED:
            moved = joints[k, 0] + step[3 * k]
            joints[k, 0] = min(max(moved, limb.lower[k]), limb.upper[k])
