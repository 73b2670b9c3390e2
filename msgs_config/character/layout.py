"""Which entry of a `JointState` array is which degree of freedom (DoF) of which joint."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.errors import LayoutError, one_of
from msgs_config.geometry import fixed_order, rotations

ROOT = "root"
"""Name of the floating base's joint to the world."""
_MAX_LISTS = 16  # lists of names whose indices are remembered


class JointType(Enum):
    """How a link moves against its parent."""

    FIXED = "fixed"
    REVOLUTE = "revolute"
    PRISMATIC = "prismatic"
    SPHERICAL = "spherical"
    FLOATING = "floating"

    @property
    def suffixes(self) -> tuple[str, ...]:
        """Suffix of each of the joint's entries, which follows the joint's name."""
        return _SUFFIXES[self]


SCALAR = (JointType.REVOLUTE, JointType.PRISMATIC)
"""The types whose position is one number, rad or m."""

_SUFFIXES = {
    JointType.FIXED: (),
    JointType.REVOLUTE: ("",),
    JointType.PRISMATIC: ("",),
    JointType.SPHERICAL: ("_x", "_y", "_z"),
    JointType.FLOATING: ("_x", "_y", "_z", "_rx", "_ry", "_rz"),
}


@dataclass(frozen=True)
class LayoutJoint:
    """One moving joint and the slice of the arrays that it owns."""

    name: str
    type: JointType
    start: int

    @property
    def entries(self) -> slice:
        """The joint's entries in position, velocity and effort."""
        return slice(self.start, self.start + len(self.type.suffixes))

    @property
    def dof_names(self) -> tuple[str, ...]:
        """Names of the joint's entries."""
        return tuple(self.name + suffix for suffix in self.type.suffixes)

    @property
    def rotation(self) -> slice | None:
        """The entries that are one rotation vector; None for hinges and sliders."""
        if self.type is JointType.SPHERICAL:
            return self.entries
        if self.type is JointType.FLOATING:
            return slice(self.start + 3, self.start + 6)
        return None

    @property
    def vectors(self) -> tuple[slice, ...]:
        """The entries that are one physical vector each: a floating base has force and torque."""
        if self.type is JointType.FLOATING:
            return (slice(self.start, self.start + 3), slice(self.start + 3, self.start + 6))
        return (self.entries,)


@dataclass(frozen=True)
class GeneralizedPosition:
    """A generalised position in message form, and its k rotations as quaternions."""

    position: FloatArray  # (..., n)
    orientations_xyzw: FloatArray  # (..., k, 4)


class JointLayout:
    """The order of all degrees of freedom of a character; `size` (n) entries.

    The floating base comes first, then the joints depth-first, as MuJoCo orders its own.
    Positions are message form: a rotation is a rotation vector, see docs/topics.md.
    """

    def __init__(
        self, joints: Iterable[tuple[str, JointType]], followers: Iterable[str] = ()
    ) -> None:
        """Place joints in order; `followers` are those of them that mimic others.

        Raises:
            LayoutError: two joints or degrees of freedom have the same name.
        """
        placed: list[LayoutJoint] = []
        start = 0
        for name, joint_type in joints:
            if joint_type is JointType.FIXED:
                continue
            placed.append(LayoutJoint(name, joint_type, start))
            start += len(joint_type.suffixes)
        self.joints = tuple(placed)
        self.followers = frozenset(followers)
        """The joints that no motor drives, because they mimic others."""
        self.dof_names = tuple(dof for joint in placed for dof in joint.dof_names)
        self.size = start
        self._index = {name: index for index, name in enumerate(self.dof_names)}
        self._joint = {joint.name: joint for joint in placed}
        self._found: dict[tuple[str, ...], IntArray] = {}  # the indices of lists of names
        if len(self._index) < start or len(self._joint) < len(placed):
            raise LayoutError("two joints or degrees of freedom have the same name")

    def __getstate__(self) -> dict[str, object]:
        """All but the indices that were asked for, which say who has asked."""
        return vars(self) | {"_found": {}}

    @property
    def joint_names(self) -> list[str]:
        """Names of the joints that move, in order."""
        return list(self._joint)

    @property
    def has_floating_base(self) -> bool:
        """Whether the first joint is the floating base `root`."""
        return bool(self.joints) and self.joints[0].type is JointType.FLOATING

    @property
    def actuated_joint_names(self) -> list[str]:
        """All joints but the floating base and followers, which no motor drives."""
        return [
            joint.name
            for joint in self.joints
            if joint.type is not JointType.FLOATING and joint.name not in self.followers
        ]

    def joint(self, name: str) -> LayoutJoint:
        """The joint of that name.

        Raises:
            LayoutError: there is none; the message lists those that exist.
        """
        if name not in self._joint:
            raise LayoutError(one_of("joint", name, self.joint_names))
        return self._joint[name]

    def mask(self, joint_names: Iterable[str]) -> BoolArray:
        """Mask (n,) of the entries of the joints named. Raises LayoutError on an unknown one."""
        mask = np.zeros(self.size, dtype=np.bool_)
        for name in joint_names:
            mask[self.joint(name).entries] = True
        return mask

    def indices(self, dof_names: tuple[str, ...]) -> IntArray:
        """Indices (m,) of the degrees of freedom named, in the order given.

        Raises:
            LayoutError: a name is unknown or repeated, or a part of a ball joint is missing.
        """
        found = self._found.get(dof_names)
        if found is None:
            if len(self._found) >= _MAX_LISTS:  # the same few come with every message
                self._found.clear()
            found = self._found[dof_names] = self._find_indices(dof_names)
        return found

    def _find_indices(self, dof_names: tuple[str, ...]) -> IntArray:
        for name in dof_names:
            if name not in self._index:
                raise LayoutError(one_of("degree of freedom", name, list(self.dof_names)))
        indices = np.array([self._index[name] for name in dof_names], dtype=np.intp)
        given = set(dof_names)
        if len(given) < len(dof_names):
            repeated = next(name for name in dof_names if dof_names.count(name) > 1)
            raise LayoutError(f"degree of freedom '{repeated}' is named twice")
        for joint in self.joints:
            missing = [name for name in joint.dof_names if name not in given]
            if missing and len(missing) < len(joint.dof_names):
                raise LayoutError(f"joint '{joint.name}' comes in parts: '{missing[0]}' is missing")
        return indices

    @cached_property
    def rotation_entries(self) -> IntArray:
        """Indices (k, 3) of the k rotation vectors among the positions."""
        slices = [joint.rotation for joint in self.joints if joint.rotation is not None]
        rows = [np.arange(entries.start, entries.stop) for entries in slices]
        return np.array(rows, dtype=np.intp).reshape(-1, 3)

    def configuration(self, position: FloatArray) -> "GeneralizedPosition":
        """A position (..., n) with its rotations as quaternions."""
        return GeneralizedPosition(position, rotations.exp(position[..., self.rotation_entries]))

    def difference(self, start: "GeneralizedPosition", end: "GeneralizedPosition") -> FloatArray:
        """Difference (..., n) from `start` to `end`: rad and m, a rotation in start's child frame.

        A rotation's part is `rotvec(q_start^-1 q_end)`, never a difference of components.
        """
        difference: FloatArray = end.position - start.position
        relative = rotations.multiply(
            rotations.conjugate(start.orientations_xyzw), end.orientations_xyzw
        )
        difference[..., self.rotation_entries] = rotations.log(relative)
        return difference

    @cached_property
    def vector_starts(self) -> IntArray:
        """First entry (b,) of each physical vector: hinge, ball, root force, root torque, ..."""
        return np.array([v.start for joint in self.joints for v in joint.vectors], dtype=np.intp)

    @cached_property
    def vector_lengths(self) -> IntArray:
        """Number of entries (b,) of each physical vector."""
        return np.diff(self.vector_starts, append=self.size)

    def norms(self, entries: FloatArray) -> FloatArray:
        """Length (..., b) of each physical vector among the entries (..., n), in their unit."""
        lengths: FloatArray = np.sqrt(self.vector_sums(entries * entries))
        return lengths

    def vector_sums(self, entries: FloatArray) -> FloatArray:
        """The sum (..., b) of each physical vector's entries, of (..., n)."""
        padded = np.concatenate((entries, np.zeros((*entries.shape[:-1], 1))), axis=-1)
        return fixed_order.total(padded.take(self._vector_entries, axis=-1))

    @cached_property
    def _vector_entries(self) -> IntArray:
        """Entries (b, 3) of each physical vector; one of a single entry has n, twice, beside it."""
        entries = self.vector_starts[:, np.newaxis] + np.arange(3)
        inside = np.arange(3) < self.vector_lengths[:, np.newaxis]
        return np.where(inside, entries, self.size)

    def clipped(self, effort: FloatArray, limits: FloatArray) -> FloatArray:
        """Effort (n,) with each vector's length at most its limit (b,), the direction kept."""
        with np.errstate(over="ignore"):
            norms = self.norms(effort)
        if not (norms > limits).any():
            return effort
        if np.isinf(norms).any():  # too large to be squared: measured in its own largest entry
            largest = np.maximum.reduceat(np.abs(effort), self.vector_starts)
            units = np.where(np.isinf(norms), largest, 1.0)
            norms = units * self.norms(effort / np.repeat(units, self.vector_lengths))
        too_long = norms > limits
        if not too_long.any():
            return effort
        scale = np.divide(limits, norms, out=np.ones_like(norms), where=too_long)
        clipped: FloatArray = effort * np.repeat(scale, self.vector_lengths)
        return clipped
