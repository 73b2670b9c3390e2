"""Where a ball that flies straight at a link meets a character."""

from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.messages.throw import ProjectileThrow
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
    """Where a ball meets a link of a character that stands still.

    Args:
        character: The character.
        position: Where it stands (n,), message form.
        link: The link that the ball flies at.
        origin: Unit vector (3,) from the link's centre of mass to where the ball comes from.
        radius: The ball's, m.
        distance: How far from the centre of mass it comes, m.

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
        far = target + distance * origin
        x, y, z = far.tolist()
        world.balls.add(ProjectileThrow(1.0, radius, (x, y, z), (0.0, 0.0, 0.0)))
        gaps = body.gaps(world.balls.numbers[0])
        if not np.isfinite(gaps[row]):
            raise ConfigurationError(f"link '{link}' has no surface that could be hit")
        if gaps[row] <= 0.0:
            raise ConfigurationError(
                f"distance is {distance:g} m; '{link}' is nearer than the radius, {radius:g} m"
            )
        left, before = distance, set[str]()
        # the gap is how far the ball may go, at least, until it touches (sphere tracing)
        for _ in range(_LAST_STEPS + round(distance / radius)):
            if gaps[row] < _CLOSE:
                break
            left -= min(gaps[row], radius)  # or it would jump over what is in the way
            world.balls.place(0, target + left * origin)
            gaps = body.gaps(world.balls.numbers[0])
            before |= {names[each] for each in np.flatnonzero(gaps < 0.0).tolist() if each != row}
        else:
            raise ConfigurationError(
                f"a ball with a radius of {radius:.3g} m that comes from {distance:g} m away does "
                f"not touch '{link}'; take another 'radius' or 'from', or come from nearer"
            )
    return Impact(target, target + left * origin, tuple(sorted(before)))
