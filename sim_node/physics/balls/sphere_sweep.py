"""Where a ball that flies straight at a link meets a character."""

from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.engine import World, make_world
from sim_node.physics.settings import WorldSettings

_TOUCHING_DISTANCE = 1e-6  # m: what is nearer counts as touching
_MOST_RADII = 20_000.0  # radii of the ball that it may come from at most
_LAST_STEPS = 1000  # most steps from nearer than a radius until the ball touches


@dataclass(frozen=True)
class Impact:
    """A ball that touches a link, having come straight towards the link's centre of mass."""

    target: FloatArray  # (3,) m, world: the link's centre of mass
    centre: FloatArray  # (3,) m, world: the ball's
    before: tuple[str, ...]  # links that the ball would have met on its way


class BallAndCharacter:
    """A ball beside a character, in a world of their own where nothing moves."""

    def __init__(self, world: World, character: Character, radius: float) -> None:
        self._world = world
        self._still = np.zeros(character.layout.size)
        self._body = world.add(character)
        world.balls.add(ProjectileThrow(1.0, radius, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))

    def put_character(self, position: FloatArray) -> FloatArray:
        """Put the character into a state (n,), message form; returns the links' centres (l, 3)."""
        self._body.set_state(position, self._still)
        return np.array(self._body.centres())

    def put_ball(self, centre: FloatArray) -> FloatArray:
        """Put the ball somewhere (3,), m; returns how far (l,) it is from the links' surfaces, m.

        Negative: inside of a link; infinite: the link has no surface.
        """
        self._world.balls.place(0, centre)
        return self._body.gaps(0)


def find_impact(
    character: Character,
    position: FloatArray,
    link: str,
    origin: FloatArray,
    radius: float,
    distance: float,
) -> Impact:
    """Where a ball meets a link of a character that stands still.

    Args:
        character: The character.
        position: Its state (n,), message form.
        link: The link that the ball flies at.
        origin: Unit vector (3,) from the link's centre of mass to where the ball comes from.
        radius: The ball's, m.
        distance: How far from the centre of mass it comes, m.

    Raises:
        ConfigurationError: the link does not exist, has no surface, or is in the ball already; or
            the ball comes from too far for its size, or past the link.
    """
    names = [one.name for one in character.links]
    row = _row(names, link, radius, distance)
    with make_world(WorldSettings(ground=False)) as world:
        both = BallAndCharacter(world, character, radius)
        target = both.put_character(position)[row]
        gaps = both.put_ball(target + distance * origin)
        if not np.isfinite(gaps[row]):
            raise ConfigurationError(f"link '{link}' has no surface that could be hit")
        if gaps[row] <= 0.0:
            raise ConfigurationError(
                f"distance is {distance:g} m; '{link}' is nearer than the radius, {radius:g} m"
            )
        left, met = _trace(both, row, target, origin, radius, distance)
    if left is None:
        raise _missed(link, radius, distance)
    return Impact(target, target + left * origin, tuple(sorted(names[each] for each in met)))


def _row(names: list[str], link: str, radius: float, distance: float) -> int:
    """The row of a link; raises ConfigurationError as `find_impact` does."""
    if link not in names:
        raise ConfigurationError(one_of("link", link, names))
    if not distance <= _MOST_RADII * radius:
        raise ConfigurationError(
            f"distance is {distance:g} m; a ball with a radius of {radius:.3g} m may come from "
            f"{_MOST_RADII * radius:g} m at most"
        )
    return names.index(link)


def _missed(link: str, radius: float, distance: float) -> ConfigurationError:
    return ConfigurationError(
        f"a ball with a radius of {radius:.3g} m that comes from {distance:g} m away does "
        f"not touch '{link}'; take another 'radius' or 'from', or come from nearer"
    )


def _trace(
    both: BallAndCharacter,
    row: int,
    target: FloatArray,
    origin: FloatArray,
    radius: float,
    distance: float,
) -> tuple[float | None, set[int]]:
    """How far (m) from `target` a ball touches link `row`, None if never; rows that it meets.

    The gap is how far the ball may go, at least, until it touches (sphere tracing, Hart 1996).
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
