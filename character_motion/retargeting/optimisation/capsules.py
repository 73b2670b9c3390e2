"""A character's shapes as capsules, and how far those of different limbs are apart.

A box or a mesh is capsules within it, side by side along its longest edge.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from character_motion.retargeting.shape_points import bounding_box
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.model import Link, Shape, ShapeType
from msgs_config.geometry import rotations

APART, SHANKS_APART = 0.01, 0.08
"""m between two shapes, and from shank and foot to those of the other leg, which sway when tracked;
less where they are nearer to each other in the pose with all joints at zero."""
_TINY = 1e-24  # m^2 or m; what is smaller has no length

Capsule = tuple[FloatArray, FloatArray, float]
"""Both ends (3,) of its axis in the link frame and its radius, m."""


@dataclass(frozen=True)
class Capsules:
    """The capsules of a character, c of them, and the p pairs that are kept apart."""

    links: IntArray  # (c,) indices of `Character.links`
    ends: FloatArray  # (c, 2, 3) m, ends of their axes, in the link frame
    radii: FloatArray  # (c,) m
    pairs: IntArray  # (p, 2) two capsules each
    margins: FloatArray  # (p,) m by which they are apart at least

    def of_pairs(self, rows: IntArray) -> "Capsules":
        """The capsules with some of their pairs (q,) alone."""
        return replace(self, pairs=self.pairs[rows], margins=self.margins[rows])

    def nearest(self, origins: FloatArray, axes: FloatArray) -> "Nearest":
        """The points of each pair's axes that are nearest to each other.

        Args:
            origins: Of the links (f, l, 3) in the world, m.
            axes: Of the links (f, l, 3, 3) in the world, as columns.
        """
        turned = np.matmul(axes[:, self.links], self.ends.swapaxes(-1, -2)).swapaxes(-1, -2)
        ends = origins[:, self.links, np.newaxis] + turned
        one, other = self.pairs.T
        points = closest_points(ends[:, one], ends[:, other])
        between = points[0] - points[1]
        length = np.linalg.norm(between, axis=-1)
        distance = length - self.radii[one] - self.radii[other]
        return Nearest(*points, between / np.maximum(length, _TINY)[..., np.newaxis], distance)


@dataclass(frozen=True)
class Nearest:
    """Where p pairs of capsules are nearest to each other in f frames."""

    first: FloatArray  # (f, p, 3) m, the point on the first one's axis, in the world
    second: FloatArray
    direction: FloatArray  # (f, p, 3) from the second one to the first one, of length 1
    distance: FloatArray  # (f, p) m between their surfaces, below 0 where they overlap


def closest_points(first: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The points (..., 3) of two segments (..., 2, 3) that are nearest to each other.

    Source: Ericson 2005, "Real-Time Collision Detection", section 5.1.9.
    """
    start, way = first[..., 0, :], first[..., 1, :] - first[..., 0, :]
    other_start, other_way = second[..., 0, :], second[..., 1, :] - second[..., 0, :]
    between = start - other_start
    # Without what lies along the other line, the angle between nearly parallel ones is exact.
    across = way - _share(way, other_way) * other_way
    gap_across = between - _share(between, other_way) * other_way
    s = np.clip(_share(-gap_across, across), 0.0, 1.0)  # any point will do on parallel lines
    t = np.clip(_share(between + s * way, other_way), 0.0, 1.0)
    s = np.clip(_share(t * other_way - between, way), 0.0, 1.0)
    return start + s * way, other_start + t * other_way


def make_capsules(
    links: Sequence[Link], origins: FloatArray, turns_xyzw: FloatArray, shanks: tuple[int, int]
) -> Capsules:
    """The capsules of all shapes that collide, with the pairs that a motion can keep apart.

    Links that hang on each other, and shapes that overlap in the pose given, are no such pairs.

    Args:
        links: Of the character (l,).
        origins: Of the links (l, 3) in a pose in which nothing should overlap, m.
        turns_xyzw: Of the links (l, 4).
        shanks: The links that both lower legs begin with.
    """
    rows = [
        (index, capsule)
        for index, link in enumerate(links)
        for shape in link.collision_shapes
        for capsule in _capsules_of(shape)
    ]
    above = [_line(links, index) for index in range(len(links))]
    pairs = [
        (one, other)
        for one, other in combinations(range(len(rows)), 2)
        if rows[one][0] not in above[rows[other][0]] and rows[other][0] not in above[rows[one][0]]
    ]
    every = Capsules(
        np.array([link for link, _ in rows], dtype=np.intp),
        np.array([(start, end) for _, (start, end, _) in rows]).reshape(-1, 2, 3),
        np.array([radius for _, (_, _, radius) in rows]),
        np.array(pairs, dtype=np.intp).reshape(-1, 2),
        np.zeros(len(pairs)),
    )
    near = every.nearest(origins[np.newaxis], rotations.matrix(turns_xyzw)[np.newaxis])
    at_rest = near.distance[0]
    first, second = (np.array([each in line for line in above])[every.links] for each in shanks)
    one, other = every.pairs.T
    of_legs = (first[one] & second[other]) | (second[one] & first[other])
    margins = np.minimum(np.where(of_legs, SHANKS_APART, APART), at_rest)
    return replace(every, margins=margins).of_pairs(np.flatnonzero(at_rest > 0.0))


def _line(links: Sequence[Link], index: int) -> set[int]:
    """A link and those that it hangs on."""
    line = set()
    while index >= 0:
        line.add(index)
        index = links[index].parent
    return line


def _capsules_of(shape: Shape) -> Iterator[Capsule]:
    """The capsules of a shape, in the link frame."""
    turn, centre = np.array(shape.pose.orientation_xyzw), np.array(shape.pose.position)
    along = rotations.rotate(turn, np.array((0.0, 0.0, 1.0)))
    if shape.type is ShapeType.SPHERE:
        yield centre, centre, shape.size[0]
    elif shape.type in (ShapeType.CAPSULE, ShapeType.CYLINDER):
        radius, length = shape.size
        half = 0.5 * length
        if shape.type is ShapeType.CYLINDER:
            half = max(half - radius, 0.0)
        yield centre - half * along, centre + half * along, radius
    else:
        yield from _within_box(*bounding_box(shape))


def _within_box(centre: FloatArray, axes: FloatArray, half: FloatArray) -> Iterator[Capsule]:
    """Capsules side by side that fill a box with half edges (3,) along axes, columns (3, 3)."""
    short, middle, long = np.argsort(half)
    radius = float(half[short])
    if not radius > 0.0:
        return
    reach = (half[long] - radius) * axes[:, long]
    beside = float(half[middle]) - radius
    count = 1 + int(np.ceil(beside / radius))
    for share in np.linspace(-1.0, 1.0, count) if count > 1 else (0.0,):
        place = centre + share * beside * axes[:, middle]
        yield place - reach, place + reach, radius


def _share(vector: FloatArray, way: FloatArray) -> FloatArray:
    """How much of the way (..., 3) a vector (..., 3) goes along it, as (..., 1); 0 on no way."""
    square = (way * way).sum(axis=-1, keepdims=True)
    along = (vector * way).sum(axis=-1, keepdims=True)
    share: FloatArray = np.where(square > _TINY, along / np.maximum(square, _TINY), 0.0)
    return share
