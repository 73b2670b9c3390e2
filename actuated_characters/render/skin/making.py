"""Makes a character's skin: the surface of its blended body, bound to the links."""

from collections.abc import Sequence

import manifold3d
import numpy as np

from actuated_characters.render.skin.blended_body import blend
from actuated_characters.render.skin.fitting import fit, owners_of
from actuated_characters.render.skin.skin import Skin, strongest
from msgs_config.character.model import Character, Shape
from msgs_config.geometry import fixed_order
from msgs_config.geometry.surface import Surface

MOST_TRIANGLES = 20_000

_FINEST = 112.0  # edges of triangles along the diagonal of the body's box
_COARSER = 1.15  # factor on the edges while there are too many triangles


def make_skin(character: Character, shapes: Sequence[Sequence[Shape]]) -> Skin:
    """The skin of a character around the shapes of its links (l,), none of them a mesh."""
    body = blend(character, shapes)
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
        *strongest(weights),
        body.link_origins,
        body.link_turns_xyzw,
    )
