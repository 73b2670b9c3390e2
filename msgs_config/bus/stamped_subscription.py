"""Messages that act from a stamp on: each is taken whole, or rejected in a line logged once."""

from collections.abc import Callable

from msgs_config.bus.node import BusNode
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.errors import CommandError, LayoutError, MessageError, MotionError
from msgs_config.messages.cdr import read_frame_id
from msgs_config.messages.clock import TickClock
from msgs_config.messages.session import OwnSession
from msgs_config.messages.topic import Topic

_MOST_AT_ONCE = 100  # messages; a flood of them must not stop the node's loop


class PastStampError(CommandError):
    """A message is for a time that is over, which is logged once, whatever its stamp."""


def first_tick(clock: TickClock, stamp_ns: int, state_ns: int) -> int:
    """The first tick not before a stamp; for a stamp of 0 that of the state.

    Raises:
        PastStampError: the tick is over.
    """
    now = clock.tick(state_ns)
    tick = clock.first_tick_from(stamp_ns) if stamp_ns else now
    if tick < now:
        raise PastStampError(
            f"its stamp, {stamp_ns} ns, is over; the state is of {state_ns} ns; 0 means the next "
            "tick"
        )
    return tick


class StampedSubscription:
    """A topic whose messages a node takes between two ticks, each of which may be rejected."""

    def __init__(
        self,
        node: BusNode,
        topic: Topic,
        rejection: str,
        use: Callable[[bytes], None],
        logger: OnceLogger,
        session: OwnSession | None = None,
    ) -> None:
        """Hand each serialised message to `use`, which raises an error to reject it.

        The error is logged behind `rejection`. With `session` it rejects foreign messages first.
        """
        self.accepted = 0
        self.rejected = 0
        self._rejection = rejection
        self._use = use
        self._once_logger = logger
        self._session = session
        self.topic = topic.name
        self._messages = node.subscription(topic)

    def take(self) -> None:
        """Take the messages that have come; of a flood the first hundred."""
        for _ in range(_MOST_AT_ONCE):
            raw = self._messages.take()
            if raw is None:
                return
            if self._is_foreign(raw):
                continue
            try:
                self._use(raw)
                self.accepted += 1
            except (CommandError, LayoutError, MessageError, MotionError) as error:
                self.rejected += 1
                kind = f"past {self.topic}" if isinstance(error, PastStampError) else ""
                self._once_logger.log_once(f"{self._rejection}{error}", kind)

    def _is_foreign(self, raw: bytes) -> bool:
        if self._session is None:
            return False
        try:
            return self._session.rejects(self.topic, read_frame_id(raw))
        except MessageError:
            return False  # a decoder says what is wrong with it

    def close(self) -> None:
        """End the subscription."""
        self._messages.close()

    def discard(self) -> None:
        """Discard the messages that have come and were not taken."""
        self._messages.discard()
