"""The pieces of a terrain: boxes on the plane z = 0, upright or tilted, and meshes.

Each piece begins at its own origin and goes on along its own x axis; y is to the left of that.
Lengths are in m, angles in rad.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from msgs_config.random_words import random_words

_SLAB = 0.2  # m: thickness of what is tilted


@dataclass(frozen=True)
class Block:
    """A box, or a mesh."""

    size: tuple[float, float, float]  # edges in m; of a mesh factors
    place: tuple[float, float, float]  # of a box's middle, or a mesh's origin, m
    pitch: float = 0.0  # about its y axis, rad: what rises along x has a negative one
    yaw: float = 0.0  # about z, after that, rad
    mesh: str = ""  # path of a file


def stairs(
    steps: int, rise: float, tread: float, width: float, landing: float, *, leads_down: bool
) -> list[Block]:
    """Stairs up to a landing, beyond their last step, and down again if they lead there."""
    top = steps * tread + landing
    edges = [(step * tread, (step + 1) * tread, (step + 1) * rise) for step in range(steps - 1)]
    edges.append(((steps - 1) * tread, top, steps * rise))
    if leads_down:
        edges += [
            (top + step * tread, top + (step + 1) * tread, (steps - 1 - step) * rise)
            for step in range(steps - 1)
        ]
    return [_column(*each, width) for each in edges]


def slope(
    angle: float, length: float, width: float, landing: float, *, leads_down: bool
) -> list[Block]:
    """A slope up, whose length is horizontal, to a landing, and down again if it leads there."""
    height, top = length * math.tan(angle), length + landing
    blocks = [_slab((0.0, 0.0), angle, length, width)]
    if landing > 0.0:
        blocks.append(_column(length, top, height, width))
    if leads_down:
        blocks.append(_slab((top, height), -angle, length, width))
    return blocks


def squares(rows: Sequence[Sequence[float]], edge: float) -> list[Block]:
    """Squares of different heights: a row along y, from right to left, for each step along x.

    Equal neighbours in a row are one box; there is none where the height is 0.
    """
    blocks = []
    for number, row in enumerate(rows):
        end = -0.5 * len(row) * edge
        for height, equal in groupby(row):
            begin, end = end, end + len(list(equal)) * edge
            if height > 0.0:
                middle = ((number + 0.5) * edge, 0.5 * (begin + end), 0.5 * height)
                blocks.append(Block((edge, end - begin, height), middle))
    return blocks


def random_heights(
    shape: tuple[int, int], bounds: tuple[float, float], seed: int
) -> list[list[float]]:
    """Heights, in rows, evenly drawn within bounds in m, to the millimetre: the same everywhere."""
    rows, columns = shape
    words = random_words((seed, 0), (0, 0, 0, 0), rows * columns)
    shares = (words >> np.uint64(11)).astype(float) * 2.0**-53
    least, most = bounds
    heights = [round(least + share * (most - least), 3) for share in shares.tolist()]
    return [heights[row * columns : (row + 1) * columns] for row in range(rows)]


def placed(blocks: Iterable[Block], at: Sequence[float], yaw: float) -> list[Block]:
    """Blocks of a piece whose origin is at a place (3,), and whose x axis is turned about z."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return [
        replace(
            block,
            place=(at[0] + cosine * x - sine * y, at[1] + sine * x + cosine * y, at[2] + z),
            yaw=block.yaw + yaw,
        )
        for block in blocks
        for x, y, z in (block.place,)
    ]


def _column(begin: float, end: float, height: float, width: float) -> Block:
    """An upright box on the ground from one place along x to another."""
    return Block((end - begin, width, height), (0.5 * (begin + end), 0.0, 0.5 * height))


def _slab(begin: tuple[float, float], angle: float, length: float, width: float) -> Block:
    """A tilted box whose upper side begins at (x, z) and rises with an angle for a length."""
    cosine, sine = math.cos(angle), math.sin(angle)
    x, z = begin[0] + 0.5 * length, begin[1] + 0.5 * length * sine / cosine
    place = (x + 0.5 * _SLAB * sine, 0.0, z - 0.5 * _SLAB * cosine)
    return Block((length / cosine, width, _SLAB), place, -angle)
