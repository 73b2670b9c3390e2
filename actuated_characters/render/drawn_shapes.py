"""How a character looks: the shapes of its links that are drawn, and their colours.

What is seen of a link may be a mesh in a format that is not read here; then the shapes that it
collides with are drawn in its place.
"""

from dataclasses import replace
from pathlib import Path

from msgs_config.character.layout import JointType
from msgs_config.character.meshes.triangles import check_readable
from msgs_config.character.model import Character, Quadruple, Shape, ShapeType
from msgs_config.errors import CharacterError

_SHADE = 0.86  # brightness of every second link along a branch
_BRANCH_COLORS = (
    (0.93, 0.82, 0.62),
    (0.96, 0.72, 0.66),
    (0.98, 0.62, 0.30),
    (0.45, 0.74, 0.95),
    (0.93, 0.42, 0.36),
    (0.30, 0.55, 0.90),
)
_POINT = Shape(ShapeType.SPHERE, (0.05,))  # stands for each link where there is nothing to see
_TRUNK_COLOR = (0.88, 0.86, 0.83)


def drawn_shapes(character: Character) -> list[tuple[Shape, ...]]:
    """The shapes of each link that the renderer draws, in the order of `Character.links`.

    A character all of one colour gets others, by which its branches can be told apart.
    """
    seen = [tuple(_solid(link.shapes)) for link in character.links]
    if not all(map(_is_readable, seen)):
        seen = [
            shapes if _is_readable(shapes) else tuple(_solid(link.collision_shapes))
            for link, shapes in zip(character.links, seen, strict=True)
        ]
    if not any(seen):
        seen = [(_POINT,) for _ in seen]
    if len({shape.color_rgba for shapes in seen for shape in shapes}) > 1:
        return seen
    colors = branch_colors(character)
    return [
        tuple(replace(shape, color_rgba=color) for shape in shapes)
        for shapes, color in zip(seen, colors, strict=True)
    ]


def branch_colors(character: Character) -> list[Quadruple]:
    """A colour rgba for each link: one for each branch of the tree, in two shades by turns.

    A branch begins where a link has several children that move.
    """
    children = [0] * len(character.links)
    for link in character.links[1:]:
        children[link.parent] += link.joint.type is not JointType.FIXED
    branches, depths = [-1], [0]
    count = 0
    for link in character.links[1:]:
        moves = link.joint.type is not JointType.FIXED
        if moves and children[link.parent] > 1:
            branches.append(count % len(_BRANCH_COLORS))
            count += 1
        else:
            branches.append(branches[link.parent])
        depths.append(depths[link.parent] + moves)
    palette = [*_BRANCH_COLORS, _TRUNK_COLOR]
    return [_shaded(palette[b], depth) for b, depth in zip(branches, depths, strict=True)]


def _shaded(color: tuple[float, float, float], depth: int) -> Quadruple:
    red, green, blue = (part * (_SHADE if depth % 2 else 1.0) for part in color)
    return (red, green, blue, 1.0)


def _solid(shapes: tuple[Shape, ...]) -> list[Shape]:
    """Without those of no size, which no picture shows."""
    return [shape for shape in shapes if shape.type is ShapeType.MESH or min(shape.size) > 0.0]


def _is_readable(shapes: tuple[Shape, ...]) -> bool:
    """Whether all the meshes can be read."""
    try:
        for shape in shapes:
            if shape.type is ShapeType.MESH:
                check_readable(Path(shape.mesh))
    except CharacterError:
        return False
    return True
