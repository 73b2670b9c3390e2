"""When thrown balls have hit a character, by what was recorded alone."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.bags.thrown_balls import thrown_balls
from actuated_characters.metrics.recording_metrics import gravities
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.geometry import rotations
from msgs_config.messages.throw import ProjectileThrow
from msgs_config.messages.wrenches import WrenchArrays

_LEAST_CHANGE = 0.1  # m/s, of a ball's velocity in a tick beside that by gravity
_LEAST_SHARE = 0.3  # of the force on the ball that is also on the link, as the contacts have it
# m: so near to a ball's surface are a link's contacts, which are one point in their middle
_NEAR = 0.15
_PAUSE = 0.25  # s: of a ball that touches a body again so soon it is the same hit


@dataclass(frozen=True)
class Hit:
    """A ball strikes a link."""

    time: float  # s since the first state
    ball: str
    link: str
    impulse: float  # N s, on the ball in the first tick


def find_hits(recording: Recording) -> list[Hit]:
    """The hits by balls, in order; none without contacts or motion of balls.

    A ball has hit where its velocity changes by more than gravity does, and the contact force on a
    link near it changes along with it: a ball on the ground moves no link. Nothing is told of balls
    whose mass and size are not known, because they were thrown before the first state.
    """
    if not recording.contacts or not recording.balls:
        return []
    step, model = 1.0 / int(recording.parameters["rate"]), DynamicsModel(recording.character)
    hits, last = list[Hit](), dict[str, float]()
    for ball in _struck(recording, step):
        model.update(recording.position[ball.tick + 1], recording.velocity[ball.tick + 1])
        link = _pushed_link(recording, ball, step, *model.link_poses())
        if link is None:
            continue
        time = float(recording.times[ball.tick + 1])
        if time - last.get(ball.name, -np.inf) > _PAUSE:
            hits.append(Hit(time, ball.name, link, float(np.linalg.norm(ball.impulse))))
        last[ball.name] = time
    return hits


@dataclass(frozen=True)
class _Struck:
    """A ball on which something else than gravity acts in a tick."""

    tick: int
    name: str
    centre: FloatArray  # (3,) m, world, after the tick
    reach: float  # m: nothing of it is farther from its centre
    impulse: FloatArray  # (3,) N s, beside gravity's


def _struck(recording: Recording, step: float) -> Iterator[_Struck]:
    """The balls of known throws on which something acts, tick by tick."""
    gravity, begins = gravities(recording), set(recording.episode_rows.tolist())
    thrown = {
        begin: {each.name: each.throw for each in balls}
        for begin, balls in thrown_balls(recording).items()
    }
    throws: dict[str, ProjectileThrow] = {}  # of the episode
    for tick, (before, after) in enumerate(pairwise(recording.balls)):
        throws = thrown.get(tick, throws)
        if before is None or after is None or tick + 1 in begins:
            continue
        count = min(len(before.names), len(after.names))
        change = after.motion[:count, 7:10] - before.motion[:count, 7:10]
        change[:, 2] += np.nan_to_num(gravity[tick]) * step
        for number in np.flatnonzero(np.linalg.norm(change, axis=1) > _LEAST_CHANGE).tolist():
            name, centre = after.names[number], after.motion[number, :3]
            throw = throws.get(name)
            if throw is not None:
                yield _Struck(tick, name, centre, throw.reach, throw.mass * change[number])


def _pushed_link(
    recording: Recording, ball: _Struck, step: float, origins: FloatArray, turns_xyzw: FloatArray
) -> str | None:
    """The link near a ball on which the opposite of the ball's force acts anew; None if on none.

    Frames of the links are at (l, 3), m, world, with the orientations (l, 4).
    """
    rows = {link.name: row for row, link in enumerate(recording.character.links)}
    before = _forces(recording.contacts[ball.tick - 1] if ball.tick else None)
    force = ball.impulse / step
    size = float(np.linalg.norm(force))
    shares: dict[str, float] = {}
    for link, (acting, point) in _forces(recording.contacts[ball.tick]).items():
        row = rows.get(link)
        if row is None:
            continue
        place = origins[row] + rotations.rotate(turns_xyzw[row], point)
        if np.linalg.norm(place - ball.centre) <= ball.reach + _NEAR:
            old = before[link][0] if link in before else np.zeros(3)
            shares[link] = float(np.dot(old - acting, force)) / size**2
    found = max(shares, key=lambda name: shares[name], default=None)
    return found if found is not None and shares[found] >= _LEAST_SHARE else None


def _forces(contacts: WrenchArrays | None) -> dict[str, tuple[FloatArray, FloatArray]]:
    """The contact force on each link (3,), N, and where it acts (3,), m in the link's frame."""
    if contacts is None:
        return {}
    points = contacts.points if len(contacts.points) else np.zeros((len(contacts.links), 3))
    forces = contacts.wrenches[:, :3]
    return dict(zip(contacts.links, zip(forces, points, strict=True), strict=True))
