"""What touches what in the engine, with which force, and where."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

from msgs_config.character.bullet import pybullet


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
        _, body, body_b, link, link_b, at, at_b, normal, distance, along, one, a, other, b = point
        if distance > 0.0 and along == 0.0:
            continue  # near enough to be watched by the engine, but apart
        x = along * normal[0] + one * a[0] + other * b[0]  # written out: at each tick, of each
        y = along * normal[1] + one * a[1] + other * b[1]
        z = along * normal[2] + one * a[2] + other * b[2]
        touched[body].append(Touch(link, (x, y, z), at))
        touched[body_b].append(Touch(link_b, (-x, -y, -z), at_b))
    return touched
