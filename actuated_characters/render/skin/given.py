"""A user's own skinned mesh as a character's skin.

Its joints are where links are; what lies between differs in length and in pose. So the character is
put into the pose in which the mesh was bound: each of its links is turned so that it points to the
next joints as the mesh does. There the mesh is scaled around each joint, as much as the way to the
next ones differs. What the character then does moves it as any skin.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actuated_characters.render.skin.skin import Skin, strongest
from character_motion.export.upright import UPRIGHT_XYZW
from character_motion.gltf.reading import GlbFile
from character_motion.gltf.skinned_mesh import SkinnedMesh, read_skinned_mesh
from character_motion.retargeting.conventions import quaternion
from character_motion.retargeting.skin_joints import (
    GivenLinks,
    find_skin_joints,
    joint_centres,
    read_skin_map,
)
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import still_model
from msgs_config.character.lowest_points import lowest_heights
from msgs_config.character.model import Character
from msgs_config.errors import SkinError
from msgs_config.geometry import rotations
from msgs_config.geometry.surface import Surface

_FROM_PARENT = 1e-6  # how much the parent's turn counts where others say something: about a bone
_SAME_POSE = 0.5  # rad: a parent's turn that is less is of other bones, not of another pose
_MOST_SCALE = 1.6  # of a link, in scales of the whole body, or so many times less


@dataclass(frozen=True, eq=False)
class GivenSkin:
    """A mesh from a file, which is not that of one character alone."""

    path: Path
    mesh: SkinnedMesh
    links: GivenLinks

    @classmethod
    def read(cls, path: Path, map_path: Path | None = None) -> "GivenSkin":
        """Read a .glb file, and a YAML file that says which joint is which link's.

        Raises:
            SkinError: one of them cannot be used.
        """
        mesh = read_skinned_mesh(GlbFile.read(path))
        return cls(path, mesh, {} if map_path is None else read_skin_map(map_path))

    def fitted(self, character: Character) -> Skin:
        """The mesh as a character's skin.

        Raises:
            SkinError: its joints are not those of the character.
        """
        mesh = self.mesh
        joints = find_skin_joints(
            self.path, mesh.names, mesh.parents, mesh.places, character, self.links
        )
        return _Fit(self, character, joints).skin()


class _Fit:
    """Puts a character into the pose of a mesh. The world's z is up, and x ahead."""

    def __init__(self, given: GivenSkin, character: Character, joints: Mapping[int, int]) -> None:
        self._mesh, self._character, self._joints = given.mesh, character, joints
        back = rotations.conjugate(UPRIGHT_XYZW)
        self._places = rotations.rotate(back, given.mesh.places)
        vertices = rotations.rotate(back, given.mesh.surface.vertices)
        normals = rotations.rotate(back, given.mesh.surface.normals)
        self._surface = Surface(vertices, normals, given.mesh.surface.triangles)
        rest = np.array(character.rest_position)
        root = character.layout.joints[0].entries
        if character.layout.has_floating_base:
            rest[root] = 0.0
            if character.up_axis == "y":
                rest[root.start + 3 : root.stop] = rotations.log(
                    rotations.ABOUT_X_QUARTER_TURN_XYZW
                )
        model = still_model(character, rest)
        self._origins, self._turns = model.link_poses()
        self._centres = joint_centres(character, self._origins, self._turns)
        self._lowest = lowest_heights(character, model)
        self._top = min(joints)
        self._parents = [link.parent for link in character.links]
        self._next = [self._next_joints(row) for row in range(len(self._parents))]
        self._whole = self._whole_scale(given.path)

    def _next_joints(self, row: int) -> list[int]:
        """The links with joints that a link leads to, with none between them."""
        found: list[int] = []
        waiting = [row]
        while waiting:
            above = waiting.pop()
            for child, parent in enumerate(self._parents):
                if parent == above:
                    (found if child in self._joints else waiting).append(child)
        return found

    def _ways(self, row: int) -> tuple[FloatArray, FloatArray]:
        """From a link's joint to the next ones (k, 3): the character's at rest, m; the mesh's."""
        after = self._next[row]
        own = self._centres[after] - self._centres[row]
        joints = [self._joints[each] for each in after]
        theirs = self._places[joints] - self._places[self._joints[row]]
        return own.reshape(-1, 3), theirs.reshape(-1, 3)

    def _whole_scale(self, path: Path) -> float:
        """The character's length over the mesh's, along all joints."""
        ways = [self._ways(row) for row in self._joints]
        own, theirs = (
            sum(float(np.linalg.norm(each[k], axis=1).sum()) for each in ways) for k in (0, 1)
        )
        if not own > 0.0 or not theirs > 0.0:
            raise SkinError(f"{path}: the joints that are links' are all at one place")
        return own / theirs

    def skin(self) -> Skin:
        """The mesh around the character in the mesh's pose."""
        turned = self._turned()
        origins = self._placed(turned)
        weights = self._weights()
        vertices = np.zeros_like(self._surface.vertices)
        for row, joint in self._joints.items():
            ways = self._surface.vertices - self._places[joint]
            centre = origins[row] + self._from_origin(turned, row)
            vertices += weights[:, row, np.newaxis] * (centre + self._scale(row) * ways)
        corners = weights[self._surface.triangles].sum(axis=1)
        return Skin(
            self._surface._replace(vertices=vertices),
            np.argmax(corners, axis=1),
            *strongest(weights),
            origins,
            rotations.multiply(turned, self._turns),
            self._mesh.colors,
        )

    def _turned(self) -> FloatArray:
        """How each link (l, 4) is turned in the mesh's pose against its own pose at rest."""
        turns = np.tile(rotations.IDENTITY_XYZW, (len(self._parents), 1))
        for row, parent in enumerate(self._parents):
            above = turns[parent] if parent >= 0 else turns[row]
            turns[row] = above
            if row in self._joints and self._next[row]:
                turns[row] = _aligned(*self._ways(row), above)
            elif row in self._joints:  # nothing says how a hand, a foot or a head is turned
                level = rotations.about_z(float(rotations.yaw(turns[self._top])))
                if rotations.angle_between(above, level) < _SAME_POSE:
                    turns[row] = level
        return turns

    def _placed(self, turned: FloatArray) -> FloatArray:
        """Where the links (l, 3) are then, m, the first with a joint where that joint is."""
        origins = np.zeros_like(self._origins)
        row = self._top
        origins[row] = self._places[self._joints[row]] - self._from_origin(turned, row)
        above = [row]
        while (parent := self._parents[above[-1]]) >= 0:
            way = self._origins[above[-1]] - self._origins[parent]
            origins[parent] = origins[above[-1]] - rotations.rotate(turned[parent], way)
            above.append(parent)
        for row, parent in enumerate(self._parents):
            if row not in above:
                way = self._origins[row] - self._origins[parent]
                origins[row] = origins[parent] + rotations.rotate(turned[parent], way)
        return origins

    def _from_origin(self, turned: FloatArray, row: int) -> FloatArray:
        """The way (3,) from a link's origin to the centre of its joint then, m."""
        return rotations.rotate(turned[row], self._centres[row] - self._origins[row])

    def _scale(self, row: int) -> float:
        """By how much the mesh grows around a link's joint."""
        own, theirs = (float(np.linalg.norm(each, axis=1).sum()) for each in self._ways(row))
        if self._character.links[row].name in self._character.feet and not self._next[row]:
            own = float(self._centres[row, 2] - self._lowest[row])
            theirs = float(self._places[self._joints[row], 2] - self._surface.vertices[:, 2].min())
        if not (own > 0.0 and theirs > 0.0):
            return self._whole
        share = own / theirs / self._whole
        return self._whole * min(max(share, 1.0 / _MOST_SCALE), _MOST_SCALE)

    def _weights(self) -> FloatArray:
        """How much each vertex follows each link (m, l): a joint that is none's, as its parent."""
        mesh, own = self._mesh, {joint: row for row, joint in self._joints.items()}
        links = np.empty(len(mesh.names), dtype=np.intp)
        for joint, parent in enumerate(mesh.parents):
            links[joint] = own.get(joint, links[parent] if parent >= 0 else self._top)
        weights = np.zeros((len(mesh.weights), len(self._parents)))
        rows = np.arange(len(weights))
        for k in range(mesh.weights.shape[1]):
            weights[rows, links[mesh.joints[:, k]]] += mesh.weights[:, k]
        return weights


def _aligned(own: FloatArray, theirs: FloatArray, above_xyzw: FloatArray) -> FloatArray:
    """The turn (4,) that leads directions (k, 3) nearest to others, about them as the parent's.

    Source: Wahba 1965, by singular values (Markley 1988, "Attitude determination using vector
    observations and the singular value decomposition").
    """
    lengths = [np.linalg.norm(each, axis=1, keepdims=True) for each in (own, theirs)]
    there = (lengths[0] > 0.0)[:, 0] & (lengths[1] > 0.0)[:, 0]
    a, b = own[there] / lengths[0][there], theirs[there] / lengths[1][there]
    left, _, right = np.linalg.svd(b.T @ a + _FROM_PARENT * rotations.matrix(above_xyzw))
    left[:, 2] *= np.sign(np.linalg.det(left @ right))
    turn: FloatArray = quaternion(left @ right)
    return turn
