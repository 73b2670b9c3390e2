"""Texts such as `mass=2 speed=8 at=2.0 from=left target=chest`, and the sides that they name."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from controller_node.references.posture import Posture
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.geometry import rotations

ABOVE = "above"
SIDES: Mapping[str, float | None] = {
    "front": 0.0,
    "left": 90.0,
    "back": 180.0,
    "right": -90.0,
    ABOVE: None,
}
"""Angles in degrees about the vertical, counterclockwise from the way that the character faces."""


def read_keys(
    text: str, required: Sequence[str], optional: Sequence[str], example: str
) -> dict[str, str]:
    """The values of a text by their keys, which are separated by spaces or commas.

    Raises:
        ConfigurationError: a key is unknown, repeated or missing; says the example, or the keys.
    """
    keys, given = [*required, *optional], dict[str, str]()
    for part in text.replace(",", " ").split():
        key, equals, value = part.partition("=")
        if not (equals and value):
            raise ConfigurationError(f"'{part}': write it as '{example}'")
        if key not in keys:
            raise ConfigurationError(one_of("key", key, keys))
        if key in given:
            raise ConfigurationError(f"'{key}' twice")
        given[key] = value
    missing = [key for key in required if key not in given]
    if missing:
        raise ConfigurationError(f"'{missing[0]}' is missing; write it as '{example}'")
    return given


def read_number(key: str, value: str, what: str = "a number") -> float:
    """A finite number. Raises ConfigurationError if a text is none; `what` is what it must be."""
    try:
        found = float(value)
    except ValueError:
        found = math.nan
    if not math.isfinite(found):
        raise ConfigurationError(f"{key} is '{value}'; it must be {what}")
    return found


def read_side(text: str) -> str:
    """One of `SIDES`, or an angle in degrees as they have it.

    Raises:
        ConfigurationError: it is neither.
    """
    if text not in SIDES:
        read_number("from", text, f"an angle in degrees, or one of {', '.join(SIDES)}")
    return text


def bearing(character: Character, position: FloatArray, side: str) -> tuple[float, FloatArray]:
    """Where a side of a character is, in the world.

    Args:
        character: The character.
        position: Its coordinates, which say where it faces.
        side: As `read_side` reads it.

    Returns the angle about z in rad, which above is that of the way that it faces, and the unit
    vector (3,) to the side.
    """
    degrees, heading = SIDES[side] if side in SIDES else float(side), _heading(character, position)
    if degrees is None:
        return heading, np.array((0.0, 0.0, 1.0))
    angle = math.radians(degrees) + heading
    return angle, np.array((math.cos(angle), math.sin(angle), 0.0))


def _heading(character: Character, position: FloatArray) -> float:
    """Angle in rad about z of the way that it faces; 0 of what stands fast."""
    if not character.layout.has_floating_base:
        return 0.0
    return float(Posture(character).heading(rotations.exp(position[3:6])))
