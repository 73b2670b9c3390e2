"""Publishes keyframes of a node: all that it goes on from in the state of a stamp."""

import math
from collections.abc import Iterator

from msgs_config.bus.node import BusNode
from msgs_config.bus.publishing import Outgoing, has_subscribers
from msgs_config.messages.clock import FIRST_TICK, TickClock
from msgs_config.messages.keyframe import Keyframe, encode_keyframe
from msgs_config.messages.topic import Topic
from msgs_config.shared_parameters import KeyframeSettings

_BYTES_PER_KB = 1000


class KeyframePublisher:
    """Publishes a keyframe once a period of simulated time, or less often if it is large.

    Simulator and controllers have theirs of the same states. What nobody hears is not made.
    """

    def __init__(
        self,
        node: BusNode,
        topic: Topic,
        clock: TickClock,
        settings: KeyframeSettings,
        *,
        at_once: bool,
    ) -> None:
        """Offer the topic; with a period of 0 there are no keyframes.

        A node that goes on from a keyframe publishes one of its first state, `at_once`.
        """
        period_s = settings.period
        self._publisher, self._budget = node.publisher(topic), settings.budget
        self._clock, self._period_s, self._at_once = clock, period_s, at_once
        self._ticks = max(round(period_s * clock.rate_hz), 1)
        self._every = 1  # periods from one keyframe to the next, by the size of the last

    def is_due(self, stamp_ns: int) -> bool:
        """Whether the keyframe of a stamp's state is to be made; asked for in each tick."""
        if not self._period_s:
            return False
        period, remainder = divmod(self._clock.tick(stamp_ns) - FIRST_TICK, self._ticks)
        is_due = self._at_once or (period and not remainder and not period % self._every)
        return bool(is_due) and has_subscribers(self._publisher)

    def messages(self, stamp_ns: int, session: str, memory: bytes) -> Iterator[Outgoing]:
        """The keyframe of a stamp's state, for which one is due, unless it is too large by now."""
        raw = encode_keyframe(Keyframe(stamp_ns, session, memory))
        budget = self._period_s * self._budget * _BYTES_PER_KB
        self._every = math.ceil(len(raw) / budget)
        if self.is_due(stamp_ns):
            self._at_once = False
            yield self._publisher, raw
