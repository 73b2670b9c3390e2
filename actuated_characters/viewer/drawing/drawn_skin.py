"""A character's skin in the browser: a skinned mesh for each link, or one for all of a ghost.

Each link has a mesh of its own, below its frame, so that it can be touched and coloured. The page
makes the normals of a mesh of its own triangles; so each has those around its edge as well, a
little deeper, where its neighbour's hide them.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import viser
from viser._messages import SetBoneOrientationMessage, SetBonePositionMessage

from actuated_characters.render.skin.skin import Skin
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.model import Character
from msgs_config.geometry import rotations

Color: TypeAlias = tuple[int, int, int]
"""Red, green and blue, 0 to 255."""

_SUNK = 4e-4  # m: how much deeper the triangles around a mesh's edge end
_STILL = 1e-5  # m: a bone that has moved by less is not sent
_UNTURNED = 5e-4  # of a quaternion's entries: nor is one that has turned by less
_NO_TURN_WXYZ = (1.0, 0.0, 0.0, 0.0)
_OUTLINE_WIDTH = 0.007  # m
_OPACITY = 0.45  # of a ghost


class DrawnSkin:
    """The skin of a drawn character, whose link frames are at hand in the scene.

    A mesh lies in its own link's frame. The other bones of it are frames of the links joined to
    that one, with their origins where the joint is, so that they turn, but hardly move.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        links: str,
        character: Character,
        skin: Skin,
        colors: Sequence[Color],
    ) -> None:
        """Add a mesh to each link's frame, `links`/ROW, that has any of the skin."""
        self._handles: dict[int, viser.MeshSkinnedHandle] = {}
        joints, anchors = _joined(character, skin)
        self._own, self._other = np.array(joints, dtype=np.intp).reshape(-1, 2).T
        self._anchors = np.array(anchors).reshape(-1, 3)
        self._places, self._turns = self._poses(skin.origins, skin.turns_xyzw)
        for row in sorted(set(skin.owners.tolist())):
            rows = np.flatnonzero(self._own == row)
            vertices, faces, used = _piece(skin, row)
            handle = scene.add_mesh_skinned(
                f"{links}/{row}/skin",
                vertices,
                faces,
                bone_wxyzs=np.concatenate(([_NO_TURN_WXYZ], self._turns[rows])),
                bone_positions=np.concatenate((np.zeros((1, 3)), self._places[rows])),
                skin_weights=_weights(skin, used, [row, *self._other[rows]]),
                color=colors[row],
                receive_shadow=False,
            )
            self._handles[row] = handle
        self._bones = [self._bone(number) for number in range(len(self._own))]

    def _bone(self, number: int) -> tuple[viser.MeshSkinnedHandle | None, int]:
        """The mesh that a bone moves, and its number there, below which is the own link's."""
        row = int(self._own[number])
        return self._handles.get(row), 1 + int((self._own[:number] == row).sum())

    def handle(self, row: int) -> viser.MeshSkinnedHandle | None:
        """What is seen of a link; None: nothing."""
        return self._handles.get(row)

    def _poses(self, origins: FloatArray, turns_xyzw: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Where the bones are in the frames of their meshes: (b, 3), m, and (b, 4), wxyz."""
        back, turns = rotations.conjugate(turns_xyzw[self._own]), turns_xyzw[self._other]
        ways = origins[self._other] + rotations.rotate(turns, self._anchors) - origins[self._own]
        relative = rotations.multiply(back, turns)
        return rotations.rotate(back, ways), rotations.wxyz_from_xyzw(relative)

    def bend(self, origins: FloatArray, turns_xyzw: FloatArray) -> None:
        """Have it follow the links: origins (l, 3), m, and orientations (l, 4)."""
        places, turns = self._poses(origins, turns_xyzw)
        moved = np.abs(places - self._places).max(axis=1) > _STILL
        turned = np.abs(turns - self._turns).max(axis=1) > _UNTURNED
        self._places[moved], self._turns[turned] = places[moved], turns[turned]
        for number in np.flatnonzero(moved | turned).tolist():
            handle, bone = self._bones[number]
            if handle is None:
                continue
            impl = handle._impl
            send = impl.api._queue_scene_message
            if turned[number]:
                turn = tuple(turns[number].tolist())
                send(SetBoneOrientationMessage(impl.name, bone, turn))
            if moved[number]:
                send(SetBonePositionMessage(impl.name, bone, tuple(places[number].tolist())))


class GhostSkin:
    """A reference: the inner side of a skin that is a little wider, which bodies before it hide.

    The mesh goes along with the root: a page that draws slowly moves bones sooner than nodes, and
    would show a reference that runs ahead of the body.
    """

    def __init__(self, scene: viser.SceneApi, name: str, skin: Skin, color: Color) -> None:
        """Add it as one mesh."""
        surface, root = skin.surface, skin.origins[0]
        self.handle = scene.add_mesh_skinned(
            name,
            surface.vertices + _OUTLINE_WIDTH * surface.normals - root,
            surface.triangles,
            bone_wxyzs=rotations.wxyz_from_xyzw(skin.turns_xyzw),
            bone_positions=skin.origins - root,
            skin_weights=_weights(skin, np.arange(len(skin.bones)), range(len(skin.origins))),
            color=color,
            side="back",
            opacity=_OPACITY,
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

    def bend(self, origins: FloatArray, turns_xyzw: FloatArray) -> None:
        """Have it follow the links: origins (l, 3), m, world, and orientations (l, 4)."""
        impl, root = self.handle._impl, origins[0]
        self.handle.position = root
        turns = rotations.wxyz_from_xyzw(turns_xyzw).tolist()
        for bone, (place, turn) in enumerate(zip((origins - root).tolist(), turns, strict=True)):
            impl.api._queue_scene_message(SetBonePositionMessage(impl.name, bone, tuple(place)))
            impl.api._queue_scene_message(SetBoneOrientationMessage(impl.name, bone, tuple(turn)))


def _joined(character: Character, skin: Skin) -> tuple[list[tuple[int, int]], list[FloatArray]]:
    """Each link with each one joined to it; with that the joint's place in the other one, m."""
    joined, anchors = [], []
    for child, link in enumerate(character.links):
        if link.parent >= 0:
            back = rotations.conjugate(skin.turns_xyzw[link.parent])
            way = skin.origins[child] - skin.origins[link.parent]
            joined += [(link.parent, child), (child, link.parent)]
            anchors += [np.zeros(3), rotations.rotate(back, way)]
    return joined, anchors


def _piece(skin: Skin, row: int) -> tuple[FloatArray, IntArray, IntArray]:
    """A link's mesh with a rim around it: vertices (m, 3) in its frame, m; triangles (k, 3).

    Then the numbers (m,) that these vertices have in the whole skin.
    """
    triangles, own = skin.surface.triangles, skin.owners == row
    is_inner = np.zeros(len(skin.surface.vertices), dtype=np.bool_)
    is_inner[triangles[own]] = True
    used, faces = np.unique(triangles[is_inner[triangles].any(axis=1)], return_inverse=True)
    sunk = np.where(is_inner[used], 0.0, _SUNK)[:, np.newaxis]
    vertices = skin.surface.vertices[used] - sunk * skin.surface.normals[used]
    back = rotations.conjugate(skin.turns_xyzw[row])
    return rotations.rotate(back, vertices - skin.origins[row]), faces.reshape(-1, 3), used


def _weights(skin: Skin, vertices: IntArray, rows: Sequence[int]) -> FloatArray:
    """Of some vertices (m,) how much they follow links (b,), of sum one (m, b)."""
    whole = np.zeros((len(vertices), len(skin.origins)))
    for bone in range(skin.bones.shape[1]):
        whole[np.arange(len(vertices)), skin.bones[vertices, bone]] += skin.weights[vertices, bone]
    weights = whole[:, list(rows)]
    total = weights.sum(axis=1, keepdims=True)
    weights[total[:, 0] == 0.0, 0], total[total == 0.0] = 1.0, 1.0
    shares: FloatArray = weights / total
    return shares
