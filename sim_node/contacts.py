"""What touches what in the engine, and with which force."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from msgs_config.bullet import pybullet

TouchedLinks: TypeAlias = Mapping[int, Sequence[tuple[int, Sequence[float]]]]
"""By body number: its links' numbers, each with the force (3,) on it, N, world axes."""


def read_contacts(client: int) -> TouchedLinks:
    """The contacts of the last engine step, each on both bodies, in opposite directions."""
    touched = defaultdict[int, list[tuple[int, Sequence[float]]]](list)
    # of all bodies: asked for those of one, the engine lets it come first in each, and then
    # turns the normal round but not the friction
    for point in pybullet.getContactPoints(physicsClientId=client):
        distance, along, one, other = point[8], point[9], point[10], point[12]
        if distance > 0.0 and along == 0.0:
            continue  # near enough to be watched by the engine, but apart
        force = [
            along * n + one * a + other * b
            for n, a, b in zip(point[7], point[11], point[13], strict=True)
        ]
        touched[point[1]].append((point[3], force))
        touched[point[2]].append((point[4], [-f for f in force]))
    return touched
