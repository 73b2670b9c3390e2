"""What a user says of a ball or box to throw, as a text such as `mass=2 speed=8 ...`."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from actuated_characters.runs.planned.keyed_texts import read_keys, read_number, read_side
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.messages.throw import ProjectileThrow, natural_edge, natural_radius

_REQUIRED_KEYS = ("mass", "speed", "at", "target")
_OPTIONAL_KEYS = ("from", "distance", "radius", "shape", "size", "slide")
KEYS = (*_REQUIRED_KEYS, *_OPTIONAL_KEYS)
BALL, BOX = SHAPES = ("ball", "box")
_SWITCH = {"true": True, "false": False}
_MIN_SPEED = 1e-3  # m/s
_EXAMPLE = "mass=2 speed=8 at=2.0 from=left target=chest"


@dataclass(frozen=True)
class ThrowRequest:
    """A throw as a user describes it."""

    mass: float  # kg
    speed: float  # m/s, along the straight way to the target
    at: float  # s since the first state: when it hits
    target: str  # a link
    side: str = "front"  # as `read_side` has it
    distance: float = 2.0  # m, from the link's centre of mass to where the ball is let go
    radius: float | None = None  # m, of a ball; None: of a density that balls have
    shape: str = BALL  # one of `SHAPES`
    # m, of a box: along its way, across it, upwards; None: a cube of the same density
    size: tuple[float, float, float] | None = None
    slide: bool = False  # whether a box comes along the ground

    def __post_init__(self) -> None:
        for name in ("mass", "speed", "distance", "radius"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise ConfigurationError(f"{name} is {value:g}; it must be above 0")
        if self.speed < _MIN_SPEED:
            raise ConfigurationError(
                f"speed is {self.speed:g} m/s; it must be {_MIN_SPEED:g} m/s or more"
            )
        of_box = self.size is not None or self.slide
        if of_box if self.shape == BALL else self.radius is not None:
            raise ConfigurationError("a ball has a 'radius'; 'size' and 'slide' are of shape=box")

    def body(self, yaw: float = 0.0) -> ProjectileThrow:
        """The ball, or the box with its length turned by an angle in rad, at rest at the origin.

        Raises:
            CommandError: none like that can be thrown.
        """
        origin = (0.0, 0.0, 0.0)
        if self.shape == BALL:
            radius = natural_radius(self.mass) if self.radius is None else self.radius
            return ProjectileThrow(self.mass, radius, origin, origin)
        size = (natural_edge(self.mass),) * 3 if self.size is None else self.size
        return ProjectileThrow(self.mass, None, origin, origin, size, yaw)


def parse_throw(text: str) -> ThrowRequest:
    """The request of a text such as `mass=2 speed=8 at=2.0 from=left target=chest`.

    Raises:
        ConfigurationError: a key is unknown, repeated or missing, or a value cannot be used.
    """
    given = read_keys(text, _REQUIRED_KEYS, _OPTIONAL_KEYS, _EXAMPLE)
    values = {
        key: _READERS.get(key, partial(read_number, key))(value) for key, value in given.items()
    }
    return ThrowRequest(side=values.pop("from", ThrowRequest.side), **values)


def _shape(text: str) -> str:
    if text not in SHAPES:
        raise ConfigurationError(one_of("shape", text, list(SHAPES)))
    return text


def _size(text: str) -> tuple[float, ...]:
    edges, what = text.split("x"), "three lengths in m, such as 0.3x0.5x0.2"
    if len(edges) != len(("length", "width", "height")):
        raise ConfigurationError(f"size is '{text}'; it must be {what}")
    return tuple(read_number("size", edge, what) for edge in edges)


def _slide(text: str) -> bool:
    if text not in _SWITCH:
        raise ConfigurationError(f"slide is '{text}'; it must be true or false")
    return _SWITCH[text]


_READERS: Mapping[str, Callable[[str], Any]] = {
    "target": str,
    "from": read_side,
    "shape": _shape,
    "size": _size,
    "slide": _slide,
}
"""How the values are read that are no numbers."""
