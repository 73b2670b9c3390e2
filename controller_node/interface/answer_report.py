"""The diagnostics of a controller: how many states it has answered, and how fast."""

import time
from collections import Counter
from collections.abc import Callable, Mapping

from msgs_config.bus.diagnostics import DIAGNOSTICS_PERIOD, DiagnosticsPublisher
from msgs_config.bus.node import BusNode
from msgs_config.runtime.durations import Durations


class AnswerReport:
    """Counts, and publishes the counts of this and others from time to time."""

    def __init__(self, node: BusNode, character: str) -> None:
        """`character` is the name of the hardware in the diagnostics."""
        self.counts: Counter[str] = Counter(answered=0, repeated=0, ignored=0, overtaken=0)
        self.answer_times = Durations()
        self._character = character
        self._publisher = DiagnosticsPublisher(node)
        self._next_time = 0.0

    def publish(self, others: Callable[[], Mapping[str, object]], *, at_once: bool = False) -> None:
        """Publish if it is due and there is a subscriber."""
        now = time.monotonic()
        if now < self._next_time and not at_once:
            return
        self._next_time = now + DIAGNOSTICS_PERIOD
        if self._publisher.is_heard:
            times = self.answer_times.percentiles_us("answer", (50, 99))
            self._publisher.publish({**self.counts, **others(), **times}, character=self._character)
