"""Makes a character's skin: the surface of its blended body, bound to the links."""

import manifold3d
import numpy as np

from actuated_characters.render.engine.visual_shapes import drawn_shapes
from actuated_characters.render.skin.blended_body import blend
from actuated_characters.render.skin.fitting import fit, owners_of
from actuated_characters.render.skin.skin import BONES, Skin
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.model import Character, ShapeType
from msgs_config.geometry import fixed_order
from msgs_config.geometry.surface import Surface

MOST_TRIANGLES = 20_000

_FINEST = 112.0  # edges of triangles along the diagonal of the body's box
_COARSER = 1.15  # factor on the edges while there are too many triangles


def has_skin(character: Character) -> bool:
    """Whether a character has a skin: a floating base, and no meshes, which have a look already."""
    shapes = [shape for own in drawn_shapes(character) for shape in own]
    is_plain = all(shape.type is not ShapeType.MESH for shape in shapes)
    return is_plain and character.layout.has_floating_base and len(character.links) > 1


def make_skin(character: Character) -> Skin:
    """The skin of a character of which no shape is a mesh."""
    body = blend(character)
    low, high = body.bounds()
    edge = float(fixed_order.norm(high - low)) / _FINEST
    while True:
        mesh = manifold3d.Manifold.level_set(
            body.depth, [*(low - edge).tolist(), *(high + edge).tolist()], edge, 0.0, -1.0
        ).to_mesh()
        if len(mesh.tri_verts) <= MOST_TRIANGLES:
            break
        edge *= _COARSER
    vertices = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3].copy()
    triangles = np.asarray(mesh.tri_verts, dtype=np.intp)
    links = len(character.links)
    normals, weights = np.empty_like(vertices), np.zeros((len(vertices), links))
    fit(vertices, body.parts, edge, normals, weights)
    middles = fixed_order.mean(vertices[triangles], axis=1)
    return Skin(
        Surface(vertices, normals, triangles),
        owners_of(middles, body.parts, links),
        *_strongest(weights),
        body.link_origins,
        body.link_turns_xyzw,
    )


def _strongest(weights: FloatArray) -> tuple[IntArray, FloatArray]:
    """The links (m, 4) that weigh most, of weights (m, l), and theirs, of sum one."""
    bones = np.argsort(-weights, axis=1, kind="stable")[:, :BONES]
    strongest = np.take_along_axis(weights, bones, axis=1)
    missing = ((0, 0), (0, BONES - bones.shape[1]))
    bones, strongest = np.pad(bones, missing), np.pad(strongest, missing)
    return bones, strongest / fixed_order.total(strongest)[:, np.newaxis]
