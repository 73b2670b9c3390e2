"""What is sent for a tick to come: taken whole, or refused in a line that is said once."""

from collections import Counter
from collections.abc import Callable
from typing import TypeAlias

from rclpy.node import Node

from msgs_config.errors import CommandError, MessageError
from msgs_config.messages.clock import TickClock
from msgs_config.messages.joint_state import read_frame_id
from msgs_config.messages.session import ANONYMOUS, ForeignSessions, read_session
from msgs_config.messages.topics import Topic
from msgs_config.runtime.once_logger import OnceLogger
from msgs_config.runtime.polling import DirectSubscription

_MOST_A_TICK = 100  # messages; a flood of them must not stop the world
_MOST_FORGOTTEN = 20_000  # messages, more than can wait

FirstTick: TypeAlias = Callable[[int], int]
"""The tick that a stamp in ns is for; raises CommandError if that is over."""


class OwnSession:
    """Rejects what names the session of another simulator; what names none may be for any."""

    def __init__(self, session: str, logger: OnceLogger) -> None:
        self._session = session
        self._once_logger = logger
        self._foreign = ForeignSessions()

    @property
    def counts(self) -> Counter[str]:
        """How many messages were rejected, by the topic's name."""
        return self._foreign.counts

    def rejects(self, topic: Topic, frame_id: str) -> bool:
        """Whether a message with this `frame_id` is for another simulator; it is counted then."""
        session = read_session(frame_id)
        if session in (self._session, ANONYMOUS):
            return False
        line = self._foreign.reject(topic.name, session, self._session)
        if line is not None:
            self._once_logger.log_once(line)
        return True


class _PastError(CommandError):
    """A message is for a tick that is over, which is told once, whatever its stamp."""


class StampedSubscription:
    """A topic whose messages act from the first tick not before their stamp; 0: from the next."""

    def __init__(
        self, node: Node, topic: Topic, what: str, of: str, own: OwnSession, logger: OnceLogger
    ) -> None:
        """Subscribe; warnings begin with `what` and whom it is `of`."""
        self.counts = Counter[str]()
        self._topic = topic
        self._own = own
        self._what = what
        self._of = of
        self._once_logger = logger
        self._messages = DirectSubscription(node, topic)

    def take(self, clock: TickClock, tick: int, use: Callable[[bytes, FirstTick], None]) -> None:
        """Hand what has come to `use`, which may refuse it by an error, before a tick's step."""

        def first_tick(stamp_ns: int) -> int:
            found = clock.first_tick_from(stamp_ns) if stamp_ns else tick
            if found < tick:
                raise _PastError(
                    f"its stamp, {stamp_ns} ns, is over; the state is of {clock.stamp_ns(tick)} "
                    "ns; 0 means the next tick"
                )
            return found

        for _ in range(_MOST_A_TICK):
            raw = self._messages.take()
            if raw is None:
                return
            try:
                if self._own.rejects(self._topic, _frame_id(raw)):
                    continue
                use(raw, first_tick)
                self.counts["accepted"] += 1
            except (MessageError, CommandError) as error:
                self.counts["rejected"] += 1
                past = f"a {self._what}{self._of} of the past"
                kind = past if isinstance(error, _PastError) else ""
                self._once_logger.log_once(f"{self._what}{self._of} refused: {error}", kind)

    def forget(self) -> None:
        """Leave unread what was sent in the episode before."""
        forget(self._messages)


def _frame_id(raw: bytes) -> str:
    """The `frame_id` of a message; empty where it has none, which its decoder has a line for."""
    try:
        return read_frame_id(raw)
    except MessageError:
        return ""


def forget(messages: DirectSubscription) -> None:
    """Take what has come so far, and do nothing with it."""
    for _ in range(_MOST_FORGOTTEN):
        if messages.take() is None:
            return
