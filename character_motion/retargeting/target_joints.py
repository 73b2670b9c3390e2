"""Which link of a character is which segment of a body, and where its joints' centres are.

A robot's hip is two or three hinges that cross, each with a link; the thigh is the last of these
links, the hip's centre the point that the hinges' axes are nearest to.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from character_motion.retargeting.joint_names import (
    ARM,
    LEG,
    side_and_part,
)
from character_motion.retargeting.skeleton_map import SIDES, SkeletonMap, find_map
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character, Link
from msgs_config.errors import ClipError, one_of
from msgs_config.geometry import rotations

_PARALLEL_AXES = 1e-3  # smallest singular value over the largest, below which axes are parallel
_ROLES_OF_PARTS = {
    part: role for chain in (LEG, ARM) for role, parts in chain for part in parts
}  # the last role that a part may be
_ARM_ROLES, _LEG_ROLES = ("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle")
_LIMBS_BY_ORDER = (("leg", _LEG_ROLES, 5), ("arm", _ARM_ROLES, 4))
"""Limbs whose joints may have numbers for names, and from how many on: three, one, and the rest."""
Parts = Sequence[Sequence[tuple[str, str]]]
"""Of each link, the side and part that the names of its joint and of itself say."""


@dataclass(frozen=True)
class TargetJoints:
    """The segments of a character, and the hinges or ball joints that turn each of them."""

    map: SkeletonMap  # the link of each segment
    joints: Mapping[str, tuple[int, ...]]  # links whose joints lead to it from the segment above

    def centre(
        self, role: str, links: Sequence[Link], origins: FloatArray, turns_xyzw: FloatArray
    ) -> FloatArray:
        """The centre (3,) of a segment's joints in a pose, m; origins (l, 3), turns (l, 4)."""
        hinges = self.joints.get(role, ())
        if not hinges:
            place: FloatArray = origins[self.map[role]]
            return place
        points = origins[list(hinges)]
        axes = [
            rotations.rotate(turns_xyzw[row], np.array(links[row].joint.axis_in_child))
            for row in hinges
            if links[row].joint.type is JointType.REVOLUTE
        ]
        if len(hinges) == 1 or len(axes) < len(hinges):
            place = points[0]
            return place
        return _nearest_to_lines(points, np.array(axes))

    def hinges(self, links: Sequence[Link], role: str) -> list[int]:
        """The links whose hinges lead to a segment from the one above."""
        return [
            row for row in self.joints.get(role, ()) if links[row].joint.type is JointType.REVOLUTE
        ]


def find_target_joints(character: Character, given: Mapping[str, str] | None) -> TargetJoints:
    """The segments of a character, by the names of its links and joints and by the tree.

    Args:
        character: Any.
        given: Names of links or joints by role, which take precedence.

    Raises:
        ClipError: a segment that is needed is not found, or a name that is given does not exist.
    """
    links, place = character.links, f"character '{character.name}'"
    parents = [link.parent for link in links]
    parts = [
        tuple(side_and_part(name, of_robot=True) for name in (link.joint.name, link.name))
        for link in links
    ]
    by_link = _numbered(links, parts)
    by_link |= {role: _link_name(place, links, name) for role, name in (given or {}).items()}
    nearest = find_map(
        place, [link.name for link in links], parents, by_link, parts=parts, arms=False
    )
    return _with_segments(links, nearest, parts)


def _link_name(place: str, links: Sequence[Link], name: str) -> str:
    """The name of a link by its own name or by that of the joint above it."""
    known = {link.joint.name: link.name for link in links} | {
        link.name: link.name for link in links
    }
    if name not in known:
        raise ClipError(f"{place}: map: {one_of('link or joint', name, list(known))}")
    return known[name]


def _numbered(links: Sequence[Link], parts: Parts) -> dict[str, str]:
    """Links by role of legs and arms whose joints are called `leg_l1_joint` to `leg_l6_joint`."""
    found: dict[str, str] = {}
    for side in SIDES:
        for word, roles, least in _LIMBS_BY_ORDER:
            row = [
                link.name
                for link, names in zip(links, parts, strict=True)
                if link.joint.type is not JointType.FIXED
                and any(own == side and part in (word, f"z{word}") for own, part in names)
            ]
            if len(row) >= least:
                after = 2 if word == "leg" else 1  # a foot follows a knee, a hand need not
                knee = min(3, len(row) - after)
                chosen = (row[0], row[knee], *row[knee + 1 : knee + 2])
                found |= {f"{side}_{role}": name for role, name in zip(roles, chosen, strict=False)}
    return found


def _with_segments(links: Sequence[Link], nearest: SkeletonMap, parts: Parts) -> TargetJoints:
    """The segments of the links at which each part of a body begins."""
    segments = dict(nearest.joints)
    joints: dict[str, tuple[int, ...]] = {}
    for side in SIDES:
        for chain, root in ((_LEG_ROLES, "pelvis"), (_ARM_ROLES, "chest")):
            above = nearest[root]
            for part, below in zip(chain, (*chain[1:], ""), strict=True):
                role, next_role = f"{side}_{part}", f"{side}_{below}"
                if role not in nearest:
                    continue
                if next_role in nearest:
                    segments[role] = links[nearest[next_role]].parent
                elif part != "wrist":
                    segments[role] = _last_of(links, nearest[role], part, parts)
                joints[role] = _moving_between(links, above, segments[role])
                above = segments[role]
    for role, below in (("head", "chest"), ("chest", "pelvis")):
        if role in segments and not _moving_between(links, nearest[below], nearest[role]):
            del segments[role]  # it moves with the segment below
    return TargetJoints(SkeletonMap(segments), joints)


def _last_of(links: Sequence[Link], link: int, part: str, parts: Parts) -> int:
    """The last link of a limb's end: its hinges follow each other, up to toes or another part."""
    while True:
        following = [
            row
            for row, each in enumerate(links)
            if each.parent == link and each.joint.type is not JointType.FIXED
        ]
        if len(following) != 1:
            return link
        names = {name for _, name in parts[following[0]]}
        if any(name.startswith("toe") for name in names):
            return link
        if part != "ankle" and not any(_ROLES_OF_PARTS.get(name) == part for name in names):
            return link
        link = following[0]


def _moving_between(links: Sequence[Link], above: int, below: int) -> tuple[int, ...]:
    """The links from below one to another whose joints move, from above on; empty if it is not."""
    row = []
    while below not in (above, -1):
        if links[below].joint.type is not JointType.FIXED:
            row.append(below)
        below = links[below].parent
    return tuple(reversed(row))


def _nearest_to_lines(points: FloatArray, axes: FloatArray) -> FloatArray:
    """The point (3,) that lines through points (k, 3) along axes (k, 3) are nearest to, m.

    Where all lines are parallel it is beside their points' mean.
    """
    across = np.eye(3) - axes[:, :, np.newaxis] * axes[:, np.newaxis]
    mean = points.mean(axis=0)
    missing = np.matmul(across, (points - mean)[..., np.newaxis])[..., 0].sum(axis=0)
    offset, *_ = np.linalg.lstsq(across.sum(axis=0), missing, rcond=_PARALLEL_AXES)
    nearest: FloatArray = mean + offset
    return nearest
