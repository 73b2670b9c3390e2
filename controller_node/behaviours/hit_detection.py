"""Hits detected from contacts: the forces that neither ground nor self-contact explain.

Of each link the net contact force during a tick is known, but not which body it touched. So the
touched links are gathered in groups that may touch each other; inside a group the forces cancel,
action against reaction. The rest comes from outside. The ground pushes, and only so far to the side
as friction allows: a force inside that cone is taken for the ground's where a link of the group
reaches it; where it reaches several of its surfaces, one that is a sum of forces in their cones.
The remaining force, over a short window, is a hit's impulse.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller_node.behaviours.bounding_spheres import BoundingSpheres
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.model import Character
from msgs_config.geometry import fixed_order
from msgs_config.terrain.surfaces import MARGIN, Surfaces

WINDOW = 1.0 / 60.0  # s
_TOUCH_MARGIN = 0.03  # m, between two links
_FRICTION = 0.9  # friction of a link against the ground; not less than the real one
_SWEEPS = 8  # over the cones of several surfaces
_UP, _NONE = np.array(((0.0, 0.0, 1.0),)), np.zeros((0, 3))  # normals


@dataclass(frozen=True)
class Hit:
    """The impulse of a hit over the window."""

    link: int  # an index of `Character.links`, the one struck hardest
    impulse: float  # N s


class HitDetector:
    """Watches the contacts of an episode, tick by tick."""

    def __init__(
        self,
        character: Character,
        period: float,
        window: float = WINDOW,
        terrain: Surfaces | None = None,
    ) -> None:
        """For ticks of `period`; impulses are added up over `window`; s.

        Without the surfaces of a terrain the ground is the plane z = 0.
        """
        self._spheres = BoundingSpheres(character)
        self._terrain = terrain
        self._period = period
        self._recent: deque[FloatArray] = deque(maxlen=max(round(window / period), 1))
        self._before: tuple[FloatArray, FloatArray] | None = None  # the links' frames

    def reset(self) -> None:
        """Begin a new window."""
        self._recent.clear()

    def strongest(
        self, contacts: FloatArray, origins: FloatArray, turns_xyzw: FloatArray
    ) -> Hit | None:
        """The hit of the window that ends with a tick; None if nothing struck.

        `contacts` (links, 6) are the net wrenches of the tick, world axes, N and N m; the links'
        frames (links, 3), (links, 4) are those at its end. Where they were at its beginning, when
        the contacts were found, is known from the call before.
        """
        frames = (origins, turns_xyzw)
        where, self._before = self._before or frames, frames
        self._recent.append(self._period * self._unexplained(contacts[:, :3], *where))
        impulses = fixed_order.norm(fixed_order.total(np.array(self._recent), axis=0))
        total = float(fixed_order.total(impulses))
        return Hit(int(impulses.argmax()), total) if total > 0.0 else None

    def _unexplained(
        self, forces: FloatArray, origins: FloatArray, turns_xyzw: FloatArray
    ) -> FloatArray:
        """Forces (links, 3) in N that neither the ground nor self-contact explains."""
        unexplained = np.zeros_like(forces)
        touched = np.flatnonzero(forces.any(axis=1))
        if not len(touched):
            return unexplained
        normals = self._normals(origins, turns_xyzw)
        groups = [np.arange(len(touched))]
        if not all(len(normals[link]) for link in touched.tolist()):
            centres = self._spheres.centres(origins, turns_xyzw)
            groups = _groups(self._spheres.within_reach(centres, touched, _TOUCH_MARGIN))
        for group in groups:
            links = touched[group]
            rest = fixed_order.total(forces[links], axis=0)
            reached = np.concatenate([normals[link] for link in links.tolist()])
            rest = _beyond_cones(rest, np.unique(reached, axis=0))
            struck = links[int(np.argmax(fixed_order.dot(forces[links], rest)))]
            unexplained[struck] = rest
        return unexplained

    def _normals(self, origins: FloatArray, turns_xyzw: FloatArray) -> Sequence[FloatArray]:
        """For each link the unit normals (k, 3) of the ground's surfaces that it reaches."""
        if self._terrain is not None:
            return self._terrain.normals(origins, turns_xyzw)
        lowest = self._spheres.lowest(self._spheres.centres(origins, turns_xyzw))
        return [_UP if height < MARGIN else _NONE for height in lowest.tolist()]


def _beyond_cones(force: FloatArray, normals: FloatArray) -> FloatArray:
    """A force (3,) without what is a sum of forces in the friction cones about normals (k, 3).

    Each cone takes in turn what it can of what the others leave.
    """
    taken = np.zeros_like(normals)
    for _ in range(_SWEEPS if len(normals) > 1 else 1):
        for row, normal in enumerate(normals):
            offered = force + taken[row]
            force = beyond_cone(offered, _FRICTION, normal)
            taken[row] = offered - force
    return force


def beyond_cone(force: FloatArray, friction: float, normal: FloatArray) -> FloatArray:
    """A force (3,) without its projection on the friction cone about a unit normal (3,)."""
    up = float(fixed_order.dot(force, normal))
    aside = force - up * normal
    sideways = float(fixed_order.norm(aside))
    if sideways <= friction * up:
        return np.zeros(3)
    if friction * sideways + up <= 0.0:  # nearer to the cone's tip than to its side
        return force
    along = (friction * sideways + up) / (1.0 + friction * friction)
    return force - aside * (friction * along / sideways) - along * normal


def _groups(reach: np.ndarray) -> list[IntArray]:
    """The connected parts of a graph of m nodes, its edges (m, m)."""
    left, groups = set(range(len(reach))), []
    while left:
        group, frontier = set(), {left.pop()}
        while frontier:
            node = frontier.pop()
            group.add(node)
            near = left.intersection(np.flatnonzero(reach[node]).tolist())
            left -= near
            frontier |= near
        groups.append(np.array(sorted(group), dtype=np.intp))
    return groups
