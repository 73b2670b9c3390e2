"""Shapes of links as triangles, as browsers and files of scenes have them."""

from itertools import product
from pathlib import Path

import numpy as np

from actuated_characters.render.engine.surfaces import round_surface
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.meshes.triangles import read_vertices
from msgs_config.character.model import Shape, ShapeType
from msgs_config.errors import CharacterError
from msgs_config.geometry.surface import Surface
from msgs_config.runtime.extras import require_extra

_CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))
_SIDES = np.array(  # corners of each side, counterclockwise from outside
    [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
)


def triangles_of(shape: Shape) -> tuple[FloatArray, IntArray]:
    """Vertices (m, 3) in m in the shape's own frame, and which of them are triangles (k, 3).

    Corners of a box are not shared by its sides, nor those of a mesh by its triangles, so that
    edges stay sharp.

    Raises:
        CharacterError: the shape is a mesh that cannot be used; names its file.
    """
    if shape.type is ShapeType.BOX:
        vertices = (_CORNERS * np.array(shape.size))[_SIDES].reshape(-1, 3)
        first = 4 * np.arange(len(_SIDES))[:, np.newaxis]
        return vertices, np.concatenate((first + np.array((0, 1, 2)), first + np.array((0, 2, 3))))
    if shape.type is not ShapeType.MESH:
        surface = round_surface(shape)
        return surface.vertices, surface.triangles
    vertices, triangles = _read_mesh(Path(shape.mesh))
    scale = np.array(shape.size)
    if np.prod(scale) < 0.0:  # a mirror turns triangles inside out
        triangles = triangles[:, ::-1]
    return vertices * scale, triangles


def surface_of(shape: Shape) -> Surface:
    """The triangles of a shape with their normals, in the shape's own frame.

    Round shapes are smooth. The triangles of a box or a mesh share no corners, so that edges stay
    sharp, and those without area are left out.

    Raises:
        CharacterError: see `triangles_of`.
    """
    if shape.type not in (ShapeType.BOX, ShapeType.MESH):
        return round_surface(shape)
    vertices, triangles = triangles_of(shape)
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    solid = areas > 0.0
    normals = normals[solid] / areas[solid, np.newaxis]
    corners = corners[solid].reshape(-1, 3)
    return Surface(corners, np.repeat(normals, 3, axis=0), np.arange(len(corners)).reshape(-1, 3))


def _read_mesh(path: Path) -> tuple[FloatArray, IntArray]:
    vertices = read_vertices(path)  # checks the file as well
    if path.suffix.lower() != ".obj":
        return vertices, np.arange(len(vertices)).reshape(-1, 3)
    require_extra("meshes", f"mesh {path}, an .obj that is to be drawn,", CharacterError)
    import trimesh

    try:
        mesh = trimesh.load_mesh(path, process=False, skip_materials=True)
        return np.array(mesh.vertices), np.array(mesh.faces)
    except Exception as error:  # trimesh raises anything for a broken file
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise CharacterError(f"mesh {path} cannot be drawn: {reason}") from error
