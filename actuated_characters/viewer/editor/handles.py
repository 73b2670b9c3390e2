"""What of a character is taken by the pointer, which of its links stand, and what may move."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller_node.references.posing import REACHED_M, Posed, Posing, Target
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import GeneralizedPosition, JointType
from msgs_config.character.lowest_points import lowest_heights
from msgs_config.character.model import Character, Vector

_BEND_RAD = 0.3  # of hinges that are tried bent
_STANDS_BELOW_M = 0.05  # height of a link's lowest point, from which on it does not stand


@dataclass(frozen=True)
class Handle:
    """A point of a link."""

    row: int  # of the link
    point: Vector  # m, in the link frame


def handles_of(character: Character) -> list[Handle]:
    """The handles of a character: its ends, its middle joints, and what carries several limbs.

    Of a humanoid hands, feet and head, elbows and knees, pelvis and chest.
    """
    links = character.links
    children = [[each.parent for each in links].count(row) for row in range(len(links))]
    handles = []
    for row, link in enumerate(links):
        is_base, is_end = link.parent < 0, children[row] == 0
        if is_base and link.joint.type is not JointType.FLOATING:
            continue
        is_limb_root = not is_base and children[link.parent] > 1 and children[row] == 1
        if is_limb_root or (link.joint.type is JointType.FIXED and not is_end):
            continue
        is_body = is_base or is_end or children[row] > 1
        handles.append(Handle(row, link.inertial_pose.position if is_body else (0.0, 0.0, 0.0)))
    return handles


def standing_links(character: Character, pose: GeneralizedPosition) -> tuple[str, ...]:
    """The feet, of what has none the ends, that are at the ground in a pose."""
    if not character.layout.has_floating_base:
        return ()
    model = DynamicsModel(character)
    model.update(pose.position, np.zeros(character.layout.size))
    heights = lowest_heights(character, model)
    names = [link.name for link in character.links]
    ends = character.feet or tuple(names[row] for row in character.end_effectors)
    return tuple(name for name in ends if heights[names.index(name)] < _STANDS_BELOW_M)


class Drag:
    """A point of a link that follows the pointer, from the pose in which it was taken.

    Of an arm or a leg the limb goes there alone, as far as it can; what is then missing is done by
    the whole body, from there on. Links that stand stay where they are, but for the one that is
    dragged. Without any the base stays, unless it is the one.
    """

    def __init__(
        self,
        posing: Posing,
        character: Character,
        pose: GeneralizedPosition,
        handle: Handle,
        *,
        limb_alone: bool,
        stands: Sequence[str],
    ) -> None:
        """`limb_alone`: nothing moves but the limb that the link is of; `stands`: links."""
        self._posing, self._pose, self._last = posing, pose, pose
        self._row, self._point = handle.row, handle.point
        self._link = character.links[handle.row].name
        self._is_base = character.links[handle.row].parent < 0
        self._holds = tuple(name for name in stands if name != self._link)
        self._limb = self._find_limb(character, limb_alone=limb_alone)
        self._has_body = self._limb is None or not limb_alone
        self._free = self._find_free(character)
        self._bends = self._find_bends(character)
        self.place = posing.place(pose, self._link, handle.point)
        """Where the point was (3,), m, world."""

    def _find_limb(self, character: Character, *, limb_alone: bool) -> BoolArray | None:
        """The degrees of freedom (n,) that go first; None of what is of no limb, or carries."""
        if self._is_base:
            return None
        layout, limb = character.layout, self._posing.chain(self._link)
        joints = [each for each in layout.joints if limb[each.entries].any()]
        carries = any((limb & self._posing.chain(name)).any() for name in self._holds)
        own = character.links[self._row].joint
        if own.type is JointType.SPHERICAL and self._row in character.end_effectors and joints[1:]:
            limb &= ~layout.mask([own.name])  # a foot keeps its turn against the leg
        return limb if limb_alone or (len(joints) > 1 and not carries) else None

    def _find_free(self, character: Character) -> BoolArray | None:
        """The degrees of freedom (n,) of the whole body; None: all."""
        layout = character.layout
        if not layout.has_floating_base or self._holds:
            return None
        root = layout.mask([layout.joints[0].name])
        return root if self._is_base else ~root

    def _find_bends(self, character: Character) -> FloatArray:
        """How far hinges go (n,), rad, to be bent into their range: of limbs that may have to."""
        layout, position = character.layout, self._pose.position
        lower, upper = character.position_bounds()
        hinges = [each.name for each in layout.joints if each.type is JointType.REVOLUTE]
        limbs = [self._posing.chain(name) for name in (self._link, *self._holds)]
        bent = np.any(limbs, axis=0) & layout.mask(hinges)
        inwards = upper - position >= position - lower
        bends: FloatArray = np.where(bent, np.where(inwards, _BEND_RAD, -_BEND_RAD), 0.0)
        return bends

    def pose(self, place: FloatArray) -> GeneralizedPosition:
        """The pose with the point at a place (3,), m, world, or as near as it can come."""
        x, y, z = place.tolist()
        target, near = Target(self._link, (x, y, z), self._point), self._pose
        if self._limb is not None:
            found = self._fit(near, target, self._limb, ())
            near = found.pose
        if self._has_body and (self._limb is None or not found.reached):
            found = self._fit(near, target, self._free, self._holds)
        self._last = found.pose
        return found.pose

    def _fit(
        self,
        near: GeneralizedPosition,
        target: Target,
        free: BoolArray | None,
        holds: Sequence[str],
    ) -> Posed:
        """The nearest pose to one; a straight limb is bent first where that helps."""
        last = self._last
        found = self._posing.fit(near, [target], free=free, holds=holds, start=last)
        if not found.reached:
            # no small turn of a straight limb brings its end nearer to its root
            bent = GeneralizedPosition(last.position + self._bends, last.orientations_xyzw)
            other = self._posing.fit(near, [target], free=free, holds=holds, start=bent)
            if other.residual < found.residual - REACHED_M:
                found = other
        return found
