"""A URDF is one tree of links, checked before it is loaded: a broken one can crash the engine."""

import re
from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from xml.etree import ElementTree

from msgs_config import files
from msgs_config.character.urdf.file_formats.formats import check_root
from msgs_config.character.urdf.file_formats.vocabulary import leave_out_unknown
from msgs_config.character.urdf.frames import MAX_JOINTS, find_frames, joint_end
from msgs_config.character.urdf.inertia import LEAST_MOMENT, ROUNDING
from msgs_config.character.urdf.limits import WITH_BOUNDS, read_bounds
from msgs_config.character.urdf.reading import FLOATING, WITH_AXIS, read_axis
from msgs_config.errors import CharacterError

MAX_LINKS = 2000
MAX_POSITION_ENTRIES = 128  # beyond them PyBullet reads states as empty, without an error
MAX_NAME_BYTES = 255
MAX_ELEMENT_BYTES = 8000
"""Of an element without those in it: Bullet breaks a line of more than 8191 bytes in two."""

_TYPES = (*WITH_AXIS, "spherical", "fixed", FLOATING)
_RIGHT_TYPES = (
    "revolute, continuous, prismatic, spherical or fixed; floating is for the only joint of a base "
    "link without <inertial>"
)
_MAX_NUMBER = 1e30  # the engine's single precision ends at 3e38
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_ANY, _POSITIVE = -_MAX_NUMBER, 0.0
MOMENTS = ("ixx", "iyy", "izz")
NUMBERS = {  # how many numbers, and how small at least, by element and attribute
    "origin": {"xyz": (3, _ANY), "rpy": (3, _ANY)},
    "axis": {"xyz": (3, _ANY)},
    "mass": {"value": (1, _POSITIVE)},
    "inertia": {
        # Moments must be at least 0 up to rounding, see `_check_inertial`.
        **dict.fromkeys((*MOMENTS, "ixy", "ixz", "iyz"), (1, _ANY)),
    },
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), (1, _ANY)),
    "mimic": dict.fromkeys(("multiplier", "offset"), (1, _ANY)),
    "dynamics": dict.fromkeys(("damping", "friction", "armature"), (1, _ANY)),
    "box": {"size": (3, _POSITIVE)},
    "sphere": {"radius": (1, _POSITIVE)},
    "cylinder": {"radius": (1, _POSITIVE), "length": (1, _POSITIVE)},
    "capsule": {"radius": (1, _POSITIVE), "length": (1, _POSITIVE)},
    "mesh": {"scale": (3, _ANY)},
    "plane": {"normal": (3, _ANY)},
    "color": {"rgba": (4, _ANY)},
    **{
        name: {"value": (1, _ANY)}
        for name in (
            "lateral_friction",
            "rolling_friction",
            "spinning_friction",
            "restitution",
            "stiffness",
            "damping",
            "contact_cfm",
            "contact_erp",
            "inertia_scaling",
        )
    },
}


def check_urdf(path: Path, text: str, limits: bool = True) -> ElementTree.Element:
    """Parse a URDF and check all that the engine takes for granted; returns what counts of it.

    Names are unique, the joints make one tree of all links that is not too large for the engine,
    bounds are in order, which `limits` leaves out, and what should be a number is one.

    Raises:
        CharacterError: it is not so; names the file and the link or joint.
    """
    robot = files.parse_xml(path, text, CharacterError)
    check_root(path, robot)
    leave_out_unknown(robot)
    links, joints = robot.findall("link"), robot.findall("joint")
    if not links:
        raise CharacterError(f"{path}: it has no links")
    names = [link.get("name", "") for link in links]
    ends = [(joint_end(joint, "parent"), joint_end(joint, "child")) for joint in joints]
    for element in links + joints:
        _check_name(path, element)
    _check_unique(path, "links are named", names)
    _check_unique(path, "joints are named", [joint.get("name", "") for joint in joints])
    _check_unique(path, "joints lead to", [child for _, child in ends])
    for joint in joints:
        _check_joint(path, joint)
    for name in sorted({name for pair in ends for name in pair} - set(names)):
        raise CharacterError(f"{path}: a joint names the link {name!r}, which does not exist")
    _check_size(path, robot, joints)
    _check_tree(path, names, ends)
    _check_floating(path, robot)
    for element in [*links, *joints, *robot.findall("material")]:
        _check_numbers(path, element)
    for joint in joints:
        _check_direction(path, joint)
        if limits:
            _check_limits(path, joint)
    _check_lengths(path, robot)
    return robot


def _check_lengths(path: Path, robot: ElementTree.Element) -> None:
    for element in robot.iter():
        attributes = chain.from_iterable(element.attrib.items())
        whole = "".join((element.tag, element.text or "", element.tail or "", *attributes))
        if len(whole.encode()) > MAX_ELEMENT_BYTES:
            raise CharacterError(
                f"{path}: an element of more than {MAX_ELEMENT_BYTES} bytes; "
                "the engine cannot read it"
            )


def _check_name(path: Path, element: ElementTree.Element) -> None:
    name = element.get("name", "")
    if not name or len(name.encode()) > MAX_NAME_BYTES or not name.isprintable():
        raise CharacterError(
            f"{path}: a {element.tag} is named {name[:MAX_NAME_BYTES]!r}; a name must have 1 to "
            f"{MAX_NAME_BYTES} bytes, all printable"
        )


def _check_joint(path: Path, joint: ElementTree.Element) -> None:
    name, kind = joint.get("name"), joint.get("type")
    if kind not in _TYPES:
        raise CharacterError(
            f"{path}: joint {name!r} is of type {kind!r}; it must be {_RIGHT_TYPES}"
        )
    if kind in ("revolute", "prismatic") and joint.find("limit") is None:
        raise CharacterError(f"{path}: joint {name!r} is {kind} and has no <limit>")


def _check_floating(path: Path, robot: ElementTree.Element) -> None:
    """Check that a joint that floats is that of the base: the only one of a base without mass."""
    links = {link.get("name"): link for link in robot.findall("link")}
    children = {joint_end(joint, "child") for joint in robot.findall("joint")}
    for joint in robot.findall("joint"):
        if joint.get("type") != FLOATING:
            continue
        parent = joint_end(joint, "parent")
        sides = [each for each in robot.findall("joint") if joint_end(each, "parent") == parent]
        is_base = parent not in children and links[parent].find("inertial") is None
        if not (is_base and len(sides) == 1):
            raise CharacterError(
                f"{path}: joint {joint.get('name')!r} is of type floating; it must be "
                f"{_RIGHT_TYPES}"
            )


def _check_size(path: Path, robot: ElementTree.Element, joints: list[ElementTree.Element]) -> None:
    """Check that the engine can hold what is no mere frame, and that frames are not countless."""
    if len(joints) > MAX_LINKS:
        raise CharacterError(f"{path}: {len(joints)} joints; there can be {MAX_LINKS}")
    frames = find_frames(robot)
    joints = [joint for joint in joints if joint not in frames]
    # Numbers of a joint's position in the engine, which is a quaternion for a ball joint.
    widths = {"spherical": 4, "fixed": 0, FLOATING: 0}
    entries = 7 + sum(widths.get(joint.get("type", ""), 1) for joint in joints)
    if len(joints) > MAX_JOINTS or entries > MAX_POSITION_ENTRIES:
        raise CharacterError(
            f"{path}: too large for the engine: {len(joints)} joints and {entries} positions (7 of "
            "the base, 4 of each ball joint, 1 of each hinge or slider); it can hold "
            f"{MAX_JOINTS} and {MAX_POSITION_ENTRIES}"
        )


def _check_numbers(path: Path, part: ElementTree.Element) -> None:
    for element in part.iter():
        for attribute, (count, minimum) in NUMBERS.get(element.tag, {}).items():
            text = element.get(attribute)
            if text is not None and not _are_numbers(text, count, minimum):
                bound = f" of at least {minimum:g}" if minimum > -_MAX_NUMBER else ""
                raise CharacterError(
                    f"{path}: {part.tag} {part.get('name')!r}: {attribute} of <{element.tag}> is "
                    f"{text[:100]!r}; it must be {count} finite number{'s' * (count > 1)}{bound}"
                )
    for inertial in part.findall("inertial") if part.tag == "link" else ():
        _check_inertial(path, part, inertial)


def _check_direction(path: Path, joint: ElementTree.Element) -> None:
    axis = joint.find("axis") if joint.get("type") in WITH_AXIS else None
    if axis is not None and not any(read_axis(axis)):
        raise CharacterError(
            f"{path}: joint {joint.get('name')!r} has an axis of length zero; it must have a "
            "direction, such as '1 0 0'"
        )


def _check_limits(path: Path, joint: ElementTree.Element) -> None:
    """Check that bounds are in order, and that an effort or a velocity can be below its limit."""
    limit = joint.find("limit") if joint.get("type") != "fixed" else None
    if limit is None:
        return
    place = f"{path}: joint {joint.get('name')!r}"
    for name in ("effort", "velocity"):
        if float(limit.get(name, "0")) < 0.0:
            raise CharacterError(
                f"{place}: {name} of <limit> is {limit.get(name)}; it must be at least 0"
            )
    lower, upper = read_bounds(limit)
    if joint.get("type") in WITH_BOUNDS and lower > upper:
        raise CharacterError(
            f"{place}: lower of <limit> is {lower:g}, upper is {upper:g} (0 where it is not "
            "given); lower must not be above upper, and a hinge without bounds is 'continuous'"
        )


def _check_inertial(path: Path, link: ElementTree.Element, inertial: ElementTree.Element) -> None:
    """Check that it has a mass, and no moment below 0 by more than a file's rounding."""
    if inertial.find("mass") is None:
        raise CharacterError(f"{path}: link {link.get('name')!r}: <inertial> must have <mass>")
    inertia = inertial.find("inertia")
    if inertia is None:
        return
    moments = {name: float(inertia.get(name, "0")) for name in MOMENTS}
    rounding = max(LEAST_MOMENT, ROUNDING * max(map(abs, moments.values())))
    for name, moment in moments.items():
        if moment < -rounding:
            raise CharacterError(
                f"{path}: link {link.get('name')!r}: {name} of <inertia> is "
                f"{inertia.get(name)!r}; it must be 1 finite number of at least 0"
            )


def _are_numbers(text: str, count: int, minimum: float) -> bool:
    # the engine takes what C does: no `_`, `nan` or `inf`, and nothing that is no number
    pieces = text.split()
    return len(pieces) == count and all(
        _NUMBER.fullmatch(piece) and minimum <= float(piece) <= _MAX_NUMBER for piece in pieces
    )


def _check_unique(path: Path, what: str, names: Iterable[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise CharacterError(f"{path}: two {what} {name!r}")
        seen.add(name)


def _check_tree(path: Path, links: list[str], ends: list[tuple[str, str]]) -> None:
    """Check that one base link leads to all others; no link has two parents."""
    parents = {child: parent for parent, child in ends}
    bases = sorted(set(links) - set(parents))
    if len(bases) != 1:
        raise CharacterError(f"{path}: there must be one base link; there are {bases}")
    for link in links:
        above = link
        for _ in links:
            above = parents.get(above, above)
        if above != bases[0]:
            raise CharacterError(f"{path}: link {link!r} hangs in a circle of joints")
