"""The ground of a glTF scene: the chequerboard of pictures and browser, as a repeated picture."""

import io

import numpy as np
from PIL import Image

from actuated_characters.render.engine.ground import COLORS
from character_motion.gltf.document import GltfDocument
from msgs_config.geometry.surface import Surface

_HALF = 20.0  # m, from the middle to an edge
_TILE = 0.5  # m
_TEXELS_A_TILE = 128  # so many that what is between two tiles is a line, seen from near, too
_TRIANGLES = np.array([(0, 1, 2), (0, 2, 3)])


def add_ground(document: GltfDocument, name: str) -> int:
    """Add the plane z = 0 around the origin as a mesh, m, z up, and return the mesh's number."""
    corners = _HALF * np.array(
        [(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)]
    )
    normals = np.tile((0.0, 0.0, 1.0), (4, 1))
    # The picture has two tiles along an edge, and its corner is at the origin, as tiles' corners
    # are in pictures; what is light is the same by a mirror.
    uvs = corners[:, :2] / (2.0 * _TILE)
    vertices = document.add_vertices(Surface(corners, normals, _TRIANGLES), uvs)
    return document.add_mesh_of(name, [(vertices, _TRIANGLES, document.add_tiles(_picture()))])


def _picture() -> bytes:
    """Two by two tiles, as PNG; that at the corner is light."""
    number = np.arange(2 * _TEXELS_A_TILE) // _TEXELS_A_TILE
    is_dark = (number[:, np.newaxis] + number) % 2
    image = Image.fromarray(is_dark.astype(np.uint8), mode="P")
    image.putpalette(np.round(COLORS).astype(np.uint8).ravel().tolist())
    file = io.BytesIO()
    image.save(file, "png", optimize=True)
    return file.getvalue()
