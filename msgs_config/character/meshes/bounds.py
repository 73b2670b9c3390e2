"""The boxes round the parts of meshes, in the single precision in which Bullet reads vertices."""

import re
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TypeAlias

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.meshes.triangles import check_for_engine, read_vertices
from msgs_config.errors import CharacterError
from msgs_config.geometry.scalars import Vector

Bounds: TypeAlias = tuple[Vector, Vector]
"""Two opposite corners of a box, m: the lower, the upper."""


def bounds_of_parts(path: Path, factors: Sequence[float]) -> list[Bounds]:
    """The boxes round the parts of a mesh, which is scaled along its axes by the factors.

    Parts are the groups and objects of an .obj, as far as faces have its vertices; others are one.

    Raises:
        CharacterError: the mesh cannot be used; names its file.
    """
    try:
        status = path.stat()
    except OSError as error:
        raise CharacterError(f"mesh {path} cannot be used: {error}") from error
    boxes = []
    for lower, upper in _unscaled(path, status.st_mtime_ns, status.st_size):
        x, y, z = (sorted((f * a, f * b)) for f, a, b in zip(factors, lower, upper, strict=True))
        boxes.append(((x[0], y[0], z[0]), (x[1], y[1], z[1])))
    return boxes


@lru_cache(maxsize=64)  # a process reads each mesh several times
def _unscaled(path: Path, modified_ns: int, size: int) -> tuple[Bounds, ...]:
    del modified_ns, size
    check_for_engine(path)
    if path.suffix.lower() != ".obj":
        return (_corners(read_vertices(path)),)
    points, parts = list[Sequence[float]](), list[list[int]](([],))
    for kind, pieces in _lines(path.read_text(encoding="latin-1")):
        if kind == "v":
            points.append([*map(float, pieces[:3]), 0.0, 0.0, 0.0][:3])
        elif kind == "f" and len(pieces) > 2:
            corners = [int(piece.partition("/")[0]) for piece in pieces]
            parts[-1] += [c - 1 if c > 0 else len(points) + c for c in corners]
        elif kind in ("g", "o"):
            parts.append([])
    vertices = np.array(points, dtype=np.float32).reshape(-1, 3).astype(float)
    return tuple(_corners(vertices[part]) for part in parts if part)


def _lines(text: str) -> Iterator[tuple[str, list[str]]]:
    """The first letter of each line that begins with a word of one letter, and the other words."""
    for line in text.split("\n"):
        kind, *words = re.split("[ \t\r]+", line.strip(" \t\r"))
        if len(kind) == 1 and words:
            yield kind, words


def _corners(vertices: FloatArray) -> Bounds:
    """Of the box round vertices (m, 3)."""
    (x, y, z), (u, v, w) = vertices.min(axis=0).tolist(), vertices.max(axis=0).tolist()
    return (x, y, z), (u, v, w)
