"""Shapes of links as triangles, as pictures, browsers and files of scenes have them."""

from itertools import product
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from actuated_characters.render.engine.surfaces import round_surface
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.meshes.triangles import read_vertices
from msgs_config.character.meshes.wavefront import WavefrontMesh, read_wavefront
from msgs_config.character.model import Shape, ShapeType
from msgs_config.geometry import fixed_order
from msgs_config.geometry.surface import Surface

Texture: TypeAlias = NDArray[np.uint8]
"""Red, green and blue (h, w, 3), rows from top to bottom; (0, 0, 3) is none."""

NO_TEXTURE: Texture = np.empty((0, 0, 3), dtype=np.uint8)

_MOST_TEXELS = 2**26
_CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))
_SIDES = np.array(  # corners of each side, counterclockwise from outside
    [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
)
_HALVES = np.array([(0, 1, 2), (0, 2, 3)])  # corners of the two triangles of a side


class TexturedSurface(NamedTuple):
    """A surface, and the picture that is laid on it."""

    surface: Surface
    uvs: FloatArray  # (m, 2): where its vertices are in the texture, right and up, 1 at its edges
    texture: Texture


def surface_of(shape: Shape) -> Surface:
    """The triangles of a shape with their normals, in the shape's own frame.

    Round shapes are smooth, and meshes wherever an .obj file gives them normals. Other triangles
    share no corners, so that edges stay sharp, and those without area are left out.

    Raises:
        CharacterError: the shape is a mesh that cannot be used; names its file.
    """
    return textured_surface_of(shape).surface


def textured_surface_of(shape: Shape) -> TexturedSurface:
    """The same with the texture of an .obj file, if its materials name one that can be read."""
    if shape.type is ShapeType.BOX:
        sides = (_CORNERS * np.array(shape.size))[_SIDES]
        return untextured(_flat(sides[:, _HALVES].reshape(-1, 3, 3)))
    if shape.type is not ShapeType.MESH:
        return untextured(round_surface(shape))
    path = Path(shape.mesh)
    if path.suffix.lower() == ".obj":
        mesh = read_wavefront(path)
        surface, uvs = _surface_of_corners(mesh)
        found = TexturedSurface(surface, uvs, _read_texture(mesh.picture))
    else:
        found = untextured(_flat(read_vertices(path).reshape(-1, 3, 3)))
    return found._replace(surface=_scaled(found.surface, np.array(shape.size)))


def untextured(surface: Surface) -> TexturedSurface:
    """A surface of one colour."""
    return TexturedSurface(surface, np.zeros((len(surface.vertices), 2)), NO_TEXTURE)


def _flat(corners: FloatArray) -> Surface:
    """Triangles (k, 3, 3) with corners of their own, of those that have an area."""
    normals = fixed_order.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = fixed_order.norm(normals)
    solid = areas > 0.0
    normals = normals[solid] / areas[solid, np.newaxis]
    vertices = corners[solid].reshape(-1, 3)
    own = np.arange(len(vertices)).reshape(-1, 3)
    return Surface(vertices, np.repeat(normals, 3, axis=0), own)


def _surface_of_corners(mesh: WavefrontMesh) -> tuple[Surface, FloatArray]:
    """The surface of a file, and where its vertices (m, 2) are in its texture."""
    lengths = fixed_order.norm(mesh.normals)
    vertex, uv, normal = np.moveaxis(mesh.corners, -1, 0)
    smooth = (normal >= 0).all(axis=1)
    smooth[smooth] = (lengths[normal[smooth]] > 0.0).all(axis=1)
    keys, triangles = _shared(mesh.corners[smooth].reshape(-1, 3))
    normals = mesh.normals[keys[:, 2]] / lengths[keys[:, 2], np.newaxis]
    corners = mesh.vertices[vertex[~smooth]]
    edges = corners[:, 1:] - corners[:, :1]
    solid = fixed_order.norm(fixed_order.cross(edges[:, 0], edges[:, 1])) > 0.0
    flat = _flat(corners[solid])
    uvs = np.concatenate((mesh.uvs, np.zeros((1, 2))))  # row -1: a corner that names none
    surface = Surface(
        np.concatenate((mesh.vertices[keys[:, 0]], flat.vertices)),
        np.concatenate((normals, flat.normals)),
        np.concatenate((triangles, flat.triangles + len(keys))),
    )
    rows = np.concatenate((keys[:, 1], uv[~smooth][solid].ravel()))
    return surface, uvs[rows]


def _shared(corners: IntArray) -> tuple[IntArray, IntArray]:
    """The different rows of corners (c, 3), and which of them the triangles (c / 3, 3) have."""
    sizes = corners.max(axis=0, initial=0) + 2
    numbers = np.ravel_multi_index(tuple((corners + 1).T), tuple(sizes.tolist()))
    _, first, own = np.unique(numbers, return_index=True, return_inverse=True)
    return corners[first], own.reshape(-1, 3)


def _scaled(surface: Surface, scale: FloatArray) -> Surface:
    """A surface stretched along its axes; a mirror turns triangles inside out, so they turn."""
    if (scale == 1.0).all():
        return surface
    normals = surface.normals / np.where(scale == 0.0, 1.0, scale)
    normals /= fixed_order.norm(normals)[:, np.newaxis]
    triangles = surface.triangles[:, ::-1].copy() if np.prod(scale) < 0.0 else surface.triangles
    return Surface(surface.vertices * scale, normals, triangles)


def _read_texture(path: Path | None) -> Texture:
    """A picture's content; none where it cannot be read, as the surface has a colour as well."""
    if path is None:
        return NO_TEXTURE
    from PIL import Image

    try:
        with Image.open(path) as image:
            if image.width * image.height > _MOST_TEXELS:
                return NO_TEXTURE
            return np.array(image.convert("RGB"))
    except Exception:  # whatever a reader makes of a broken file
        return NO_TEXTURE
