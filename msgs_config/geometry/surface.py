"""Surfaces as triangles."""

from typing import NamedTuple

from msgs_config.arrays import FloatArray, IntArray


class Surface(NamedTuple):
    """Triangles with the corners counterclockwise, seen from outside."""

    vertices: FloatArray  # (m, 3), m
    normals: FloatArray  # (m, 3), outwards, of length one
    triangles: IntArray  # (k, 3), indices of vertices
