"""A character's skin: one closed surface, and how it is bound to the links."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.model import Quadruple
from msgs_config.geometry import fixed_order, rotations
from msgs_config.geometry.surface import Surface

BONES = 4
"""Links that move a vertex, at most."""


@dataclass(frozen=True)
class Skin:
    """A closed surface in one pose, whose vertices follow up to four links each."""

    surface: Surface  # in the world, m
    owners: IntArray  # (k,): the link that each triangle is of
    bones: IntArray  # (m, 4): rows of links, those that weigh most first
    weights: FloatArray  # (m, 4), of sum one
    origins: FloatArray  # (l, 3): of the link frames, m, world
    turns_xyzw: FloatArray  # (l, 4)

    def colored(self, colors: Sequence[Quadruple]) -> Iterator[tuple[BoolArray, Quadruple]]:
        """Its colours rgba, where the links (l,) have these: which triangles (k,) have each."""
        for color in dict.fromkeys(colors):
            rows = [row for row, own in enumerate(colors) if own == color]
            which = np.isin(self.owners, rows)
            if which.any():
                yield which, color


class PosedSkin:
    """Moves a skin's vertices with the links (linear blend skinning)."""

    def __init__(self, skin: Skin) -> None:
        self.skin = skin
        back = rotations.conjugate(skin.turns_xyzw)[skin.bones]
        ways = skin.surface.vertices[:, np.newaxis] - skin.origins[skin.bones]
        self._local = rotations.rotate(back, ways)
        self._local_normals = rotations.rotate(
            back, np.broadcast_to(skin.surface.normals[:, np.newaxis], ways.shape)
        )

    def surface(self, origins: FloatArray, turns_xyzw: FloatArray) -> Surface:
        """The skin where its link frames are: origins (l, 3), m, and orientations (l, 4)."""
        skin = self.skin
        turns = rotations.matrix(turns_xyzw)[skin.bones]
        places = fixed_order.apply(turns, self._local) + origins[skin.bones]
        weights = skin.weights[..., np.newaxis]
        vertices = fixed_order.total(weights * places, axis=1)
        normals = fixed_order.total(weights * fixed_order.apply(turns, self._local_normals), axis=1)
        normals /= fixed_order.norm(normals)[:, np.newaxis]
        return Surface(vertices, normals, skin.surface.triangles)

    def parts(
        self, origins: FloatArray, turns_xyzw: FloatArray, colors: Sequence[Quadruple]
    ) -> Iterator[tuple[Surface, Quadruple]]:
        """The same in parts that have a colour each, of the colours (l,) of the links."""
        whole = self.surface(origins, turns_xyzw)
        for which, color in self.skin.colored(colors):
            yield whole._replace(triangles=whole.triangles[which]), color
