"""The mass matrix of a character in a pose, from its links' masses and frames; numpy alone.

The simulator needs it where an effort of its own must not be explicit, as those of soft limits
(`sim_node/passive.py`). With Jacobians `Jv` and `Jw` of each link's centre of mass it is
`M = sum m Jv^T Jv + Jw^T I Jw` (Featherstone 2008, "Rigid Body Dynamics Algorithms", section 6.1).
All is worked out in the base link's frame, as neither place nor turn of the base matter: a floating
base's first three columns are its velocity in its own axes, not in the world's. No BLAS is used.
"""

import numpy as np

from msgs_config import rotations
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character import Character
from msgs_config.geometry import fixed_order
from msgs_config.joint_layout import JointType

_TURNING = (JointType.REVOLUTE, JointType.SPHERICAL, JointType.FLOATING)


class MassMatrix:
    """The mass matrix of one character."""

    def __init__(self, character: Character) -> None:
        links, layout = character.links, character.layout
        shape = (len(links), 3, layout.size)
        self._parents = [link.parent for link in links]
        self._slides, self._turns = np.zeros(shape), np.zeros(shape)  # own axes of each entry
        for index, link in enumerate(links):
            joint = link.joint
            if joint.type is JointType.FIXED:
                continue
            entries = layout.joint(joint.name).entries
            axes = np.eye(3)
            if joint.type in (JointType.REVOLUTE, JointType.PRISMATIC):
                axes = np.array(joint.axis_in_child)[:, np.newaxis]
            if joint.type is JointType.FLOATING:
                self._slides[index][:, entries.start : entries.start + 3] = axes
                entries = slice(entries.start + 3, entries.stop)
            moved = self._turns if joint.type in _TURNING else self._slides
            moved[index][:, entries] = axes
        own = np.abs(self._turns).sum(axis=1) + np.abs(self._slides).sum(axis=1) > 0.0
        self._owners = np.argmax(own, axis=0)  # (n,) the link of each entry's joint
        self._moves = self._inherited(own)
        poses = [link.joint.pose_in_parent for link in links]
        self._offsets = np.array([pose.position for pose in poses])
        self._fixed = rotations.matrix(np.array([pose.orientation_xyzw for pose in poses]))
        inertial = [link.inertial_pose for link in links]
        self._centres = np.array([pose.position for pose in inertial])
        self._principal = rotations.matrix(np.array([pose.orientation_xyzw for pose in inertial]))
        self._root_masses = np.sqrt([link.mass for link in links])[:, np.newaxis, np.newaxis]
        diagonals = np.array([link.inertia_diagonal for link in links])
        self._root_inertias = np.sqrt(diagonals)[:, :, np.newaxis]

    def _inherited(self, own: BoolArray) -> FloatArray:
        """Whether (links, 1, n), 1 or 0, an entry moves a link: its own, or one that carries it."""
        moves = own.copy()
        for index, parent in enumerate(self._parents):
            if parent >= 0:
                moves[index] |= moves[parent]
        inherited: FloatArray = moves[:, np.newaxis, :].astype(float)
        return inherited

    def at(self, position: FloatArray) -> FloatArray:
        """The mass matrix (n, n) at a position (n,) in message form."""
        axes, origins = self._frames(position)
        centres = origins + fixed_order.apply(axes, self._centres)
        turns = np.einsum("lij,ljn->in", axes, self._turns)  # each entry is one link's own
        slides = np.einsum("lij,ljn->in", axes, self._slides)
        arms = centres[:, :, np.newaxis] - origins[self._owners].T
        linear = self._moves * (slides + np.cross(turns[np.newaxis], arms, axis=1))
        principal = np.einsum("lij,ljk->lki", axes, self._principal)  # transposed
        angular = np.einsum("lij,ljn->lin", principal, self._moves * turns)
        rows = np.concatenate((self._root_masses * linear, self._root_inertias * angular))
        rows = rows.reshape(-1, rows.shape[-1])
        matrix: FloatArray = np.einsum("rm,rn->mn", rows, rows)
        return matrix

    def _frames(self, position: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Axes (links, 3, 3) and origins (links, 3) of the links in the base link's frame."""
        turned = rotations.matrix(rotations.exp(np.einsum("lin,n->li", self._turns, position)))
        slid = np.einsum("lin,n->li", self._slides, position)
        turned = np.einsum("lij,ljk->lik", self._fixed, turned)
        moved = self._offsets + fixed_order.apply(self._fixed, slid)
        axes, origins = np.empty_like(turned), np.zeros_like(moved)
        axes[0] = np.eye(3)
        for index, parent in enumerate(self._parents):
            if parent >= 0:
                axes[index] = np.einsum("ij,jk->ik", axes[parent], turned[index])
                origins[index] = origins[parent] + fixed_order.apply(axes[parent], moved[index])
        return axes, origins


def yielding(matrix: FloatArray, rows: FloatArray) -> FloatArray:
    """`J M^-1 J^T` (m, m) of a mass matrix (n, n) and rows J (m, n): what each row's force moves.

    By elimination of M from the bordered matrix (M, J^T; J, 0), whose Schur complement it is but
    for its sign; M is positive definite, so no pivots are looked for.
    """
    size, count = len(matrix), len(rows)
    bordered = np.zeros((size + count, size + count))
    bordered[:size, :size] = matrix
    bordered[:size, size:], bordered[size:, :size] = rows.T, rows
    for pivot in range(size):
        rest = bordered[pivot + 1 :, pivot + 1 :]
        column = bordered[pivot + 1 :, pivot]
        rest -= column[:, np.newaxis] * (bordered[pivot, pivot + 1 :] / bordered[pivot, pivot])
    schur: FloatArray = -bordered[size:, size:]
    return schur
