"""Joints of a URDF that follow others: `<mimic joint="leader" multiplier="a" offset="b"/>`."""

from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from msgs_config.character.urdf.limits import WITH_BOUNDS, read_bounds
from msgs_config.errors import CharacterError, one_of

_FOLLOWERS = ("revolute", "continuous", "prismatic")


class Mimic(NamedTuple):
    """A joint's position as `multiplier` times its leader's plus `offset`, rad or m."""

    leader: str
    multiplier: float
    offset: float


def read_mimics(path: Path, robot: ElementTree.Element, scale: float) -> dict[str, Mimic]:
    """What each follower mimics, by its name, with the lengths scaled; of a chain the first leader.

    A leader is a hinge, a slider or a fixed joint, which is at 0.

    Raises:
        CharacterError: a leader does not exist, has another number of positions than one, or
            follows its own follower.
    """
    types = {joint.get("name", ""): joint.get("type", "") for joint in robot.findall("joint")}
    units = {name: scale if kind == "prismatic" else 1.0 for name, kind in types.items()}
    own = {}
    for joint in robot.findall("joint"):
        element, name = joint.find("mimic"), joint.get("name", "")
        if element is None or types[name] == "fixed":
            continue
        leader = element.get("joint", "")
        _check(path, name, leader, types)
        unit = units[name]
        own[name] = Mimic(
            leader,
            float(element.get("multiplier", "1")) * unit / units[leader],
            float(element.get("offset", "0")) * unit,
        )
    return {name: _from_first_leader(path, name, own) for name in own}


def _check(path: Path, name: str, leader: str, types: dict[str, str]) -> None:
    if leader not in types:
        sentence = one_of("joint", leader, sorted(set(types) - {name}))
        raise CharacterError(f"{path}: joint {name!r} mimics another: {sentence}")
    for each, allowed in ((name, _FOLLOWERS), (leader, (*_FOLLOWERS, "fixed"))):
        if types[each] not in allowed:
            raise CharacterError(
                f"{path}: joint {name!r} mimics {leader!r}, and {each!r} is {types[each]}; both "
                "must be hinges or sliders"
            )


def _from_first_leader(path: Path, name: str, own: dict[str, Mimic]) -> Mimic:
    """What a follower mimics in the end, where its leader may be a follower itself."""
    mimic, passed = own[name], [name]
    while mimic.leader in own:
        passed.append(mimic.leader)
        if mimic.leader in passed[:-1]:
            raise CharacterError(
                f"{path}: joint {name!r} mimics itself ({' -> '.join(passed)}); a leader must not "
                "follow its follower"
            )
        above = own[mimic.leader]
        mimic = Mimic(
            above.leader,
            mimic.multiplier * above.multiplier,
            mimic.multiplier * above.offset + mimic.offset,
        )
    return mimic


def lock_followers_of_fixed(robot: ElementTree.Element, mimics: dict[str, Mimic]) -> None:
    """Leave a follower one position where its leader has one: fixed, or of limits without room."""
    held = {
        joint.get("name"): position
        for joint in robot.findall("joint")
        if (position := _held_position(joint)) is not None
    }
    for joint in robot.findall("joint"):
        mimic = mimics.get(joint.get("name", ""))
        if mimic is not None and mimic.leader in held:
            limit = joint.find("limit")
            if limit is None:
                limit = ElementTree.SubElement(joint, "limit")
            held_at = repr(mimic.multiplier * held[mimic.leader] + mimic.offset)
            joint.set("type", "prismatic" if joint.get("type") == "prismatic" else "revolute")
            limit.set("lower", held_at)
            limit.set("upper", held_at)


def _held_position(joint: ElementTree.Element) -> float | None:
    """The one position that a joint can have, rad or m; None if it moves."""
    if joint.get("type") == "fixed":
        return 0.0
    limit = joint.find("limit") if joint.get("type") in WITH_BOUNDS else None
    if limit is None:
        return None
    lower, upper = read_bounds(limit)
    return lower if lower == upper else None
