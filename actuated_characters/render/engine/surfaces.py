"""Round surfaces as triangles."""

from collections.abc import Sequence

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Shape, ShapeType
from msgs_config.geometry import elementary, fixed_order
from msgs_config.geometry.surface import Surface

HEAD_WIDTH = 3.0  # width of an arrow's head, in diameters of its shaft

_FACES_AROUND_AXIS = 24  # faces around the axis
_ALONG_ARC = 7  # points of a quarter of a circle


def round_surface(shape: Shape) -> Surface:
    """The surface of a sphere, a cylinder or a capsule, in the shape's own frame."""
    radius, length = shape.size[0], shape.size[1] if len(shape.size) > 1 else 0.0
    half = 0.5 * length
    if shape.type is ShapeType.CYLINDER:
        return _polygon_revolved([(0.0, -half), (radius, -half), (radius, half), (0.0, half)])
    angle = np.linspace(0.0, 0.5 * np.pi, _ALONG_ARC)
    lower = np.column_stack((elementary.sin(angle), -elementary.cos(angle)))
    normals = np.concatenate((lower, lower[::-1] * (1.0, -1.0)))
    points = radius * normals
    points[:, 1] += half * np.repeat((-1.0, 1.0), _ALONG_ARC)
    return _revolved(points, normals)


def arrow_surface(length: float, radius: float) -> Surface:
    """The surface of an arrow from the origin along z; the radius is that of its shaft, in m."""
    wide = HEAD_WIDTH * radius
    neck = length - min(2.0 * wide, 0.6 * length)  # the arrow's head begins here
    return _polygon_revolved(
        [(0.0, 0.0), (radius, 0.0), (radius, neck), (wide, neck), (0.0, length)]
    )


def _polygon_revolved(corners: Sequence[tuple[float, float]]) -> Surface:
    """A profile of straight lines turned about z, with an edge at each corner."""
    points = np.repeat(corners, 2, axis=0)[1:-1]
    along = points[1::2] - points[::2]
    outwards = np.column_stack((along[:, 1], -along[:, 0]))
    outwards /= fixed_order.norm(outwards)[:, np.newaxis]
    return _revolved(points, np.repeat(outwards, 2, axis=0))


def _revolved(points: FloatArray, normals: FloatArray) -> Surface:
    """A profile turned about z: distances from the axis and heights (m, 2), from below upwards."""
    angle = np.linspace(0.0, 2.0 * np.pi, _FACES_AROUND_AXIS + 1)[:, np.newaxis]
    cosine, sine = elementary.cos(angle), elementary.sin(angle)

    def turned(line: FloatArray) -> FloatArray:
        across, upwards = line.T
        x, y = cosine * across, sine * across
        return np.stack((x, y, np.broadcast_to(upwards, x.shape)), axis=-1).reshape(-1, 3)

    count = len(points)
    column, row = np.mgrid[:_FACES_AROUND_AXIS, : count - 1].reshape(2, -1)
    corner = column * count + row
    beside, above = corner + count, corner + 1
    faces = [(corner, beside, beside + 1), (corner, beside + 1, above)]
    triangles = np.concatenate([np.column_stack(face) for face in faces])
    return Surface(turned(points), turned(normals), triangles)
