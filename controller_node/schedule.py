"""What a controller is asked for, each from a stamp on."""

from typing import Generic, Protocol, TypeVar

from msgs_config.errors import MotionError

_MOST_WAITING = 100  # messages


class Stamped(Protocol):
    """Something that counts from a stamp on."""

    @property
    def start_ns(self) -> int:
        """The stamp, ns."""


_T = TypeVar("_T", bound=Stamped)


class Schedule(Generic[_T]):
    """What holds in an episode: each from its stamp on, until the next one's."""

    def __init__(self, what: str, first: _T) -> None:
        """`what` is its name for errors; `first` holds at the beginning."""
        self._what = what
        self._in_force = first
        self._pending: list[_T] = []

    def add(self, given: _T) -> None:
        """Take one; of two of one stamp the later one counts.

        Raises:
            MotionError: too many wait for their stamps.
        """
        if len(self._pending) >= _MOST_WAITING:
            raise MotionError(f"{self._what}: more than {_MOST_WAITING} are yet to begin")
        self._pending.append(given)
        # The sort is stable: of one stamp the later one comes last.
        self._pending.sort(key=lambda each: each.start_ns)

    def at(self, stamp_ns: int) -> _T:
        """What holds at a stamp; stamps must not go back."""
        while self._pending and self._pending[0].start_ns <= stamp_ns:
            self._in_force = self._pending.pop(0)
        return self._in_force
