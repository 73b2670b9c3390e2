"""Pushes from outside: forces on links that wait for their tick. No ROS in here."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import CommandError, one_of

_MOST_WAITING = 10_000  # pushes; a hostile sender must not fill the memory


@dataclass(frozen=True)
class ExternalWrench:
    """A force and a torque on one link, held for some ticks."""

    link: int  # index in `Character.links`
    wrench: FloatArray  # (6,): force N, torque N m; world axes
    point: FloatArray  # (3,) where the force acts, m in the link frame
    first_tick: int  # the tick of the state from which it acts
    ticks: int

    def acts_at(self, tick: int) -> bool:
        """Whether it acts during the step that begins at a tick."""
        return self.first_tick <= tick < self.first_tick + self.ticks


class WrenchQueue:
    """The pushes of one character that wait or act."""

    def __init__(self, character: Character) -> None:
        self._rows = {link.name: row for row, link in enumerate(character.links)}
        self._centres = np.array([link.inertial_pose.position for link in character.links])
        self._pushes: list[ExternalWrench] = []

    def add(
        self,
        names: Sequence[str],
        wrenches: FloatArray,
        points: FloatArray,
        *,
        first_tick: int,
        ticks: int,
    ) -> None:
        """Take pushes on links by name, all or none; see `ExternalWrench`.

        `wrenches` is (m, 6); `points` is (m, 3), or (0, 3) for the links' centres of mass.

        Raises:
            CommandError: a link does not exist, a length or a number is wrong, or too many wait.
        """
        self._check(names, wrenches, points)
        rows = [self._rows[name] for name in names]
        if not len(points):
            points = self._centres[rows]
        self._pushes += [
            ExternalWrench(row, wrench, point, first_tick, ticks)
            for row, wrench, point in zip(rows, wrenches.copy(), points.copy(), strict=True)
        ]

    def take(self, tick: int) -> list[ExternalWrench]:
        """The pushes that act during the step that begins at a tick; forgets what is over."""
        if not self._pushes:
            return []
        self._pushes = [p for p in self._pushes if tick < p.first_tick + p.ticks]
        return [push for push in self._pushes if push.acts_at(tick)]

    @property
    def pushes(self) -> tuple[ExternalWrench, ...]:
        """Those that wait or act."""
        return tuple(self._pushes)

    def replace(self, pushes: Sequence[ExternalWrench]) -> None:
        """Have these pushes, of a queue of the same character, and no others."""
        self._pushes = list(pushes)

    def clear(self) -> None:
        """Forget all."""
        self._pushes.clear()

    def _check(self, names: Sequence[str], wrenches: FloatArray, points: FloatArray) -> None:
        if not names:
            raise CommandError("an empty push")
        for name in names:
            if not isinstance(name, str) or name not in self._rows:
                raise CommandError(one_of("link", name, list(self._rows)))
        if len(wrenches) != len(names):
            raise CommandError(f"{len(names)} links but {len(wrenches)} wrenches")
        if len(points) not in (0, len(names)):
            raise CommandError(f"{len(names)} links but {len(points)} transforms")
        for what, rows, size in (("wrench", wrenches, 6), ("point", points, 3)):
            if rows.shape[1:] != (size,):
                raise CommandError(f"a {what} has shape {rows.shape[1:]}; it must be ({size},)")
            finite = np.isfinite(rows).all(axis=1)
            if not finite.all():
                name = names[int(np.argmin(finite))]
                raise CommandError(f"the {what} on '{name}' is not finite")
        if len(self._pushes) + len(names) > _MOST_WAITING:
            raise CommandError(f"more than {_MOST_WAITING} pushes wait")
