"""A character's skin: one surface, and how it is bound to the links."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.model import Quadruple
from msgs_config.geometry import fixed_order, rotations
from msgs_config.geometry.surface import Surface

BONES = 4
"""Links that move a vertex, at most."""
_SIDES = (-1.0, 0.0, 1.0)
_DIRECTIONS = np.array([way for way in product(_SIDES, repeat=3) if any(way)])


@dataclass(frozen=True)
class Skin:
    """A surface in one pose, whose vertices follow up to four links each."""

    surface: Surface  # in the world, m
    owners: IntArray  # (k,): the link that each triangle is of
    bones: IntArray  # (m, 4): rows of links, those that weigh most first
    weights: FloatArray  # (m, 4), of sum one
    origins: FloatArray  # (l, 3): of the link frames, m, world
    turns_xyzw: FloatArray  # (l, 4)
    colors: FloatArray | None = None  # (k, 3): of the triangles, 0 to 1, if it has its own

    def colored(
        self, colors: Sequence[Quadruple | None]
    ) -> Iterator[tuple[BoolArray, Quadruple | None]]:
        """Its colours rgba, where the links (l,) have these: which triangles (k,) have each.

        None are the skin's own colours.
        """
        for color in dict.fromkeys(colors):
            rows = [row for row, own in enumerate(colors) if own == color]
            which = np.isin(self.owners, rows)
            if which.any():
                yield which, color

    def spheres(self) -> tuple[FloatArray, FloatArray]:
        """Centres (l, 3) in the links' frames and radii (l,), m, of all that each link moves.

        Wherever the links are, the skin is within the hull of these.
        """
        centres, radii = np.zeros_like(self.origins), np.zeros(len(self.origins))
        for row in range(len(self.origins)):
            moved = ((self.bones == row) & (self.weights > 0.0)).any(axis=1)
            if not moved.any():
                continue
            ways = self.surface.vertices[moved] - self.origins[row]
            local = rotations.rotate(rotations.conjugate(self.turns_xyzw[row]), ways)
            centres[row] = 0.5 * (local.min(axis=0) + local.max(axis=0))
            radii[row] = fixed_order.norm(local - centres[row]).max()
        return centres, radii

    def outermost(self) -> "Skin":
        """The vertices alone that are outermost of those that follow a link most.

        Wherever the links are, the skin ends near these: 26 directions are looked into.
        """
        found = []
        for row in np.unique(self.bones[:, 0]):
            own = np.flatnonzero(self.bones[:, 0] == row)
            back = rotations.conjugate(self.turns_xyzw[row])
            local = rotations.rotate(back, self.surface.vertices[own] - self.origins[row])
            found.append(own[[np.argmax(fixed_order.dot(local, way)) for way in _DIRECTIONS]])
        rows = np.unique(np.concatenate(found))
        return Skin(
            Surface(
                self.surface.vertices[rows],
                self.surface.normals[rows],
                np.empty((0, 3), dtype=np.intp),
            ),
            np.empty(0, dtype=np.intp),
            self.bones[rows],
            self.weights[rows],
            self.origins,
            self.turns_xyzw,
        )

    def link_colors(self) -> FloatArray | None:
        """The mean colour of each link (l, 3), 0 to 1, if it has its own."""
        if self.colors is None:
            return None
        counts = np.bincount(self.owners, minlength=len(self.origins))
        sums = [
            np.bincount(self.owners, channel, minlength=len(self.origins))
            for channel in self.colors.T
        ]
        means: FloatArray = np.column_stack(sums) / np.maximum(counts, 1)[:, np.newaxis]
        return means


def strongest(weights: FloatArray) -> tuple[IntArray, FloatArray]:
    """The links (m, 4) that weigh most, of weights (m, l), and theirs, of sum one."""
    bones = np.argsort(-weights, axis=1, kind="stable")[:, :BONES]
    shares = np.take_along_axis(weights, bones, axis=1)
    missing = ((0, 0), (0, BONES - bones.shape[1]))
    bones, shares = np.pad(bones, missing), np.pad(shares, missing)
    return bones, shares / fixed_order.total(shares)[:, np.newaxis]


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
