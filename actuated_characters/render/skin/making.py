"""Makes a character's skin: the surface of its blended body, bound to the links."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import manifold3d
import numpy as np

from actuated_characters.render.skin.blended_body import blend
from actuated_characters.render.skin.fitting import fit, owners_of
from actuated_characters.render.skin.skin import BONES, Skin
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.model import Character, Link, Shape, ShapeType
from msgs_config.geometry import fixed_order
from msgs_config.geometry.surface import Surface

MOST_TRIANGLES = 20_000

_FINEST = 112.0  # edges of triangles along the diagonal of the body's box
_MOST_KEPT = 16  # skins of so many models, some 2 MB each
_COARSER = 1.15  # factor on the edges while there are too many triangles


@dataclass(frozen=True)
class _Model:
    """What a skin depends on: characters that are equal in it have the same one."""

    links: tuple[Link, ...]
    shapes: tuple[tuple[Shape, ...], ...]  # of each link, as it is drawn
    rest: tuple[float, ...]  # (n,), message form, but for the root's place
    character: Character = field(compare=False)


def skin_of(character: Character, shapes: Sequence[tuple[Shape, ...]]) -> Skin | None:
    """The skin of a character, one for all of the same model; not to be changed.

    None where it has a fixed base, or a mesh, which has a look already.

    Args:
        character: Whose.
        shapes: Of each link, as it is drawn (`drawn_shapes`).
    """
    is_plain = all(shape.type is not ShapeType.MESH for own in shapes for shape in own)
    if not (is_plain and character.layout.has_floating_base and len(character.links) > 1):
        return None
    rest = list(character.rest_position)
    del rest[character.layout.joints[0].entries]
    return _make(_Model(character.links, tuple(shapes), tuple(rest), character))


@lru_cache(maxsize=_MOST_KEPT)
def _make(model: _Model) -> Skin:
    """Make it, which takes a second."""
    character = model.character
    body = blend(character, model.shapes)
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
