"""Which of many messages are published for displays: a few a second of the wall clock.

What a program shows needs no message that comes between two pictures, and each one costs its
publisher. Which ones are left out depends on the machine's load, so no computation may use them.
"""

import time
from collections.abc import Callable

THROTTLED_RATE = 60.0  # 1/s of wall time


class Throttle:
    """Chooses the first message of each period, and the last one when no others follow.

    The periods are those of the machine's monotonic clock, so nodes that take part in the same tick
    choose messages of the same tick.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """The first message is chosen; `clock` is in s."""
        self._clock = clock
        self._period = -1  # number of the period of the last message
        self._left_out = False

    def chooses(self) -> bool:
        """Whether the message that is made now is published."""
        period = int(self._clock() * THROTTLED_RATE)
        self._left_out = period == self._period
        self._period = period
        return not self._left_out

    def makes_up(self) -> bool:
        """Whether the last message, which was left out, is published now: none has followed it."""
        if not self._left_out or int(self._clock() * THROTTLED_RATE) < self._period + 2:
            return False
        self._left_out = False
        return True
