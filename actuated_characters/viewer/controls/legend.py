"""What the colours on a page mean, of those that are there."""

from collections.abc import Iterator, Mapping

from actuated_characters.viewer.drawing.colors import (
    CENTRE,
    CONTACT,
    GHOST,
    PUSH,
    RIGHT_SIDE,
    STRAIN,
    SUPPORT,
    Color,
)

_STYLE = (
    "font-size:13px;line-height:1.4;padding:0 0.6em 0.4em;display:flex;flex-wrap:wrap;gap:0 0.9em"
)
_ROW = '<span style="white-space:nowrap"><span style="color:rgb{}">{}</span> {}</span>'
_AREA, _ARROW, _POINT, _LINE = "■", "➜", "●", "▬"


def legend(
    shows: Mapping[str, bool], *, has_sides: bool, has_feet: bool, one_of_several: bool
) -> str:
    """The legend as HTML: by what is shown (`SHOWN`), and of what is drawn."""
    rows = "".join(_ROW.format(*row) for row in _rows(shows, has_sides, has_feet, one_of_several))
    return f'<div style="{_STYLE}">{rows}</div>' if rows else ""


def _rows(
    shows: Mapping[str, bool], has_sides: bool, has_feet: bool, one_of_several: bool
) -> Iterator[tuple[Color, str, str]]:
    if shows["reference"]:
        yield GHOST, _AREA, "where it should be"
    if shows["torques"]:
        yield STRAIN, _AREA, "redder: torque nearer its limit"
    if has_sides and shows["skin"]:
        yield RIGHT_SIDE, _AREA, "darker: its right side"
        if one_of_several:
            yield RIGHT_SIDE, _AREA, "each character, or team, has its colour"
    if shows["forces"]:
        yield CONTACT, _ARROW, "force of the ground (0.5 m: its weight)"
        yield PUSH, _ARROW, "push"
    if shows["balance"]:
        yield CENTRE, _POINT, "centre of mass"
    if shows["balance"] and has_feet:
        yield SUPPORT, _LINE, "what it stands on"
