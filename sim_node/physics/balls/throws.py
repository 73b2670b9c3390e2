"""Balls that are to be thrown, and wait for their tick. No ROS in here."""

from dataclasses import dataclass, field

from msgs_config.errors import CommandError
from msgs_config.messages.throw import ProjectileThrow

MOST_BALLS = 100
"""In an episode; a hostile sender must not fill the world."""


@dataclass
class ThrowQueue:
    """The throws of an episode that wait, in the order in which they were sent."""

    _queue: list[tuple[int, ProjectileThrow]] = field(default_factory=list)  # each with its tick
    _taken: int = 0

    def add(self, throw: ProjectileThrow, first_tick: int) -> None:
        """Take a throw that begins in the state of a tick.

        Raises:
            CommandError: there are too many in this episode.
        """
        if self._taken + len(self._queue) >= MOST_BALLS:
            raise CommandError(f"an episode has at most {MOST_BALLS} balls")
        self._queue.append((first_tick, throw))

    def take(self, tick: int) -> list[ProjectileThrow]:
        """The throws that begin in the state of a tick."""
        if not self._queue:
            return []
        due = [throw for first_tick, throw in self._queue if first_tick == tick]
        self._queue = [queued for queued in self._queue if queued[0] != tick]
        self._taken += len(due)
        return due

    def clear(self) -> None:
        """Forget all: another episode begins."""
        self._queue.clear()
        self._taken = 0
