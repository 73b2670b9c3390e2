"""Where a ball or a box that comes straight at a link meets a character."""

from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.engine import DEFAULT_ENGINE, World, make_world
from sim_node.physics.settings import WorldSettings

_TOUCHING_DISTANCE = 1e-6  # m: what is nearer counts as touching
_MOST_RADII = 20_000.0  # radii, or least half edges, that it may come from at most
_LAST_STEPS = 1000  # most steps from nearer than a radius until it touches


@dataclass(frozen=True)
class Impact:
    """A ball or box that touches a link, having come straight towards its centre of mass."""

    target: FloatArray  # (3,) m, world: the link's centre of mass, or the point at a level
    centre: FloatArray  # (3,) m, world: the ball's
    before: tuple[str, ...]  # links that the ball would have met on its way


class BallAndCharacter:
    """A ball or box beside a character, in a world of their own where nothing moves."""

    def __init__(self, world: World, character: Character, body: ProjectileThrow) -> None:
        self._world = world
        self._still = np.zeros(character.layout.size)
        self._body = world.add(character)
        self._turn_xyzw = np.array(body.turn_xyzw)
        world.balls.add(body)

    def put_character(self, position: FloatArray) -> FloatArray:
        """Put the character into a state (n,), message form; returns the links' centres (l, 3)."""
        self._body.set_state(position, self._still)
        return np.array(self._body.centres())

    def put_ball(self, centre: FloatArray, turn_xyzw: FloatArray | None = None) -> FloatArray:
        """Put the ball somewhere (3,), m; returns how far (l,) it is from the links' surfaces, m.

        It is turned as it was thrown, unless it is given how (4,). Negative: inside of a link;
        infinite: the link has no surface.
        """
        self._world.balls.place(0, centre, self._turn_xyzw if turn_xyzw is None else turn_xyzw)
        return self._body.gaps(0)


def find_impact(
    character: Character,
    position: FloatArray,
    link: str,
    origin: FloatArray,
    body: ProjectileThrow,
    distance: float,
    *,
    level: float | None = None,
    engine: str = DEFAULT_ENGINE,
) -> Impact:
    """Where a ball or a box meets a link of a character that stands still.

    Args:
        character: The character.
        position: Its state (n,), message form.
        link: The link that it comes to.
        origin: Unit vector (3,) from the link's centre of mass to where it comes from.
        body: The ball or box, turned as it comes; where and how fast it is does not count.
        distance: How far from the centre of mass it comes, m.
        level: How high its centre is on its way, m, world; None: as the link's centre of mass.
        engine: The engine, whose shapes meet.

    Raises:
        ConfigurationError: the link does not exist, has no surface, or is in it already; or it
            comes from too far for its size, or past the link.
    """
    names = [one.name for one in character.links]
    row = _row(names, link, body, distance)
    with make_world(WorldSettings(engine=engine, ground=False)) as world:
        both = BallAndCharacter(world, character, body)
        target = both.put_character(position)[row]
        if level is not None:
            target[2] = level
        gaps = both.put_ball(target + distance * origin)
        if not np.isfinite(gaps[row]):
            raise ConfigurationError(f"link '{link}' has no surface that could be hit")
        if gaps[row] <= 0.0:
            raise ConfigurationError(
                f"distance is {distance:g} m; '{link}' is nearer than the {_side(body)}"
            )
        left, met = _trace(both, row, target, origin, min(body.half_edges), distance)
    if left is None:
        raise _missed(link, body, distance)
    return Impact(target, target + left * origin, tuple(sorted(names[each] for each in met)))


def _side(body: ProjectileThrow) -> str:
    """How far a body is around its centre, for messages."""
    if body.radius is not None:
        return f"radius, {body.radius:g} m"
    return f"box's own side, of {body.describe_size()}"


def _row(names: list[str], link: str, body: ProjectileThrow, distance: float) -> int:
    """The row of a link; raises ConfigurationError as `find_impact` does."""
    if link not in names:
        raise ConfigurationError(one_of("link", link, names))
    most = _MOST_RADII * min(body.half_edges)
    if not distance <= most:
        raise ConfigurationError(
            f"distance is {distance:g} m; {body.describe()} may come from {most:g} m at most"
        )
    return names.index(link)


def _missed(link: str, body: ProjectileThrow, distance: float) -> ConfigurationError:
    what = "radius" if body.size is None else "size"
    return ConfigurationError(
        f"{body.describe()} that comes from {distance:g} m away does not touch '{link}'; take "
        f"another '{what}' or 'from', or come from nearer"
    )


def _trace(
    both: BallAndCharacter,
    row: int,
    target: FloatArray,
    origin: FloatArray,
    radius: float,
    distance: float,
) -> tuple[float | None, set[int]]:
    """How far (m) from `target` a body touches link `row`, None if never; rows that it meets.

    The body reaches as far as `radius` to every side, or farther. The gap is how far it may go, at
    least, until it touches (sphere tracing, Hart 1996).
    """
    left, met = distance, set[int]()
    gaps = both.put_ball(target + left * origin)
    for _ in range(_LAST_STEPS + round(distance / radius)):
        if gaps[row] < _TOUCHING_DISTANCE:
            return left, met - {row}
        left -= min(gaps[row], radius)  # a longer step could jump over what is in the way
        gaps = both.put_ball(target + left * origin)
        met |= set(np.flatnonzero(gaps < 0.0).tolist())
    return None, met
