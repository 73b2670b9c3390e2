"""Points of a character's shapes: corners of the boxes around them, and balls within them."""

from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from pathlib import Path

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.meshes.triangles import read_vertices
from msgs_config.character.model import Shape, ShapeType
from msgs_config.geometry import rotations

Box = tuple[FloatArray, FloatArray, FloatArray]
"""Centre (3,) in the link frame, axes (3, 3) as columns, and half edges (3,), m."""


def bounding_box(shape: Shape) -> Box:
    """The box around a shape, along its own axes; around a mesh along its principal ones."""
    turn, centre = np.array(shape.pose.orientation_xyzw), np.array(shape.pose.position)
    axes, size = rotations.matrix(turn), shape.size
    match shape.type:
        case ShapeType.BOX:
            half = 0.5 * np.array(size)
        case ShapeType.SPHERE:
            half = np.full(3, size[0])
        case ShapeType.CAPSULE:
            half = np.array((size[0], size[0], 0.5 * size[1] + size[0]))
        case ShapeType.CYLINDER:
            half = np.array((size[0], size[0], 0.5 * size[1]))
        case _:
            points = mesh_points(shape)
            _, _, own = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
            along = points @ own.T
            low, high = along.min(axis=0), along.max(axis=0)
            return own.T @ (0.5 * (low + high)), own.T, 0.5 * (high - low)
    return centre, axes, half


def corners(shape: Shape) -> FloatArray:
    """Corners (8, 3) of the box around a shape, or a mesh's outermost points; link frame, m."""
    if shape.type is ShapeType.MESH:
        return mesh_points(shape)
    centre, axes, half = bounding_box(shape)
    signs = np.array(list(product((-1.0, 1.0), repeat=3)))
    points: FloatArray = centre + (signs * half) @ axes.T
    return points


def mesh_points(shape: Shape) -> FloatArray:
    """The outermost vertices (v, 3) of a mesh in some directions, in the link frame, m."""
    points = _outermost(shape.mesh) * np.array(shape.size)
    turn = np.array(shape.pose.orientation_xyzw)
    placed: FloatArray = np.array(shape.pose.position) + rotations.rotate(turn, points)
    return placed


@lru_cache(maxsize=256)
def _outermost(mesh: str) -> FloatArray:
    vertices = read_vertices(Path(mesh))
    directions = np.array([d for d in product((-1.0, -0.5, 0.0, 0.5, 1.0), repeat=3) if any(d)])
    rows = np.unique(np.argmax(vertices @ directions.T, axis=0))
    outermost: FloatArray = vertices[rows]
    return outermost


def balls(shape: Shape) -> Iterator[tuple[FloatArray, float]]:
    """Centres (3,) in the link frame and radii of balls that reach as far as a shape, m."""
    turn, centre = np.array(shape.pose.orientation_xyzw), np.array(shape.pose.position)
    if shape.type is ShapeType.SPHERE:
        yield centre, shape.size[0]
    elif shape.type in (ShapeType.CAPSULE, ShapeType.CYLINDER):
        radius, length = shape.size
        half = 0.5 * length
        if shape.type is ShapeType.CYLINDER:
            half = max(half - radius, 0.0)
        for sign in (-1.0, 1.0):
            yield centre + rotations.rotate(turn, np.array((0.0, 0.0, sign * half))), radius
    else:
        for corner in corners(shape):
            yield corner, 0.0
