"""Which joint of a skinned mesh moves with which link of a character."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from character_motion.retargeting.skeleton_map import ROLES, ancestors, find_map
from character_motion.retargeting.target_joints import find_target_joints
from msgs_config import files
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import still_model
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.errors import ClipError, SkinError, one_of
from msgs_config.mappings import MappingReader

_SHOWN_NAMES, _SHOWN_LETTERS = 40, 60
_SHOULDERS = ("left_shoulder", "right_shoulder")

GivenLinks = Mapping[str, str | None]
"""Joints by the names of links; None: the link has no joint."""


def read_skin_map(path: Path) -> GivenLinks:
    """A YAML file of joints by links, such as `left_knee: LeftLeg`; empty for a link without one.

    Raises:
        SkinError: it cannot be read, or is no such mapping.
    """
    content = files.parse_yaml_mapping(path, files.read_text(path, SkinError), SkinError)
    reader = MappingReader(path, content, SkinError)
    return {
        str(link): None if joint is None else reader.text(link) for link, joint in content.items()
    }


def find_skin_joints(
    place: object,
    names: Sequence[str],
    parents: Sequence[int],
    places: FloatArray,
    character: Character,
    given: GivenLinks,
) -> dict[int, int]:
    """The joint of each link that has one, by their numbers; a joint moves with one link.

    What is given counts first, then the parts of a body on two legs, then equal names. The joints
    of a spine have no fixed names: the chest's is the one that is as high as the character's.

    Args:
        place: The file that the joints come from, for errors.
        names: Of the joints (j,).
        parents: Index of each joint's parent, -1 of a root; parents come first.
        places: Of the joints (j, 3), in any unit.
        character: Whose links.
        given: Joints by links.

    Raises:
        SkinError: a name that is given does not exist, or a link that moves has no joint.
    """
    links = [link.name for link in character.links]
    found = _given_joints(place, names, links, given)
    left_out = {links.index(link) for link in given}
    roles = _by_role(names, parents, places, character, given)
    for row, number in (*roles, *_by_name(names, links)):
        if row not in left_out and row not in found and number not in found.values():
            found[row] = number
    missing = [
        link.name
        for row, link in enumerate(character.links)
        if link.joint.type not in (JointType.FIXED, JointType.FLOATING)
        and row not in found
        and row not in left_out
    ]
    if (missing and not roles) or not found:
        missing = missing or links
        raise SkinError(
            f"{place}: no joint found for {', '.join(missing)}; name them in a file for "
            f"--skin-map, such as '{missing[0]}: NAME'; joints: {', '.join(_shown(names))}"
        )
    return found


def _given_joints(
    place: object, names: Sequence[str], links: Sequence[str], given: GivenLinks
) -> dict[int, int]:
    """The joints that are given, by the numbers of links."""
    found: dict[int, int] = {}
    for link, joint in given.items():
        if link not in links:
            raise SkinError(f"{place}: skin map: {one_of('link', link, list(links))}")
        if joint is None:
            continue
        if joint not in names:
            raise SkinError(f"{place}: skin map: {link}: {one_of('joint', joint, _shown(names))}")
        number = list(names).index(joint)
        if number in found.values():
            (shown,) = _shown([joint])
            raise SkinError(f"{place}: skin map: {link}: another link has joint '{shown}'")
        found[links.index(link)] = number
    return found


def joint_centres(character: Character, origins: FloatArray, turns_xyzw: FloatArray) -> FloatArray:
    """The point (l, 3) about which each link turns, in a pose of link frames, m.

    It is the frame's origin, but where several hinges that cross are one joint of a body.

    Args:
        character: Whose links.
        origins: Of their frames (l, 3), m.
        turns_xyzw: Of these (l, 4).
    """
    centres = origins.copy()
    try:
        target = find_target_joints(character, None)
    except ClipError:
        return centres
    for role, row in target.map.joints.items():
        if len(target.joints.get(role, ())) > 1:
            centres[row] = target.centre(role, character.links, origins, turns_xyzw)
    return centres


def _by_role(
    names: Sequence[str],
    parents: Sequence[int],
    places: FloatArray,
    character: Character,
    given: GivenLinks,
) -> list[tuple[int, int]]:
    """Links with joints that are the same part of a body on two legs; none if one is no such."""
    # What several trees hang on may be no joint of the skin; here it is the first joint.
    parents = [-1, *(max(parent, 0) for parent in parents[1:])]
    try:
        found = find_target_joints(character, None)
        # A hinge of a shoulder may be called as a collar is.
        hinges = {row: role for role, rows in found.joints.items() for row in rows}
        target = {
            role: row for role, row in found.map.joints.items() if hinges.get(row, role) == role
        }
        told = {role: given.get(character.links[row].name) for role, row in target.items()}
        known = {role: joint for role, joint in told.items() if joint is not None}
        own = dict(find_map("", names, parents, known).joints)
    except ClipError:
        return []
    if _SHOULDERS[0] in target and _SHOULDERS[1] in target and "chest" in target:
        rest = still_model(character, np.array(character.rest_position)).link_poses()[0]
        share = _height_of(target["chest"], target, rest)
        below = ancestors(own["pelvis"], parents)
        spine = [joint for joint in ancestors(own["chest"], parents) if joint not in below]
        own["chest"] = min(
            spine or [own["chest"]], key=lambda joint: abs(_height_of(joint, own, places) - share)
        )
    return [(target[role], own[role]) for role in ROLES if role in own and role in target]


def _height_of(joint: int, roles: Mapping[str, int], places: FloatArray) -> float:
    """How far a joint of the trunk is from the pelvis, as a share of the way to the shoulders."""
    pelvis = places[roles["pelvis"]]
    shoulders = 0.5 * (places[roles[_SHOULDERS[0]]] + places[roles[_SHOULDERS[1]]])
    way = float(np.linalg.norm(shoulders - pelvis))
    return float(np.linalg.norm(places[joint] - pelvis)) / max(way, np.finfo(float).tiny)


def _by_name(names: Sequence[str], links: Sequence[str]) -> list[tuple[int, int]]:
    """Links with joints of the same name, but for what stands before a colon, and for case."""
    plain = [_plain(name) for name in names]
    return [
        (row, plain.index(_plain(link))) for row, link in enumerate(links) if _plain(link) in plain
    ]


def _shown(names: Sequence[str]) -> list[str]:
    """The first of some names, each cut, with nothing in them that a terminal would obey."""
    escaped = [repr(name[:_SHOWN_LETTERS])[1:-1] for name in names[:_SHOWN_NAMES]]
    return [name[:_SHOWN_LETTERS] for name in escaped]


def _plain(name: str) -> str:
    return re.sub(r"[\W_]", "", re.split(r"[:|]", name)[-1]).lower()
