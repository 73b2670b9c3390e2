"""Balls that are thrown at a link, planned before a run so that they hit it at a time."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from actuated_characters.runs.plan import Plan
from actuated_characters.whole_files import write_whole
from controller_node.behaviours.posture import Posture
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import CommandError, ConfigurationError, RecordingError, one_of
from msgs_config.geometry import fixed_order, rotations
from msgs_config.messages.clock import TickClock
from msgs_config.messages.throw import ProjectileThrow, natural_radius
from msgs_config.shared_parameters import PLANE
from sim_node.physics.sphere_sweep import find_impact
from sim_node.physics.throws import MOST_BALLS

SIDES: Mapping[str, float | None] = {
    "front": 0.0,
    "left": 90.0,
    "back": 180.0,
    "right": -90.0,
    "above": None,
}
"""Angles in degrees about the vertical, counterclockwise from the way that the character faces."""

_NEEDED = ("mass", "speed", "at", "target")
_TEXTS = ("target", "from")
_KEYS = (*_NEEDED, "from", "distance", "radius")
_DISTANCE = 2.0  # m
_SLOWEST = 1e-3  # m/s
_EXAMPLE = "mass=2 speed=8 at=2.0 from=left target=chest"


@dataclass(frozen=True)
class PlannedThrow:
    """A ball that is let go in the state of a stamp."""

    stamp_ns: int
    throw: ProjectileThrow


@dataclass(frozen=True)
class Aim:
    """What a user says of a throw."""

    mass: float  # kg
    speed: float  # m/s, along the straight way to the target
    at: float  # s since the first state: when it hits
    target: str  # a link
    side: str = "front"  # of `SIDES`, or an angle as they have it, degrees
    distance: float = _DISTANCE  # m, of the place where it is let go from the link's centre of mass
    radius: float | None = None  # m; None: of a density that balls have

    def __post_init__(self) -> None:
        least = {"mass": self.mass, "speed": self.speed, "distance": self.distance}
        if self.radius is not None:
            least["radius"] = self.radius
        for name, value in least.items():
            if not (math.isfinite(value) and value > 0.0):
                raise ConfigurationError(f"{name} is {value:g}; it must be above 0")
        if self.speed < _SLOWEST:
            raise ConfigurationError(
                f"speed is {self.speed:g} m/s; it must be {_SLOWEST:g} m/s or more"
            )

    @property
    def size(self) -> float:
        """The ball's radius, m."""
        return natural_radius(self.mass) if self.radius is None else self.radius


def read_aim(text: str) -> Aim:
    """What `mass=2 speed=8 at=2.0 from=left target=chest` says.

    Raises:
        ConfigurationError: a key is unknown, twice or missing, or a value cannot be.
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
    missing = [key for key in _NEEDED if key not in given]
    if missing:
        raise ConfigurationError(f"'{missing[0]}' is missing; write it as '{_EXAMPLE}'")
    number = {key: _number(key, value) for key, value in given.items() if key not in _TEXTS}
    side = given.get("from", Aim.side)
    if side not in SIDES:
        _number("from", side, f"an angle in degrees, or one of {', '.join(SIDES)}")
    return Aim(
        mass=number["mass"],
        speed=number["speed"],
        at=number["at"],
        target=given["target"],
        side=side,
        distance=number.get("distance", Aim.distance),
        radius=number.get("radius"),
    )


def _number(key: str, value: str, what: str = "a number") -> float:
    try:
        found = float(value)
    except ValueError:
        found = math.nan
    if not math.isfinite(found):
        raise ConfigurationError(f"{key} is '{value}'; it must be {what}")
    return found


def planned_throw(plan: Plan, aim: Aim) -> tuple[PlannedThrow, tuple[str, ...]]:
    """A throw that hits a link, as the reference has it at that time; and what is in its way.

    The ball is let go so many whole ticks before as it needs for the straight way at its speed,
    and upwards by so much more as gravity takes away until then.

    Raises:
        ConfigurationError: the link does not exist, the time is beyond the run or too early for
            the ball to arrive, or it would touch the ground before.
    """
    try:
        return _planned(plan, aim)
    except CommandError as error:
        raise ConfigurationError(str(error)) from error


def _planned(plan: Plan, aim: Aim) -> tuple[PlannedThrow, tuple[str, ...]]:
    rate, character = plan.simulator.integer("rate"), plan.character
    end = plan.ticks / rate
    if not 0.0 <= aim.at < end:
        raise ConfigurationError(f"at is {aim.at:g} s; it must be 0 s to less than {end:g} s")
    position = plan.reference.sample(aim.at).configuration.position
    origin = _direction(character, position, aim.side)
    impact = find_impact(character, position, aim.target, origin, aim.size, aim.distance)
    way = aim.distance - float(fixed_order.dot(impact.centre - impact.target, origin))
    ticks = max(round(way / aim.speed * rate), 1)
    first = round(aim.at * rate) - ticks
    if first < 0:
        raise ConfigurationError(
            f"at is {aim.at:g} s; from {aim.distance:g} m away at {aim.speed:g} m/s the ball needs "
            f"{ticks / rate:.3g} s to '{aim.target}': let it hit later, or come from nearer"
        )
    time, step = ticks / rate, 1.0 / (rate * plan.simulator.integer("substeps"))
    start = impact.centre + aim.speed * time * origin
    # the engine's fall: it moves on with the velocity at the end of each of its steps
    rise = 0.5 * plan.simulator.number("gravity") * (time + step)
    velocity = -aim.speed * origin + np.array((0.0, 0.0, rise))
    lowest = min(float(start[2]), float(impact.centre[2])) - aim.size
    if plan.simulator.text("terrain") == PLANE and lowest < 0.0:
        raise ConfigurationError(
            f"a ball with a radius of {aim.size:.3g} m on its way to '{aim.target}' would be "
            f"{-lowest:.2g} m in the ground; take a smaller 'radius', or another 'from'"
        )
    throw = ProjectileThrow(aim.mass, aim.size, _triple(start), _triple(velocity))
    return PlannedThrow(TickClock(rate).stamp_ns(1 + first), throw), impact.before


def plan_throws(plan: Plan, texts: Sequence[str]) -> tuple[list[PlannedThrow], list[str]]:
    """The throws that texts describe, see `read_aim`; and what the user should know.

    Raises:
        ConfigurationError: one of them cannot be; says which.
    """
    if len(texts) > MOST_BALLS:
        raise ConfigurationError(f"{len(texts)} throws; a run has at most {MOST_BALLS}")
    throws, notes = [], []
    for text in texts:
        try:
            throw, before = planned_throw(plan, read_aim(text))
        except ConfigurationError as error:
            raise ConfigurationError(f"throw '{text}': {error}") from error
        throws.append(throw)
        if before:
            notes.append(f"throw '{text}': {', '.join(before)} may be in its way")
    return throws, notes


def write_throws(file: Path, throws: Sequence[PlannedThrow]) -> None:
    """Write throws for the node to send, the first one first."""
    in_order = sorted(throws, key=lambda throw: throw.stamp_ns)
    write_whole(file, json.dumps([asdict(throw) for throw in in_order], indent=1))


def read_throws(file: Path) -> list[PlannedThrow]:
    """Read what `write_throws` wrote.

    Raises:
        RecordingError: the file does not exist or holds something else.
    """
    try:
        content = json.loads(file.read_text("utf-8"))
        return [
            PlannedThrow(each["stamp_ns"], ProjectileThrow(**each["throw"])) for each in content
        ]
    except (OSError, ValueError, TypeError, KeyError, CommandError) as error:
        raise RecordingError(f"{file} holds no throws: {error}") from error


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
