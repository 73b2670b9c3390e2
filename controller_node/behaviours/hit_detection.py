"""Hits detected from contacts: the forces that neither ground nor self-contact explain.

Of each link the net contact force during a tick is known, but not which body it touched. So the
touched links are gathered in groups that may touch each other; inside a group the forces cancel,
action against reaction. The rest comes from outside. The ground pushes, and only so far to the side
as friction allows: a force inside that cone is taken for the ground's where a link of the group
reaches it. The remaining force, over a short window, is a hit's impulse.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from controller_node.behaviours.bounding_spheres import BoundingSpheres
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.model import Character
from msgs_config.geometry import fixed_order

WINDOW = 1.0 / 60.0  # s
_GROUND_MARGIN = 0.03  # m, above the ground, z = 0
_TOUCH_MARGIN = 0.03  # m, between two links
_FRICTION = 0.9  # friction of a link against the ground; not less than the real one


@dataclass(frozen=True)
class Hit:
    """The impulse of a hit over the window."""

    link: int  # an index of `Character.links`, the one struck hardest
    impulse: float  # N s


class HitDetector:
    """Watches the contacts of an episode, tick by tick."""

    def __init__(self, character: Character, period: float, window: float = WINDOW) -> None:
        """For ticks of `period`; impulses are added up over `window`; s."""
        self._spheres = BoundingSpheres(character)
        self._period = period
        self._recent: deque[FloatArray] = deque(maxlen=max(round(window / period), 1))
        self._before: FloatArray | None = None

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
        centres = self._spheres.centres(origins, turns_xyzw)
        where, self._before = centres if self._before is None else self._before, centres
        self._recent.append(self._period * self._unexplained(contacts[:, :3], where))
        impulses = fixed_order.norm(fixed_order.total(np.array(self._recent), axis=0))
        total = float(fixed_order.total(impulses))
        return Hit(int(impulses.argmax()), total) if total > 0.0 else None

    def _unexplained(self, forces: FloatArray, centres: FloatArray) -> FloatArray:
        """Forces (links, 3) in N that neither the ground nor self-contact explains."""
        unexplained = np.zeros_like(forces)
        touched = np.flatnonzero(forces.any(axis=1))
        if not len(touched):
            return unexplained
        grounded = self._spheres.lowest(centres)[touched] < _GROUND_MARGIN
        groups = [np.arange(len(touched))]
        if not grounded.all():
            groups = _groups(self._spheres.within_reach(centres, touched, _TOUCH_MARGIN))
        for group in groups:
            links = touched[group]
            rest = fixed_order.total(forces[links], axis=0)
            if grounded[group].any():
                rest = beyond_cone(rest, _FRICTION)
            struck = links[int(np.argmax(fixed_order.dot(forces[links], rest)))]
            unexplained[struck] = rest
        return unexplained


def beyond_cone(force: FloatArray, friction: float) -> FloatArray:
    """A force (3,) without its projection on the upright friction cone."""
    sideways, up = float(fixed_order.norm(force[:2])), float(force[2])
    if sideways <= friction * up:
        return np.zeros(3)
    if friction * sideways + up <= 0.0:  # nearer to the cone's tip than to its side
        return force
    along = (friction * sideways + up) / (1.0 + friction * friction)
    nearest = np.array((force[0], force[1], 0.0)) * (friction * along / sideways)
    nearest[2] = along
    return force - nearest


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
