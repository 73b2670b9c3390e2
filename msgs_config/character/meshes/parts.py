"""The convex parts of a mesh, as Bullet has them: of each object of an .obj file its own hull."""

from pathlib import Path

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.meshes.triangles import read_vertices

_BEGINNINGS = ("o", "g")  # of an object, or a group of faces


def read_parts(path: Path) -> list[FloatArray]:
    """The vertices (m, 3) of each part of a mesh, in the units of its URDF's scale.

    Raises:
        CharacterError: the mesh cannot be used; names its file.
    """
    vertices = read_vertices(path)  # checks the file
    if path.suffix.lower() != ".obj":
        return [vertices]
    parts: list[set[int]] = [set()]
    count = 0
    for line in path.read_text(encoding="latin-1").split("\n"):
        kind, *pieces = line.split() or ("",)
        if kind == "v":
            count += 1
        elif kind in _BEGINNINGS and parts[-1]:
            parts.append(set())
        elif kind == "f":
            indices = [int(piece.split("/")[0]) for piece in pieces]
            # a negative one is counted back from what there is so far
            parts[-1] |= {index - 1 if index > 0 else count + index for index in indices}
    return [vertices[np.array(sorted(part))] for part in parts if part]
