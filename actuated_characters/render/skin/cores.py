"""The cores of shapes: lines within them that are as far from the surface as can be."""

from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Shape, ShapeType
from msgs_config.geometry import fixed_order, rotations


@dataclass(frozen=True)
class Core:
    """A line, and how far from it the surface is at least."""

    ends: FloatArray  # (2, 3), m
    radius: float  # m

    def nearest(self, point: FloatArray) -> FloatArray:
        """Its point (3,) that is nearest to another one, m."""
        start, way = self.ends[0], self.ends[1] - self.ends[0]
        square = float(fixed_order.dot(way, way))
        share = 0.0 if square == 0.0 else float(fixed_order.dot(point - start, way)) / square
        nearest: FloatArray = start + min(max(share, 0.0), 1.0) * way
        return nearest

    def distance(self, point: FloatArray) -> float:
        """Of a point (3,) from what is within the radius of the line, m; negative inside."""
        return float(fixed_order.norm(point - self.nearest(point))) - self.radius

    def moved(self, origin: FloatArray, turn_xyzw: FloatArray) -> "Core":
        """The core of a frame's own, where that frame is (3,), m, and how it is turned (4,)."""
        return Core(origin + rotations.rotate(turn_xyzw, self.ends), self.radius)


def core_of(shape: Shape) -> Core:
    """The core of a shape that is no mesh, in the link frame."""
    half = np.zeros(3)
    if shape.type is ShapeType.BOX:
        edges = 0.5 * np.array(shape.size)
        radius, axis = float(edges.min()), int(np.argmax(edges))
        half[axis] = edges[axis] - radius
    else:
        radius = shape.size[0]
        length = shape.size[1] if len(shape.size) > 1 else 0.0
        round_end = 0.0 if shape.type is ShapeType.CAPSULE else radius
        half[2] = max(0.5 * length - round_end, 0.0)
    line = Core(np.array((-half, half)), radius)
    return line.moved(np.array(shape.pose.position), np.array(shape.pose.orientation_xyzw))
