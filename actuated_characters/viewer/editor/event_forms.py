"""What is to be said of an event of each track, and how it is read from the texts of a form."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from msgs_config import files
from msgs_config.errors import MotionError

NUMBER, TEXT, VECTOR, NAMES, LINK, PLACE = "number", "text", "vector", "names", "link", "place"
BOX = "box"
"""Kinds of fields; a vector is three numbers, as is a place, or `here`; names are one or more.

A box is three numbers, its edges, or nothing, for what is no box.
"""


@dataclass(frozen=True)
class Field:
    """A field of a form."""

    name: str
    kind: str
    default: Any
    about: str


_HERE = "here"
_UNTIL = Field("until", NUMBER, None, "its end, s")
_IN = Field("in", NUMBER, 0.3, "s in which it comes")
_OUT = Field("out", NUMBER, 0.3, "s in which it goes")
FORMS: dict[str, tuple[Field, ...]] = {
    "clips": (
        Field("clip", TEXT, "walk", "a clip's name, or a file"),
        Field("from", NUMBER, 0.0, "s in the clip"),
        Field("to", NUMBER, 1.0, "s in the clip"),
        Field("blend", NUMBER, 0.3, "s in which it comes"),
    ),
    "steering": (_UNTIL, Field("velocity", VECTOR, "0.8, 0, 0", "forward, left m/s; turn rad/s")),
    "reach": (
        _UNTIL,
        Field("link", LINK, "right_wrist", "what reaches"),
        Field("point", VECTOR, "0.4, 0, 1.2", "m, world"),
        _IN,
        _OUT,
    ),
    "look": (_UNTIL, Field("point", VECTOR, "2, 0, 1.5", "m, world")),
    "limp": (_UNTIL,),
    "strengths": (
        _UNTIL,
        Field("joints", NAMES, "right_shoulder", "names, with commas between"),
        Field("strength", NUMBER, 0.3, "0 to 1"),
    ),
    "behaviours": (
        _UNTIL,
        Field("do", TEXT, "react", "track, react, get_up or brace"),
    ),
    "pushes": (
        Field("link", LINK, "chest", "what is pushed"),
        Field("force", VECTOR, "0, 200, 0", "N, world"),
    ),
    "pins": (
        _UNTIL,
        Field("link", LINK, "", "what is held"),
        Field("point", PLACE, _HERE, "m, world; here: where the motion has it then"),
        Field("force", NUMBER, 300.0, "N, at most"),
    ),
    "throws": (
        Field("mass", NUMBER, 2.0, "kg"),
        Field("speed", NUMBER, 6.0, "m/s"),
        Field("target", LINK, "chest", "the link that it flies to"),
        Field("from", TEXT, "left", "the side that it comes from"),
        Field("size", BOX, "", "m, of a box that slides: length, width, height; none: a ball"),
    ),
}
_NUMBERS = 3  # of a vector


def read_form(track: str, at: float, given: Mapping[str, Any]) -> dict[str, Any]:
    """The event that a form says, at a time in s; `given` are the fields' values by their names.

    Raises:
        MotionError: a vector is no three numbers, or an end is before the beginning.
    """
    event: dict[str, Any] = {"at": at}
    for field in FORMS[track]:
        value = given[field.name]
        if field.kind == PLACE and str(value).strip() == _HERE:
            value = _HERE
        elif field.kind == BOX:
            if not str(value).strip():
                continue
            value = _read_vector(field.name, str(value))
            event |= {"shape": "box", "slide": True}
        elif field.kind in (VECTOR, PLACE):
            value = _read_vector(field.name, str(value))
        elif field.kind == NAMES:
            value = [name.strip() for name in str(value).split(",") if name.strip()]
        event[field.name] = value
    if "until" in event and not event["until"] > at:
        raise MotionError(f"until is {event['until']:g} s; it must be after {at:g} s")
    return event


def _read_vector(name: str, text: str) -> list[float]:
    values = files.parse_yaml(name, f"[{text}]", MotionError)
    are_numbers = isinstance(values, list) and all(
        isinstance(value, int | float) and not isinstance(value, bool) for value in values
    )
    if not are_numbers or len(values) != _NUMBERS:
        raise MotionError(f"{name} is {text!r}; it must be three numbers, with commas between")
    return [float(value) for value in values]


def describe_event(track: str, number: int, event: Mapping[str, Any]) -> str:
    """An event in a line, which differs from that of any other one; its number is from 0."""
    others = [
        f"{name} {_shown(value)}" for name, value in event.items() if name not in ("at", "until")
    ]
    until = f" to {event['until']:g} s" if isinstance(event.get("until"), int | float) else ""
    return f"{track} {number + 1}: {event['at']:g} s{until}, {', '.join(others)}".rstrip(", ")


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list):
        return " ".join(_shown(each) for each in value)
    return str(value)
