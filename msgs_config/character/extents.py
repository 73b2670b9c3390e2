"""How far the shapes of a link go."""

from pathlib import Path

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.meshes.triangles import read_vertices
from msgs_config.character.model import Shape, ShapeType
from msgs_config.geometry import fixed_order, rotations


def farthest(shape: Shape, turn_xyzw: FloatArray, direction: FloatArray) -> float:
    """How far a shape goes from its link's origin along a unit vector (3,), m; (4,) is its turn."""
    offset = rotations.rotate(turn_xyzw, np.array(shape.pose.position))
    whole = rotations.multiply(turn_xyzw, np.array(shape.pose.orientation_xyzw))
    back = rotations.rotate(rotations.conjugate(whole), -direction)
    return float(fixed_order.dot(offset, direction)) + _reach(shape, back)


def _reach(shape: Shape, up: FloatArray) -> float:
    """How far a shape reaches from its frame's origin against a unit vector (3,), m."""
    match shape.type:
        case ShapeType.BOX:
            return float(fixed_order.dot(0.5 * np.array(shape.size), np.abs(up)))
        case ShapeType.MESH:
            vertices = read_vertices(Path(shape.mesh)) * np.array(shape.size)
            return float(-fixed_order.dot(vertices, up).min())
        case ShapeType.SPHERE:
            return shape.size[0]
    radius, length = shape.size
    across = np.sqrt(max(1.0 - up[2] * up[2], 0.0)) if shape.type is ShapeType.CYLINDER else 1.0
    return float(0.5 * length * abs(up[2]) + radius * across)
