"""Round surfaces as triangles: the renderer's own have so few that a sphere has corners."""

from typing import NamedTuple

import numpy as np

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.model import Shape, ShapeType

HEAD_WIDTH = 3.0  # of an arrow, in diameters of its shaft

_AROUND = 24  # faces around the axis
_ALONG_ARC = 7  # points of a quarter of a circle


class Surface(NamedTuple):
    """Triangles with the corners counterclockwise, seen from outside."""

    vertices: FloatArray  # (m, 3), m
    normals: FloatArray  # (m, 3), outwards, of length one
    triangles: IntArray  # (k, 3), which vertices


def round_surface(shape: Shape) -> Surface:
    """The surface of a sphere, a cylinder or a capsule, in the shape's own frame."""
    radius, length = shape.size[0], shape.size[1] if len(shape.size) > 1 else 0.0
    if shape.type is ShapeType.CYLINDER:
        return _revolved(*_cylinder_profile(radius, length))
    angle = np.linspace(0.0, 0.5 * np.pi, _ALONG_ARC)
    lower = np.column_stack((np.sin(angle), -np.cos(angle)))
    normals = np.concatenate((lower, lower[::-1] * (1.0, -1.0)))
    points = radius * normals
    points[:, 1] += 0.5 * length * np.repeat((-1.0, 1.0), _ALONG_ARC)
    return _revolved(points, normals)


def arrow_surface(length: float, radius: float) -> Surface:
    """The surface of an arrow from the origin along z; the radius is that of its shaft, in m."""
    tip = min(2.0 * HEAD_WIDTH * radius, 0.6 * length)  # length of its head
    neck, wide = length - tip, HEAD_WIDTH * radius
    points = [(0.0, 0.0), (radius, 0.0), (radius, 0.0), (radius, neck), (radius, neck)]
    points += [(wide, neck), (wide, neck), (0.0, length)]
    slope = np.array((tip, wide)) / np.hypot(tip, wide)
    down, out = (0.0, -1.0), (1.0, 0.0)
    normals = np.array([down, down, out, out, down, down, slope, slope])
    return _revolved(np.array(points), normals)


def _cylinder_profile(radius: float, length: float) -> tuple[FloatArray, FloatArray]:
    """Points (4 + 2, 2) and normals from the lower end's middle to the upper one's."""
    half = 0.5 * length
    points = [(0.0, -half), (radius, -half), (radius, -half)]
    points += [(radius, half), (radius, half), (0.0, half)]
    normals = np.repeat([(0.0, -1.0), (1.0, 0.0), (0.0, 1.0)], 2, axis=0)
    return np.array(points), normals


def _revolved(points: FloatArray, normals: FloatArray) -> Surface:
    """A profile turned about z: distances from the axis and heights (m, 2), from below upwards."""
    angle = np.linspace(0.0, 2.0 * np.pi, _AROUND + 1)
    turned = [
        np.stack(
            (
                np.outer(np.cos(angle), line[:, 0]),
                np.outer(np.sin(angle), line[:, 0]),
                np.tile(line[:, 1], (len(angle), 1)),
            ),
            axis=-1,
        ).reshape(-1, 3)
        for line in (points, normals)
    ]
    count = len(points)
    column, row = np.mgrid[:_AROUND, : count - 1].reshape(2, -1)
    corner = column * count + row
    beside, above = corner + count, corner + 1
    faces = np.concatenate(
        (
            np.column_stack((corner, beside, beside + 1)),
            np.column_stack((corner, beside + 1, above)),
        )
    )
    return Surface(turned[0], turned[1], faces)
