"""Where the links of a whole character are, and how they move with its coordinates.

Coordinates are entries of a layout: hinges in rad, sliders and the root's place in m, and a
rotation as the rotation vector, rad, of what follows its base rotation.
"""

import math
from typing import NamedTuple

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.compiled.decorator import compiled
from msgs_config.compiled.rotations import axes, exp, product, to_parent
from msgs_config.geometry import scalars
from msgs_config.geometry.scalars import Axes, Quaternion, Vector

FIXED, HINGE, SLIDER, BALL, FLOATING = 0, 1, 2, 3, 4
"""Kinds of joints."""

_SMALL_ANGLE = 1e-4  # rad

_cross = compiled(scalars.cross)


class Body(NamedTuple):
    """Links, each after its parent, and the joints to their parents."""

    parents: IntArray  # (l,) -1 of the base
    kinds: IntArray  # (l,)
    starts: IntArray  # (l,) first coordinate of each joint
    places: FloatArray  # (l, 3) of each link in its parent, m
    turns: FloatArray  # (l, 4) xyzw of each link in its parent
    axes: FloatArray  # (l, 3) of hinges and sliders, in their own link
    followers: IntArray  # (f,) coordinates that are `ratio * leader + shift`
    leaders: IntArray  # (f,)
    ratios: FloatArray  # (f,)
    shifts: FloatArray  # (f,) rad or m


@compiled
def _local(body: Body, bases: FloatArray, q: FloatArray, k: int) -> tuple[Vector, Quaternion]:
    """The place and turn of a link in its parent, as its joint stands."""
    place = (body.places[k, 0], body.places[k, 1], body.places[k, 2])
    turn = (body.turns[k, 0], body.turns[k, 1], body.turns[k, 2], body.turns[k, 3])
    kind, i = body.kinds[k], body.starts[k]
    x, y, z = body.axes[k]
    if kind == HINGE:
        turn = product(turn, exp((q[i] * x, q[i] * y, q[i] * z)))
    elif kind == SLIDER:
        a, b, c = to_parent(axes(turn), (q[i] * x, q[i] * y, q[i] * z))
        place = (place[0] + a, place[1] + b, place[2] + c)
    elif kind in (BALL, FLOATING):
        if kind == FLOATING:
            place, i = (q[i], q[i + 1], q[i + 2]), i + 3
        base = (bases[k, 0], bases[k, 1], bases[k, 2], bases[k, 3])
        turn = product(turn, product(base, exp((q[i], q[i + 1], q[i + 2]))))
    return place, turn


@compiled
def find_frames(body: Body, bases: FloatArray, q: FloatArray, frames: FloatArray) -> None:
    """Write the frames (l, 7) of all links in the world, at coordinates (n,): places, turns xyzw.

    `bases` (l, 4) are the base rotations of the joints.
    """
    for k in range(len(body.kinds)):
        place, turn = _local(body, bases, q, k)
        parent = body.parents[k]
        if parent >= 0:
            above = frames[parent]
            outer = (above[3], above[4], above[5], above[6])
            x, y, z = to_parent(axes(outer), place)
            place, turn = (above[0] + x, above[1] + y, above[2] + z), product(outer, turn)
        frames[k, 0], frames[k, 1], frames[k, 2] = place
        frames[k, 3], frames[k, 4], frames[k, 5], frames[k, 6] = turn


@compiled
def point_of(frames: FloatArray, link: int, point: FloatArray) -> Vector:
    """A point (3,) of a link in the world, m."""
    here = frames[link]
    turn = axes((here[3], here[4], here[5], here[6]))
    x, y, z = to_parent(turn, (point[0], point[1], point[2]))
    return here[0] + x, here[1] + y, here[2] + z


@compiled
def _turning_axes(frame: FloatArray, q: FloatArray, i: int) -> Axes:
    """The axes in the world about which a link turns as its rotation vector's entries grow.

    They are columns of `R J`, with J the right Jacobian of SO(3): Solà, Deray and Atchuthan 2018,
    "A micro Lie theory", equation 143.
    """
    r = (q[i], q[i + 1], q[i + 2])
    square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    angle = math.sqrt(square)
    if angle < _SMALL_ANGLE:
        a, b = 0.5, 1.0 / 6.0
    else:
        a, b = (1.0 - math.cos(angle)) / square, (angle - math.sin(angle)) / (square * angle)
    turn = axes((frame[3], frame[4], frame[5], frame[6]))
    columns = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for j in range(3):
        unit = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        once = _cross(r, unit)
        twice = _cross(r, once)
        column = to_parent(
            turn,
            (
                unit[0] - a * once[0] + b * twice[0],
                unit[1] - a * once[1] + b * twice[1],
                unit[2] - a * once[2] + b * twice[2],
            ),
        )
        columns = (
            column if j == 0 else columns[0],
            column if j == 1 else columns[1],
            column if j == 2 else columns[2],
        )
    return columns


@compiled
def _write_column(column: FloatArray, axis: Vector, arm: Vector, place: float, turn: float) -> None:
    """Write how a point and its link move (6,), both weighted, about an axis at `-arm` from it."""
    x, y, z = _cross(axis, arm)
    column[0], column[1], column[2] = place * x, place * y, place * z
    column[3], column[4], column[5] = turn * axis[0], turn * axis[1], turn * axis[2]


@compiled
def write_jacobian(
    body: Body,
    frames: FloatArray,
    q: FloatArray,
    link: int,
    point: FloatArray,
    place_weight: float,
    turn_weight: float,
    columns: FloatArray,
) -> None:
    """Write how a point (3,) of a link and the link itself move with the coordinates: (n, 6).

    Per rad or m of a coordinate, in world axes: m of the point times one weight, rad of the link
    times the other. Coordinates that follow others move these. What the link does not depend on is
    left as it was.
    """
    x, y, z = point_of(frames, link, point)
    k = link
    while k >= 0:
        kind, i, here = body.kinds[k], body.starts[k], frames[k]
        arm = (x - here[0], y - here[1], z - here[2])
        if kind in (HINGE, SLIDER):
            own = (body.axes[k, 0], body.axes[k, 1], body.axes[k, 2])
            axis = to_parent(axes((here[3], here[4], here[5], here[6])), own)
            if kind == HINGE:
                _write_column(columns[i], axis, arm, place_weight, turn_weight)
            else:
                for j in range(3):
                    columns[i, j] = place_weight * axis[j]
        elif kind in (BALL, FLOATING):
            if kind == FLOATING:
                for j in range(3):
                    columns[i + j, j] = place_weight
                i += 3
            turning = _turning_axes(here, q, i)
            for j in range(3):
                _write_column(columns[i + j], turning[j], arm, place_weight, turn_weight)
        k = body.parents[k]
    for f in range(len(body.followers)):
        columns[body.leaders[f]] += body.ratios[f] * columns[body.followers[f]]
        columns[body.followers[f]] = 0.0
