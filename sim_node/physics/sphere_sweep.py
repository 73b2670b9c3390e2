"""Where a ball that flies straight at a link meets a character."""

from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.body import Body
from sim_node.physics.world import World, WorldSettings

_CLOSE = 1e-6  # m that count as touching
_MOST_RADII = 20_000.0  # from the place where it is let go
_LAST_STEPS = 1000  # nearer than a radius, until it touches


@dataclass(frozen=True)
class Impact:
    """A ball that touches a link, having come straight towards the link's centre of mass."""

    target: FloatArray  # (3,) m, world: the centre of mass
    centre: FloatArray  # (3,) m, world: the ball's
    before: tuple[str, ...]  # links that it would have met on its way


def find_impact(
    character: Character,
    position: FloatArray,
    link: str,
    origin: FloatArray,
    radius: float,
    distance: float,
) -> Impact:
    """Where a ball meets a link of a character that stands still at a position (n,), message form.

    The ball, of a radius in m, flies at the link's centre of mass, from a distance in m along
    `origin`, a unit vector (3,).

    Raises:
        ConfigurationError: the link does not exist, has no surface, or is in the ball already; or
            the ball comes from too far for its size, or past the link.
    """
    names = [one.name for one in character.links]
    if link not in names:
        raise ConfigurationError(one_of("link", link, names))
    row = names.index(link)
    if not distance <= _MOST_RADII * radius:
        raise ConfigurationError(
            f"distance is {distance:g} m; a ball with a radius of {radius:.3g} m may come from "
            f"{_MOST_RADII * radius:g} m at most"
        )
    with World(WorldSettings(ground=False)) as world:
        body = world.add(character)
        body.set_state(position, np.zeros(character.layout.size))
        target = np.array(body.centres()[row])
        x, y, z = (target + distance * origin).tolist()
        world.balls.add(ProjectileThrow(1.0, radius, (x, y, z), (0.0, 0.0, 0.0)))
        gaps = body.gaps(world.balls.numbers[0])
        if not np.isfinite(gaps[row]):
            raise ConfigurationError(f"link '{link}' has no surface that could be hit")
        if gaps[row] <= 0.0:
            raise ConfigurationError(
                f"distance is {distance:g} m; '{link}' is nearer than the radius, {radius:g} m"
            )
        swept = _sweep(world, body, row, target, origin, distance)
    if swept is None:
        raise ConfigurationError(
            f"a ball with a radius of {radius:.3g} m that comes from {distance:g} m away does "
            f"not touch '{link}'; take another 'radius' or 'from', or come from nearer"
        )
    centre, met = swept
    return Impact(target, centre, tuple(sorted(names[each] for each in met)))


def _sweep(
    world: World,
    body: Body,
    row: int,
    target: FloatArray,
    origin: FloatArray,
    distance: float,
) -> tuple[FloatArray, set[int]] | None:
    """Move the world's ball towards a target (3,), m, until it touches a link.

    It comes from `origin`, a unit vector (3,), and begins at a distance in m. Returns its centre
    (3,) and the rows of other links that it met; None if it passes. The gap is how far the ball may
    go, at least, until it touches (sphere tracing).
    """
    ball, radius = world.balls.numbers[0], world.balls.throws[0].radius
    left, met = distance, set[int]()
    gaps = body.gaps(ball)
    for _ in range(_LAST_STEPS + round(distance / radius)):
        if gaps[row] < _CLOSE:
            return target + left * origin, met
        left -= min(gaps[row], radius)  # or it would jump over what is in the way
        world.balls.place(0, target + left * origin)
        gaps = body.gaps(ball)
        met |= {each for each in np.flatnonzero(gaps < 0.0).tolist() if each != row}
    return None
