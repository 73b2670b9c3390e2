"""The skin that a character has, made once for all characters of one model."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.render.skin.making import make_skin
from actuated_characters.render.skin.palette import skin_colors
from actuated_characters.render.skin.skin import Skin
from msgs_config.character.model import Character, Link, Quadruple, Shape, ShapeType

_MOST_KEPT = 16  # skins of so many models, some 2 MB each


@dataclass(frozen=True)
class _Model:
    """What a skin depends on: characters that are equal in it have the same one."""

    links: tuple[Link, ...]
    shapes: tuple[tuple[Shape, ...], ...]  # of each link, as it is drawn
    rest: tuple[float, ...]  # (n,), message form, but for the root's place
    feet: tuple[str, ...]
    up_axis: str
    character: Character = field(compare=False)


def skin_of(
    character: Character, shapes: Sequence[tuple[Shape, ...]], given: GivenSkin | None = None
) -> Skin | None:
    """The skin of a character, one for all of the same model; not to be changed.

    None where it has a fixed base, or a mesh, which has a look already.

    Args:
        character: Whose.
        shapes: Of each link, as it is drawn (`drawn_shapes`).
        given: A mesh from a file, in place of one that is made.

    Raises:
        SkinError: the mesh that is given does not fit.
    """
    rest = list(character.rest_position)
    if character.layout.has_floating_base:
        del rest[character.layout.joints[0].entries]
    model = _Model(
        character.links,
        tuple(shapes),
        tuple(rest),
        character.feet,
        character.up_axis,
        character,
    )
    if given is not None:
        return _fit(given, model)
    is_plain = all(shape.type is not ShapeType.MESH for own in shapes for shape in own)
    if not (is_plain and character.layout.has_floating_base and len(character.links) > 1):
        return None
    return _make(model)


def colors_of(skin: Skin, character: Character, number: int) -> Sequence[Quadruple | None]:
    """The colours rgba of the links (l,) of one character among several; None: the skin's own."""
    if skin.colors is not None:
        return [None] * len(character.links)
    return skin_colors(character, number)


@lru_cache(maxsize=_MOST_KEPT)
def _make(model: _Model) -> Skin:
    return make_skin(model.character, model.shapes)


@lru_cache(maxsize=_MOST_KEPT)
def _fit(given: GivenSkin, model: _Model) -> Skin:
    return given.fitted(model.character)
