"""The shapes of each link, those that are seen and those that collide, read from its URDF."""

from typing import TypeAlias
from xml.etree import ElementTree

from msgs_config.character.model import GREY, Quadruple, Shape, ShapeType, UrdfOptions
from msgs_config.character.urdf.origin import read_numbers, read_origin
from msgs_config.errors import CharacterError

Shapes: TypeAlias = tuple[Shape, ...]

_SIZES = {  # the attributes that make up `Shape.size`, and what stands for one that may be absent
    ShapeType.BOX: {"size": ""},
    ShapeType.SPHERE: {"radius": ""},
    ShapeType.CYLINDER: {"radius": "", "length": ""},
    ShapeType.CAPSULE: {"radius": "", "length": ""},
    ShapeType.MESH: {"scale": "1 1 1"},
}
_NAMES = ", ".join(type.value for type in ShapeType)


def read_shapes(
    robot: ElementTree.Element, loading: UrdfOptions
) -> dict[str, tuple[Shapes, Shapes]]:
    """The shapes of each link that are seen, and those that collide, by the link's name.

    Where there are no visual shapes, those that collide are seen.

    Args:
        robot: The root of the repaired URDF, its meshes with absolute paths.
        loading: How the URDF is to be read.

    Raises:
        CharacterError: a shape is malformed; names the file and the link.
    """
    colors = _named_colors(robot)
    shapes = {}
    for link in robot.findall("link"):
        try:
            seen, collided = (
                tuple(_shape(part, colors, loading.scale) for part in link.findall(tag))
                for tag in ("visual", "collision")
            )
        except CharacterError as error:
            place = f"{loading.urdf_path}: link {link.get('name')!r}"
            raise CharacterError(f"{place}: {error}") from error
        shapes[link.get("name", "")] = (seen or collided, collided if loading.collisions else ())
    return shapes


def _named_colors(robot: ElementTree.Element) -> dict[str, Quadruple]:
    """The colours of materials by name; like the engine, those within a link count everywhere."""
    colors = {}
    for material in [*robot.findall("material"), *robot.iterfind("link//material")]:
        color = material.find("color")
        if color is not None and "rgba" in color.attrib:
            colors[material.get("name", "")] = _color(color)
    return colors


def _color(color: ElementTree.Element) -> Quadruple:
    red, green, blue, alpha = read_numbers(color.get("rgba", ""), 4, "rgba of <color>")
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
        size += read_numbers(text, count, f"{attribute} of <{element.tag}>")
    return Shape(
        type=shape_type,
        size=tuple(scale * length for length in size),
        pose=read_origin(part).scaled(scale),
        color_rgba=_color_of(part, colors),
        mesh=element.get("filename", "") if shape_type is ShapeType.MESH else "",
    )


def _color_of(part: ElementTree.Element, colors: dict[str, Quadruple]) -> Quadruple:
    """The colour of a visual or collision element; grey if it has none."""
    material = part.find("material")
    if material is None:
        return GREY
    color = material.find("color")
    return colors.get(material.get("name", ""), GREY) if color is None else _color(color)
