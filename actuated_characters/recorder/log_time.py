"""Log times of messages in simulated time."""

import struct
import time
from collections.abc import Iterator

from actuated_characters.bags.format.definitions import first_field
from actuated_characters.recorder.session_filter import Heard
from msgs_config.messages import topics
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND

_STAMP_AT, _FIRST_STAMP_AT = 4, 8  # bytes before CDR's first field, and a sequence's first element
_STAMP_TYPES = {"builtin_interfaces/msg/Time", "std_msgs/msg/Header"}
_SETTLED = 0.1  # s in which all messages of one moment are read, also on a busy machine
_MOST_PENDING = 1000  # messages before the first state; few topics have any then


class SimulatedLogTime:
    """Gives each message the time of its stamp, or else that of the last state before it.

    Stamps that are not set, and those of the wall clock, do not count. No message is older than
    the first state: what is latched has the time at which the recording begins. Messages before
    the first state are held until then.
    """

    def __init__(self) -> None:
        self._first_ns: int | None = None
        self._last_ns = 0  # stamp of the newest state
        self._pending: list[Heard] = []
        self._places: dict[str, int | None] = {}  # the offset of the stamp by topic
        self._unsettled: list[tuple[Heard, float]] = []  # with the times of reading, s

    def settle(self, batch: list[Heard], begun: float, read: float) -> list[Heard]:
        """Keep what was read last for later calls; return the rest in order of publishing.

        Where log times are equal the order of writing counts, and topics are read one by one: what
        was published earlier may be on its way still, however long ago that was, for a recorder
        that stood still for a while finds of some topics all and of others nothing yet.

        Args:
            batch: Has been read from all topics.
            begun: Time at which that began, s; of a clock that is never set.
            read: Time at which that ended, s.
        """
        self._unsettled.extend((message, read) for message in batch)
        self._unsettled.sort(key=lambda each: each[0].published_ns)
        latest, now_ns = begun - _SETTLED, time.time_ns()
        old = [message.published_ns for message, at in self._unsettled if at <= latest]
        # A clock that is ahead settles nobody else's messages.
        settled_ns = max((each for each in old if each <= now_ns), default=0)
        settled, unsettled = [], []
        for message, at in self._unsettled:
            if at <= latest or message.published_ns <= settled_ns:
                settled.append(message)
            else:
                unsettled.append((message, at))
        self._unsettled = unsettled
        return settled

    def settle_rest(self) -> list[Heard]:
        """Return what was kept back, in order of publishing."""
        rest, self._unsettled = [message for message, _ in self._unsettled], []
        return rest

    def take(self, message: Heard) -> Iterator[tuple[Heard, int]]:
        """Yield the messages whose log times (ns) are known now, with these, in their order."""
        if self._first_ns is not None:
            yield message, self._log_time_ns(message)
            return
        self._pending.append(message)
        if message.recorded.own_name == topics.JOINT_STATES.name:
            yield from self._release(self._read_stamp(message))
        elif len(self._pending) > _MOST_PENDING:
            yield from self._release(0)

    def finish(self) -> Iterator[tuple[Heard, int]]:
        """Yield the rest at the end: there was no state, and simulated time never began."""
        if self._first_ns is None:
            yield from self._release(0)

    def _release(self, first_ns: int) -> Iterator[tuple[Heard, int]]:
        self._first_ns = self._last_ns = first_ns
        pending, self._pending = self._pending, []
        for message in pending:
            yield message, self._log_time_ns(message)

    def _log_time_ns(self, message: Heard) -> int:
        stamp_ns, last_ns = self._read_stamp(message), self._last_ns
        if stamp_ns <= 0 or abs(stamp_ns - message.published_ns) < abs(stamp_ns - last_ns):
            return last_ns
        if message.recorded.own_name == topics.JOINT_STATES.name:
            self._last_ns = max(last_ns, stamp_ns)
        assert self._first_ns is not None
        return max(stamp_ns, self._first_ns)

    def _read_stamp(self, message: Heard) -> int:
        """The stamp of a message, ns; 0 if it has none."""
        name, raw = message.recorded.name, message.raw
        if name not in self._places:
            self._places[name] = _stamp_place(message.recorded.topic.type_name)
        place = self._places[name]
        try:
            if place is None:
                return 0
            order = "<" if raw[1] & 1 else ">"
            if place == _FIRST_STAMP_AT and raw[_STAMP_AT:_FIRST_STAMP_AT] == bytes(4):
                return 0  # an empty sequence has no stamp
            seconds, nanoseconds = struct.unpack_from(f"{order}iI", raw, place)
        except (struct.error, IndexError):  # whatever these bytes are, they are recorded
            return 0
        return int(seconds) * NANOSECONDS_PER_SECOND + int(nanoseconds)


def _stamp_place(type_name: str) -> int | None:
    """Where a serialised message has its stamp: its own, or that of the first of its elements."""
    first = first_field(type_name)
    if first in _STAMP_TYPES:
        return _STAMP_AT
    if first.endswith("[]") and first_field(first.removesuffix("[]")) in _STAMP_TYPES:
        return _FIRST_STAMP_AT
    return None
