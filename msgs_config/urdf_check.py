"""A URDF is one tree of links, checked before it is loaded: a broken one can crash the engine."""

from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

from msgs_config.errors import CharacterError

_TYPES = ("revolute", "continuous", "prismatic", "spherical", "fixed")


def check_urdf(path: Path, text: str) -> None:
    """Check that names are unique and that the joints make one tree of all links.

    Raises:
        CharacterError: they do not; names the file and the link or joint.
    """
    try:
        robot = _parse(text)
    except ElementTree.ParseError as error:
        raise CharacterError(f"{path}: not valid XML: {error}") from error
    links = [link.get("name", "") for link in robot.findall("link")]
    joints = robot.findall("joint")
    ends = [(_end(joint, "parent"), _end(joint, "child")) for joint in joints]
    _check_unique(path, "links are named", links)
    _check_unique(path, "joints are named", [joint.get("name", "") for joint in joints])
    _check_unique(path, "joints lead to", [child for _, child in ends])
    for joint in joints:
        if joint.get("type") not in _TYPES:
            raise CharacterError(
                f"{path}: joint {joint.get('name')!r} is of type {joint.get('type')!r}; "
                "it must be revolute, continuous, prismatic, spherical or fixed"
            )
        if joint.get("type") in ("revolute", "prismatic") and joint.find("limit") is None:
            raise CharacterError(
                f"{path}: joint {joint.get('name')!r} is {joint.get('type')} and has no <limit>"
            )
    for name in {name for pair in ends for name in pair} - set(links):
        raise CharacterError(f"{path}: a joint names the link {name!r}, which does not exist")
    _check_tree(path, links, ends)


def links_without_inertial(text: str) -> set[str]:
    """Names of the links to which a URDF, checked before, gives no mass."""
    links = _parse(text).findall("link")
    return {link.get("name", "") for link in links if link.find("inertial") is None}


def _parse(text: str) -> ElementTree.Element:
    return ElementTree.fromstring(text.strip("\0 \t\r\n"))  # PyBullet's own end in a NUL


def _end(joint: ElementTree.Element, which: str) -> str:
    element = joint.find(which)
    return "" if element is None else element.get("link", "")


def _check_unique(path: Path, what: str, names: Iterable[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise CharacterError(f"{path}: two {what} {name!r}")
        seen.add(name)


def _check_tree(path: Path, links: list[str], ends: list[tuple[str, str]]) -> None:
    children: dict[str, list[str]] = {}
    for parent, child in ends:
        children.setdefault(parent, []).append(child)
    bases = sorted(set(links) - {child for _, child in ends})
    if len(bases) != 1:
        raise CharacterError(f"{path}: there must be one base link; there are {bases}")
    reached, pending = set[str](), bases
    while pending:
        link = pending.pop()
        reached.add(link)
        pending += children.get(link, [])
    for link in links:
        if link not in reached:
            raise CharacterError(f"{path}: link {link!r} hangs in a circle of joints")
