"""Signed distances to shapes, blended where joints are: the compiled inner loops.

The shapes' distances are exact (Quilez, "Distance functions", 2008), and so is the order of the
sums: nothing but `+ - * /`, square roots and comparisons.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.compiled.decorator import Compiler

compiled = Compiler(Path(__file__))

# Columns of a part: its half axes of a box, then the radius that rounds it; half lengths are 0 for
# a sphere, and along z alone for a capsule.
PART_COLUMNS = 5
HALF_X, HALF_Y, HALF_Z, ROUNDING, CYLINDER_RADIUS = range(PART_COLUMNS)

# Columns of a joint: its place, how far it blends its two links, and how softly.
JOINT_COLUMNS = 5
REACH, SOFTNESS = 3, 4


@compiled
def _part_distance(x: float, y: float, z: float, part: FloatArray) -> float:
    """From a point in a part's own frame, m; negative inside."""
    if part[CYLINDER_RADIUS] > 0.0:
        across = np.sqrt(x * x + y * y) - part[CYLINDER_RADIUS]
        along = abs(z) - part[HALF_Z]
        outside = np.sqrt(max(across, 0.0) ** 2 + max(along, 0.0) ** 2)
        return float(min(max(across, along), 0.0) + outside - part[ROUNDING])
    a, b, c = abs(x) - part[HALF_X], abs(y) - part[HALF_Y], abs(z) - part[HALF_Z]
    outside = np.sqrt(max(a, 0.0) ** 2 + max(b, 0.0) ** 2 + max(c, 0.0) ** 2)
    return float(min(max(a, max(b, c)), 0.0) + outside - part[ROUNDING])


@compiled
def _blended(one: float, other: float, softness: float) -> float:
    """The smaller of two distances, rounded where they are nearly the same."""
    if softness <= 0.0:
        return min(one, other)
    share = max(softness - abs(one - other), 0.0) / softness
    return float(min(one, other) - 0.25 * softness * share * share)


@compiled
def nearness(point: FloatArray, joint: FloatArray) -> float:
    """How near a point (3,) is to a joint: 1 at it, 0 from its reach on."""
    square = 0.0
    for axis in range(3):
        square += (point[axis] - joint[axis]) ** 2
    left = max(1.0 - square / (joint[REACH] * joint[REACH]), 0.0)
    return float(left * left)


class BodyParts(NamedTuple):
    """What the distance of a point to a body of l links is computed of."""

    parts: FloatArray  # (p, 5), columns as above
    origins: FloatArray  # (p, 3): of the parts, m, world
    axes: FloatArray  # (p, 3, 3): their own as columns
    owners: IntArray  # (p,): the links that they belong to
    softness: float  # m, of the blend of the parts of one link
    joints: FloatArray  # (j, 5), columns as above
    ends: IntArray  # (j, 2): rows of parent and child


@compiled
def link_distances(point: FloatArray, body: BodyParts, own: FloatArray) -> None:
    """Distances of a point (3,), m, world, to all links, into `own` (l,); m."""
    own[:] = np.inf
    for row in range(len(body.parts)):
        x = y = z = 0.0
        for axis in range(3):
            way = point[axis] - body.origins[row, axis]
            x += body.axes[row, axis, 0] * way
            y += body.axes[row, axis, 1] * way
            z += body.axes[row, axis, 2] * way
        link = body.owners[row]
        own[link] = _blended(own[link], _part_distance(x, y, z, body.parts[row]), body.softness)


@compiled
def body_distance(point: FloatArray, body: BodyParts, own: FloatArray) -> float:
    """The distance of a point (3,), m, world, to the whole body; `own` (l,) is changed."""
    link_distances(point, body, own)
    least = np.inf
    for row in range(len(own)):
        least = min(least, own[row])
    for row in range(len(body.joints)):
        joint = body.joints[row]
        softness = joint[SOFTNESS] * nearness(point, joint)
        if softness > 0.0:
            least = min(least, _blended(own[body.ends[row, 0]], own[body.ends[row, 1]], softness))
    return least


@compiled
def depth_within(x: float, y: float, z: float, body: BodyParts, links: int) -> float:
    """How deep a point is within a body of so many links, m; negative outside."""
    return -body_distance(np.array((x, y, z)), body, np.empty(links))
