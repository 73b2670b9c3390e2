"""Blocks as the URDF of something that never moves."""

from collections.abc import Iterable, Mapping, Sequence
from xml.etree import ElementTree

from msgs_config.terrain.pieces import Block


def write_terrain(pieces: Mapping[str, Sequence[Block]], *, plane: bool) -> str:
    """The text of a URDF with a link for each piece, by its name, and one for the plane z = 0.

    It has at least one of both.
    """
    robot = ElementTree.Element("robot", name="terrain")
    if plane:
        link = ElementTree.SubElement(robot, "link", name="plane")
        _add_collision(link, "0 0 0", "0 0 0", "plane", {"normal": "0 0 1"})
    for name, blocks in pieces.items():
        link = ElementTree.SubElement(robot, "link", name=name)
        for block in blocks:
            kind, size = ("mesh", "scale") if block.mesh else ("box", "size")
            shape = {"filename": block.mesh} if block.mesh else {}
            turn = f"0 {block.pitch!r} {block.yaw!r}"
            _add_collision(link, _text(block.place), turn, kind, shape | {size: _text(block.size)})
    first, *others = [link.get("name", "") for link in robot]
    for name in others:
        joint = ElementTree.SubElement(robot, "joint", name=f"{name} joint", type="fixed")
        ElementTree.SubElement(joint, "parent", link=first)
        ElementTree.SubElement(joint, "child", link=name)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _add_collision(
    link: ElementTree.Element, place: str, turn: str, kind: str, shape: Mapping[str, str]
) -> None:
    collision = ElementTree.SubElement(link, "collision")
    ElementTree.SubElement(collision, "origin", xyz=place, rpy=turn)
    ElementTree.SubElement(ElementTree.SubElement(collision, "geometry"), kind, dict(shape))


def _text(numbers: Iterable[float]) -> str:
    return " ".join(map(repr, numbers))
