"""Pins: points of links that are held to places in the world, and those that wait. No ROS here."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import CommandError, one_of

LEAST_FORCE, MOST_FORCE = 1e-3, 1e6  # N, of what holds
_MAX_COORDINATE = 1e6  # m
_MOST_WAITING = 10_000  # pins; a hostile sender must not fill the memory


@dataclass(frozen=True)
class Pin:
    """A point of a link that is held to a place in the world; a link has one at most."""

    link: int  # index in `Character.links`
    place: tuple[float, float, float]  # m, world
    point: tuple[float, float, float]  # m, link frame
    force: float  # N, the largest; 0 lets go


def changed_pins(held: Sequence[Pin], changes: Sequence[Pin]) -> tuple[Pin, ...]:
    """The pins in force after changes, which count one after another; in the links' order.

    Sums depend on the order, so it does not depend on what was there before.
    """
    by_link = {pin.link: pin for pin in held} | {pin.link: pin for pin in changes}
    return tuple(by_link[link] for link in sorted(by_link) if by_link[link].force)


class PinQueue:
    """The pins of one character that are to be changed, and wait for their ticks."""

    def __init__(self, character: Character) -> None:
        self._rows = {link.name: row for row, link in enumerate(character.links)}
        self._waiting: list[tuple[int, Pin]] = []  # each with its tick

    def add(
        self,
        names: Sequence[str],
        places: FloatArray,
        points: FloatArray,
        forces: FloatArray,
        *,
        first_tick: int,
    ) -> None:
        """Take pins of links by name, all or none; see `Pin`.

        `forces` are (m,); `places` (m, 3), or (0, 3) where all forces are 0; `points` (m, 3), or
        (0, 3) for the links' origins. They act from the step that begins at `first_tick` on.

        Raises:
            CommandError: a link does not exist, a length or a number is wrong, or too many wait.
        """
        self._check(names, places, points, forces)
        places, points = (  # -0.0 becomes 0.0: what is reported says all that acts, to the bit
            each + 0.0 if len(each) else np.zeros((len(names), 3)) for each in (places, points)
        )
        rows = zip(names, places.tolist(), points.tolist(), forces.tolist(), strict=True)
        self._waiting += [
            (first_tick, Pin(self._rows[name], tuple(place), tuple(point), force))
            for name, place, point, force in rows
        ]

    def take(self, tick: int) -> list[Pin]:
        """The changes that begin with the step of a tick, in the order in which they were sent."""
        if not self._waiting:
            return []
        due = [pin for first_tick, pin in self._waiting if first_tick == tick]
        self._waiting = [each for each in self._waiting if each[0] > tick]
        return due

    def clear(self) -> None:
        """Forget all."""
        self._waiting.clear()

    def _check(
        self, names: Sequence[str], places: FloatArray, points: FloatArray, forces: FloatArray
    ) -> None:
        if not names:
            raise CommandError("an empty pin")
        for name in names:
            if not isinstance(name, str) or name not in self._rows:
                raise CommandError(one_of("link", name, list(self._rows)))
        count = len(names)
        if len(forces) != count:
            raise CommandError(f"{count} links but {len(forces)} wrenches")
        for name, force in zip(names, forces.tolist(), strict=True):
            if force and not LEAST_FORCE <= force <= MOST_FORCE:
                raise CommandError(
                    f"the largest force on '{name}' is {force:g} N; it must be 0, or "
                    f"{LEAST_FORCE:g} to {MOST_FORCE:g} N"
                )
        if len(places) != count and (len(places) or forces.any()):
            raise CommandError(f"{count} links but {len(places)} transforms")
        if len(points) not in (0, count):
            raise CommandError(f"{count} links but {len(points)} twists")
        for what, rows in (("place", places), ("point", points)):
            sound = (np.abs(rows) <= _MAX_COORDINATE).all(axis=-1)  # NaN is unsound
            if not sound.all():
                name = names[int(np.argmin(sound))]
                raise CommandError(
                    f"the {what} of '{name}' is not finite, or beyond {_MAX_COORDINATE:g} m"
                )
        if len(self._waiting) + count > _MOST_WAITING:
            raise CommandError(f"more than {_MOST_WAITING} pins wait")
