"""How far shapes reach: spheres around them."""

from itertools import product
from pathlib import Path

import numpy as np

from actuated_characters.render.engine.camera_pose import Spheres
from msgs_config.arrays import FloatArray
from msgs_config.character.meshes.triangles import read_vertices
from msgs_config.character.model import Shape, ShapeType
from msgs_config.geometry import rotations


def outline(shape: Shape) -> Spheres:
    """Spheres whose hull holds a shape, in the link frame."""
    points, radius = _own_outline(shape)
    turned = rotations.rotate(np.array(shape.pose.orientation_xyzw), points)
    return Spheres(turned + np.array(shape.pose.position), np.full(len(points), radius))


def _own_outline(shape: Shape) -> tuple[FloatArray, float]:
    """Centres (m, 3) in the shape's own frame, and their radius."""
    if shape.type is ShapeType.SPHERE:
        return np.zeros((1, 3)), shape.size[0]
    if shape.type in (ShapeType.CYLINDER, ShapeType.CAPSULE):
        radius, length = shape.size
        return np.array([(0.0, 0.0, -0.5 * length), (0.0, 0.0, 0.5 * length)]), radius
    if shape.type is ShapeType.BOX:
        bounds = np.outer((-0.5, 0.5), shape.size)
    else:
        vertices = read_vertices(Path(shape.mesh)) * np.array(shape.size)
        bounds = np.array([vertices.min(axis=0), vertices.max(axis=0)])
    return np.array(list(product(*bounds.T))), 0.0
