"""The shapes of each link, those that are seen and those that collide, read from its URDF."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from msgs_config.character.model import Pose, Quadruple, Shape, ShapeType
from msgs_config.errors import CharacterError
from msgs_config.geometry import rotations

_SIZES = {  # the attributes that make up `Shape.size`, and what stands for one that may be absent
    ShapeType.BOX: {"size": ""},
    ShapeType.SPHERE: {"radius": ""},
    ShapeType.CYLINDER: {"radius": "", "length": ""},
    ShapeType.CAPSULE: {"radius": "", "length": ""},
    ShapeType.MESH: {"scale": "1 1 1"},
}
_NAMES = ", ".join(type.value for type in ShapeType)


def read_shapes(
    robot: ElementTree.Element, urdf: Path, scale: float
) -> dict[str, tuple[Shape, ...]]:
    """The seen shapes of each link by its name: its visual ones, or its collision shapes if none.

    `robot` is a URDF that was checked, its meshes' paths made absolute; `scale` multiplies all
    lengths.

    Raises:
        CharacterError: a shape is malformed; names the file and the link.
    """
    colors = _named_colors(robot)
    return {
        link.get("name", ""): _shapes(
            link, link.findall("visual") or link.findall("collision"), colors, urdf, scale
        )
        for link in robot.findall("link")
    }


def read_collision_shapes(
    robot: ElementTree.Element, urdf: Path, scale: float
) -> dict[str, tuple[Shape, ...]]:
    """The shapes of each link by its name with which it touches others; as `read_shapes` otherwise.

    Raises:
        CharacterError: a shape is malformed; names the file and the link.
    """
    return {
        link.get("name", ""): _shapes(link, link.findall("collision"), {}, urdf, scale)
        for link in robot.findall("link")
    }


def _shapes(
    link: ElementTree.Element,
    parts: list[ElementTree.Element],
    colors: dict[str, Quadruple],
    urdf: Path,
    scale: float,
) -> tuple[Shape, ...]:
    try:
        return tuple(_shape(part, colors, scale) for part in parts)
    except CharacterError as error:
        raise CharacterError(f"{urdf}: link {link.get('name')!r}: {error}") from error


def _named_colors(robot: ElementTree.Element) -> dict[str, Quadruple]:
    """The colours of materials by name; like the engine, those within a link count everywhere."""
    colors = {}
    for material in [*robot.findall("material"), *robot.iterfind("link//material")]:
        color = material.find("color")
        if color is not None and "rgba" in color.attrib:
            colors[material.get("name", "")] = _color(color)
    return colors


def _color(color: ElementTree.Element) -> Quadruple:
    red, green, blue, alpha = _numbers(color.get("rgba", ""), 4, "rgba of <color>")
    return (red, green, blue, alpha)


def _shape(part: ElementTree.Element, colors: dict[str, Quadruple], scale: float) -> Shape:
    geometry = part.find("geometry")
    element = next(iter(geometry), None) if geometry is not None else None
    found = "nothing" if element is None else f"<{element.tag}>"
    if element is None or element.tag not in {type.value for type in ShapeType}:
        raise CharacterError(f"<{part.tag}> has {found} for a shape; it must be one of: {_NAMES}")
    shape_type = ShapeType(element.tag)
    size: list[float] = []
    for attribute, default in _SIZES[shape_type].items():
        count = 1 if attribute in ("radius", "length") else 3
        text = element.get(attribute, default)
        size += _numbers(text, count, f"{attribute} of <{element.tag}>")
    shape = Shape(
        type=shape_type,
        size=tuple(scale * length for length in size),
        pose=_pose(part.find("origin"), scale),
        mesh=element.get("filename", "") if shape_type is ShapeType.MESH else "",
    )
    color = _color_of(part, colors)
    return shape if color is None else Shape(shape.type, shape.size, shape.pose, color, shape.mesh)


def _color_of(part: ElementTree.Element, colors: dict[str, Quadruple]) -> Quadruple | None:
    """The colour of a visual or collision element, if it has any."""
    material = part.find("material")
    if material is None:
        return None
    color = material.find("color")
    return colors.get(material.get("name", "")) if color is None else _color(color)


def _pose(origin: ElementTree.Element | None, scale: float) -> Pose:
    if origin is None:
        return Pose()
    x, y, z = _numbers(origin.get("xyz", "0 0 0"), 3, "xyz of <origin>")
    roll, pitch, yaw = _numbers(origin.get("rpy", "0 0 0"), 3, "rpy of <origin>")
    about_x, about_y, about_z = rotations.exp(np.diag([roll, pitch, yaw]))
    turn = rotations.multiply(rotations.multiply(about_z, about_y), about_x)
    qx, qy, qz, qw = turn.tolist()
    return Pose((scale * x, scale * y, scale * z), (qx, qy, qz, qw))


def _numbers(text: str, count: int, what: str) -> list[float]:
    """Numbers of a text, of which `check_urdf` has made sure wherever they are given."""
    pieces = text.split()
    if len(pieces) != count:
        raise CharacterError(f"{what} is missing")
    return [float(piece) for piece in pieces]
