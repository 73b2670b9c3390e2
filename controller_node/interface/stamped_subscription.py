"""Messages that count from a stamp on: taken before the answer to a state, or refused in a line."""

from collections.abc import Callable
from typing import Any

from builtin_interfaces.msg import Duration, Time
from rclpy.node import Node

from msgs_config.errors import LayoutError, MessageError, MotionError
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.joint_state import decode
from msgs_config.messages.topics import Topic
from msgs_config.runtime.once_logger import OnceLogger
from msgs_config.runtime.polling import DirectSubscription

_LARGEST = 2**25  # bytes of a message
_LATEST_NS = 10**15  # after now
_MOST_AT_ONCE = 100  # messages; a flood of them must not keep the states waiting


class StampedSubscription:
    """A topic whose messages count from their header's stamp on, without one at once."""

    def __init__(
        self,
        node: Node,
        topic: Topic,
        what: str,
        use: Callable[[Any, int], None],
        logger: OnceLogger,
    ) -> None:
        """Hand each message and its start in ns to `use`, which may refuse it by an error."""
        self._type = topic.message_type
        self._what = what
        self._use = use
        self._once_logger = logger
        self._inbox = DirectSubscription(node, topic)
        self.refused = 0

    def take(self, state_ns: int) -> None:
        """Take what has come before the answer to the state of a stamp, ns."""
        for _ in range(_MOST_AT_ONCE):
            raw = self._inbox.take()
            if raw is None:
                return
            try:
                if len(raw) > _LARGEST:
                    raise MotionError(
                        f"{self._what}: it has {len(raw)} bytes; it must have {_LARGEST} or fewer"
                    )
                message = decode(raw, self._type)
                self._use(message, self._start_of(message.header.stamp, state_ns))
            except (MotionError, MessageError, LayoutError) as error:
                self.refused += 1
                self._once_logger.log_once(f"refused {error}")

    def _start_of(self, stamp: Time, state_ns: int) -> int:
        start_ns = nanoseconds(stamp) or state_ns
        if start_ns < state_ns:
            raise MotionError(
                f"{self._what}: it begins at {start_ns} ns, which is over; it must be {state_ns} "
                "ns or later, or 0 for at once"
            )
        if start_ns > state_ns + _LATEST_NS or stamp.nanosec >= 10**9:
            raise MotionError(
                f"{self._what}: its stamp is {stamp.sec} s and {stamp.nanosec} ns; it must be a "
                "time, and within 1e6 s"
            )
        return start_ns


def nanoseconds(time: Time | Duration) -> int:
    """A time of a message in ns."""
    return int(time.sec) * NANOSECONDS_PER_SECOND + int(time.nanosec)
