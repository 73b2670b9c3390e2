"""Balls that are thrown at a link, planned before a run so that they hit it at a time."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from actuated_characters.runs.plan import RunPlan
from actuated_characters.runs.planned.files import Planned, read_planned
from controller_node.references.posture import Posture
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import CommandError, ConfigurationError, one_of
from msgs_config.geometry import fixed_order, rotations
from msgs_config.messages.clock import TickClock
from msgs_config.messages.throw import ProjectileThrow, natural_radius
from msgs_config.shared_parameters import PLANE
from sim_node.physics.balls.sphere_sweep import find_impact
from sim_node.physics.balls.throws import MOST_BALLS

SIDES: Mapping[str, float | None] = {
    "front": 0.0,
    "left": 90.0,
    "back": 180.0,
    "right": -90.0,
    "above": None,
}
"""Angles in degrees about the vertical, counterclockwise from the way that the character faces."""

_REQUIRED_KEYS = ("mass", "speed", "at", "target")
_TEXT_KEYS = ("target", "from")
_KEYS = (*_REQUIRED_KEYS, "from", "distance", "radius")
_MIN_SPEED = 1e-3  # m/s
_EXAMPLE = "mass=2 speed=8 at=2.0 from=left target=chest"


@dataclass(frozen=True)
class PlannedThrow(Planned):
    """A ball that is let go in the state of a stamp."""

    throw: ProjectileThrow


@dataclass(frozen=True)
class ThrowRequest:
    """A throw as a user describes it."""

    mass: float  # kg
    speed: float  # m/s, along the straight way to the target
    at: float  # s since the first state: when it hits
    target: str  # a link
    side: str = "front"  # one of `SIDES`, or an angle as they have it, degrees
    distance: float = 2.0  # m, from the link's centre of mass to where the ball is let go
    radius: float | None = None  # m; None: of a density that balls have

    def __post_init__(self) -> None:
        for name in ("mass", "speed", "distance", "radius"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise ConfigurationError(f"{name} is {value:g}; it must be above 0")
        if self.speed < _MIN_SPEED:
            raise ConfigurationError(
                f"speed is {self.speed:g} m/s; it must be {_MIN_SPEED:g} m/s or more"
            )

    @property
    def size(self) -> float:
        """The ball's radius, m."""
        return natural_radius(self.mass) if self.radius is None else self.radius


def parse_throw(text: str) -> ThrowRequest:
    """The request of a text such as `mass=2 speed=8 at=2.0 from=left target=chest`.

    Raises:
        ConfigurationError: a key is unknown, repeated or missing, or a value cannot be used.
    """
    given: dict[str, str] = {}
    for part in text.replace(",", " ").split():
        key, equals, value = part.partition("=")
        if not (equals and value):
            raise ConfigurationError(f"'{part}': write it as '{_EXAMPLE}'")
        if key not in _KEYS:
            raise ConfigurationError(one_of("key", key, list(_KEYS)))
        if key in given:
            raise ConfigurationError(f"'{key}' twice")
        given[key] = value
    missing = [key for key in _REQUIRED_KEYS if key not in given]
    if missing:
        raise ConfigurationError(f"'{missing[0]}' is missing; write it as '{_EXAMPLE}'")
    side = given.get("from", ThrowRequest.side)
    if side not in SIDES:
        _number("from", side, f"an angle in degrees, or one of {', '.join(SIDES)}")
    numbers = {key: _number(key, value) for key, value in given.items() if key not in _TEXT_KEYS}
    return ThrowRequest(target=given["target"], side=side, **numbers)


def _number(key: str, value: str, what: str = "a number") -> float:
    try:
        found = float(value)
    except ValueError:
        found = math.nan
    if not math.isfinite(found):
        raise ConfigurationError(f"{key} is '{value}'; it must be {what}")
    return found


def plan_throw(plan: RunPlan, request: ThrowRequest) -> tuple[PlannedThrow, tuple[str, ...]]:
    """A throw that hits a link, where the reference has it at that time, and the links in its way.

    The ball is let go as many whole ticks before as it needs for the straight way at its speed,
    and upwards by as much more as gravity takes away until then.

    Raises:
        ConfigurationError: the link does not exist, the time is beyond the run or too early for
            the ball to arrive, or the ball would touch the ground before.
        CommandError: a ball like that cannot be thrown.
    """
    rate, size = plan.simulation.rate_hz, request.size
    end = plan.ticks / rate
    if not 0.0 <= request.at < end:
        raise ConfigurationError(f"at is {request.at:g} s; it must be 0 s to less than {end:g} s")
    position = plan.reference.sample(request.at).configuration.position
    origin = _direction(plan.character, position, request.side)
    impact = find_impact(
        plan.character,
        position,
        request.target,
        origin,
        size,
        request.distance,
        engine=plan.simulation.world.engine,
    )
    way = request.distance - float(fixed_order.dot(impact.centre - impact.target, origin))
    ticks = max(round(way / request.speed * rate), 1)
    first = round(request.at * rate) - ticks
    if first < 0:
        raise ConfigurationError(
            f"at is {request.at:g} s; from {request.distance:g} m away at {request.speed:g} m/s "
            f"the ball needs {ticks / rate:.3g} s to '{request.target}': let it hit later, or come "
            "from nearer"
        )
    time, step = ticks / rate, 1.0 / (rate * plan.simulation.substeps)
    start = impact.centre + request.speed * time * origin
    # the engine's fall: it moves on with the velocity at the end of each of its steps
    rise = 0.5 * plan.simulation.world.gravity * (time + step)
    velocity = -request.speed * origin + np.array((0.0, 0.0, rise))
    _check_ground(plan, request, min(float(start[2]), float(impact.centre[2])) - size)
    throw = ProjectileThrow(request.mass, size, _triple(start), _triple(velocity))
    return PlannedThrow(TickClock(rate).stamp_ns(1 + first), throw), impact.before


def _check_ground(plan: RunPlan, request: ThrowRequest, lowest: float) -> None:
    """Raise ConfigurationError if the lowest point of a ball's way, m, is in the ground."""
    if plan.simulation.terrain == PLANE and lowest < 0.0:
        raise ConfigurationError(
            f"a ball with a radius of {request.size:.3g} m on its way to '{request.target}' would "
            f"be {-lowest:.2g} m in the ground; take a smaller 'radius', or another 'from'"
        )


def plan_throws(plan: RunPlan, texts: Sequence[str]) -> tuple[list[PlannedThrow], list[str]]:
    """The throws that texts describe, see `parse_throw`; and warnings.

    Raises:
        ConfigurationError: one of them cannot be; says which.
    """
    if len(texts) > MOST_BALLS:
        raise ConfigurationError(f"{len(texts)} throws; a run has at most {MOST_BALLS}")
    throws, warnings = [], []
    for text in texts:
        try:
            throw, before = plan_throw(plan, parse_throw(text))
        except (ConfigurationError, CommandError) as error:
            raise ConfigurationError(f"throw '{text}': {error}") from error
        throws.append(throw)
        if before:
            warnings.append(f"throw '{text}': {', '.join(before)} may be in its way")
    return throws, warnings


def read_throws(file: Path) -> list[PlannedThrow]:
    """Read a file of `write_planned`. Raises RecordingError as `read_planned`."""

    def make(fields: Mapping[str, Any]) -> PlannedThrow:
        return PlannedThrow(fields["stamp_ns"], ProjectileThrow(**fields["throw"]))

    return read_planned(file, "throws", make)


def _direction(character: Character, position: FloatArray, side: str) -> FloatArray:
    """Unit vector (3,) from the character to the side of it, in the world."""
    degrees = SIDES[side] if side in SIDES else float(side)
    if degrees is None:
        return np.array((0.0, 0.0, 1.0))
    angle = math.radians(degrees) + _heading(character, position)
    return np.array((math.cos(angle), math.sin(angle), 0.0))


def _heading(character: Character, position: FloatArray) -> float:
    """Angle in rad about z of the way that it faces; 0 of what stands fast."""
    if not character.layout.has_floating_base:
        return 0.0
    return float(Posture(character).heading(rotations.exp(position[3:6])))


def _triple(vector: FloatArray) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z
