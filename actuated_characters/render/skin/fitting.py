"""Brings the vertices of a surface onto a body, and binds them to its links: compiled loops."""

from pathlib import Path

import numpy as np

from actuated_characters.render.skin import distances
from actuated_characters.render.skin.distances import SOFTNESS, BodyParts, nearness
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.compiled.decorator import Compiler

_STEPS = 2  # towards the body (Newton)
_STEP = 1e-4  # m, of the differences that gradients are made of
_SNAP = 0.4  # of an edge: a vertex that is nearer to where two links meet goes there
# Over such a depth, as a share of a joint's softness, the weight goes from link to link.
_WEIGHT_WIDTH = 0.35

compiled = Compiler(Path(distances.__file__), Path(__file__))


@compiled
def fit(
    vertices: FloatArray, body: BodyParts, edge: float, normals: FloatArray, weights: FloatArray
) -> None:
    """Bring vertices onto a body, and find how they are bound to its links.

    Those near the line where two links meet come to lie on it, for a clean edge between colours.

    Args:
        vertices: (m, 3), m, world; changed.
        body: Which.
        edge: Length of the edges of triangles, m.
        normals: (m, 3), filled with those of the body, outwards, of length one.
        weights: (m, l), zeros, filled with how much each vertex follows each link.
    """
    own = np.empty(weights.shape[1])
    for row in range(len(vertices)):
        point, normal = vertices[row], normals[row]
        _settle(point, normal, body, own)
        other = _neighbour(point, body, own)
        if other >= 0 and _snap(point, normal, body, own, other, edge):
            _settle(point, normal, body, own)
        _weigh(point, body, own, weights[row])


@compiled
def owners_of(points: FloatArray, body: BodyParts, links: int) -> IntArray:
    """The nearest of so many links (m,) to points (m, 3), m, world."""
    own, nearest = np.empty(links), np.empty(len(points), dtype=np.intp)
    for row in range(len(points)):
        distances.link_distances(points[row], body, own)
        nearest[row] = np.argmin(own)
    return nearest


@compiled
def _settle(point: FloatArray, normal: FloatArray, body: BodyParts, own: FloatArray) -> None:
    """Move a point (3,) onto the body along the normal (3,), which is filled."""
    near = np.empty(3)
    for step in range(_STEPS + 1):
        square = 0.0
        for axis in range(3):
            near[:] = point
            near[axis] += _STEP
            difference = distances.body_distance(near, body, own)
            near[axis] -= 2.0 * _STEP
            difference -= distances.body_distance(near, body, own)
            normal[axis] = difference
            square += difference * difference
        normal /= np.sqrt(square)
        if step < _STEPS:
            away = distances.body_distance(point, body, own)
            for axis in range(3):
                point[axis] -= away * normal[axis]


@compiled
def _neighbour(point: FloatArray, body: BodyParts, own: FloatArray) -> int:
    """The nearest link that is joined to the nearest one; -1: there is none. Fills `own`."""
    distances.link_distances(point, body, own)
    nearest, found = np.argmin(own), -1
    for joint in range(len(body.joints)):
        parent, child = body.ends[joint, 0], body.ends[joint, 1]
        if nearest in (parent, child):
            other = child if nearest == parent else parent
            if found < 0 or own[other] < own[found]:
                found = other
    return found


@compiled
def _snap(
    point: FloatArray, normal: FloatArray, body: BodyParts, own: FloatArray, other: int, edge: float
) -> bool:
    """Move a point to where two links are as near, if that is near; whether it was."""
    nearest = np.argmin(own)
    gap = own[other] - own[nearest]
    along, near, within = np.empty(3), np.empty(3), 0.0
    for axis in range(3):
        near[:] = point
        near[axis] += _STEP
        distances.link_distances(near, body, own)
        along[axis] = (own[other] - own[nearest] - gap) / _STEP
        within += along[axis] * normal[axis]
    square = 0.0
    for axis in range(3):
        along[axis] -= within * normal[axis]
        square += along[axis] * along[axis]
    if gap * gap >= _SNAP * _SNAP * edge * edge * square:
        return False
    for axis in range(3):
        point[axis] -= gap * along[axis] / square
    return True


@compiled
def _weigh(point: FloatArray, body: BodyParts, own: FloatArray, weights: FloatArray) -> None:
    """Fill the weights (l,) of a point: its nearest link, and those joined to it."""
    distances.link_distances(point, body, own)
    nearest = np.argmin(own)
    weights[nearest] = 1.0
    for joint in range(len(body.joints)):
        parent, child = body.ends[joint, 0], body.ends[joint, 1]
        if nearest in (parent, child):
            other = child if nearest == parent else parent
            ratio = (own[other] - own[nearest]) / (_WEIGHT_WIDTH * body.joints[joint, SOFTNESS])
            share = 1.0 / (1.0 + ratio + 0.5 * ratio * ratio + ratio * ratio * ratio * ratio)
            weights[other] = share * nearness(point, body.joints[joint])
