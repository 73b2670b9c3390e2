"""What touches what in the engine, with which force, and where."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

from msgs_config.bullet import pybullet


class Touch(NamedTuple):
    """One contact as one of its two links feels it; world axes."""

    link: int  # the engine's number
    force: Sequence[float]  # (3,) N
    point: Sequence[float]  # (3,) m, where the engine let the force act


TouchedLinks: TypeAlias = Mapping[int, Sequence[Touch]]
"""By body number, what touches its links."""


def read_contacts(client: int) -> TouchedLinks:
    """The contacts of the last engine step, each on both bodies, in opposite directions.

    Points are where the surfaces were when the step began: the engine looks for contacts first,
    and moves last. On each body it is that body's own surface; the two are apart by the depth at
    which the bodies are in each other.
    """
    touched = defaultdict[int, list[Touch]](list)
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
        touched[point[1]].append(Touch(point[3], force, point[5]))
        touched[point[2]].append(Touch(point[4], [-f for f in force], point[6]))
    return touched
