"""Skins in a glTF scene: one mesh for each, which the nodes of a character's links move."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from actuated_characters.render.skin.skin import Skin
from character_motion.export.upright import UPRIGHT_XYZW
from character_motion.gltf.document import Attributes, GltfDocument
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.model import Character, Quadruple
from msgs_config.geometry import fixed_order, rotations
from msgs_config.geometry.surface import Surface

_WHITE: Quadruple = (1.0, 1.0, 1.0, 1.0)


class _Bound(NamedTuple):
    """A skin that is in the document, upright and on the ground, y up."""

    skin: Skin  # which is kept, so that no other one gets its identity
    surface: Surface
    inverse_binds: int
    parts: dict[bytes, tuple[Attributes, IntArray]]  # by the triangles that they are of


class SkinnedMeshes:
    """Adds skins to a document; characters of one model share its vertices."""

    def __init__(self, document: GltfDocument) -> None:
        self._document = document
        self._bound: dict[int, _Bound] = {}

    def add(
        self,
        name: str,
        character: Character,
        skin: Skin,
        colors: Sequence[Quadruple | None],
        nodes: Sequence[int],
    ) -> None:
        """Add a mesh, and its node, which is one of the scene's, as skinned ones are to be.

        Args:
            name: Of both.
            character: Whose skin it is.
            skin: Which.
            colors: Of the links (l,), rgba; None are the skin's own.
            nodes: Of the links (l,).
        """
        document = self._document
        if id(skin) not in self._bound:
            self._bound[id(skin)] = self._bind(skin, character.up_axis)
        bound = self._bound[id(skin)]
        parts = [
            (*self._part(bound, which, color is None), document.material(color or _WHITE))
            for which, color in skin.colored(colors)
        ]
        mesh = document.add_mesh_of(name, parts)
        moved = document.add_skin(name, nodes, bound.inverse_binds)
        document.add_node(name, mesh=mesh, skin=moved)

    def _part(
        self, bound: _Bound, which: BoolArray, has_colors: bool
    ) -> tuple[Attributes, IntArray]:
        """Vertices and triangles of some of a skin's triangles (k,), with its own colours or none.

        Each part has vertices of its own, for there are viewers that make the normals of each anew.
        """
        key = which.tobytes()
        if key not in bound.parts:
            surface, skin, document = bound.surface, bound.skin, self._document
            texels, colors = np.zeros((1, 3)), np.zeros(which.sum(), dtype=np.intp)
            if has_colors and skin.colors is not None:
                texels, rows = np.unique(skin.colors[which], axis=0, return_inverse=True)
                colors = rows.ravel()
            # A vertex is there once for each colour of the triangles around it.
            numbers = surface.triangles[which] * len(texels) + colors[:, np.newaxis]
            found, corners = np.unique(numbers, return_inverse=True)
            used, triangles = found // len(texels), corners.reshape(-1, 3)
            own = Surface(surface.vertices[used], surface.normals[used], triangles)
            shown = texels[found % len(texels)] if has_colors else None
            attributes = document.add_vertices(own, colors=shown)
            attributes |= document.bind(skin.bones[used], skin.weights[used])
            bound.parts[key] = attributes, triangles
        return bound.parts[key]

    def _bind(self, skin: Skin, up_axis: str) -> _Bound:
        """A skin in its own pose as it is to be in the file, and the matrices of its bindings.

        It is upright and on the ground, so that readers that know no skins see it stand.
        """
        turn = UPRIGHT_XYZW
        if up_axis == "y":
            turn = rotations.multiply(turn, rotations.ABOUT_X_QUARTER_TURN_XYZW)
        vertices = rotations.rotate(turn, skin.surface.vertices)
        lowest = np.array((0.0, vertices[:, 1].min(), 0.0))
        normals = rotations.rotate(turn, skin.surface.normals)
        surface = Surface(vertices - lowest, normals, skin.surface.triangles)
        turns = rotations.multiply(turn, skin.turns_xyzw)
        origins = rotations.rotate(turn, skin.origins) - lowest
        return _Bound(skin, surface, self._document.add_matrices(_inverses(origins, turns)), {})


def _inverses(origins: FloatArray, turns_xyzw: FloatArray) -> FloatArray:
    """The matrices (l, 4, 4) that lead into frames at origins (l, 3), m, with turns (l, 4)."""
    back = rotations.matrix(rotations.conjugate(turns_xyzw))
    matrices = np.zeros((len(origins), 4, 4))
    matrices[:, :3, :3] = back
    matrices[:, :3, 3] = -fixed_order.apply(back, origins)
    matrices[:, 3, 3] = 1.0
    return matrices
