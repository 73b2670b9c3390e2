"""`recorder` on the bus of one process: it hears each message while that is published."""

import time
from collections.abc import Callable
from functools import partial

from actuated_characters.recorder.parameters import RecorderSettings
from actuated_characters.recorder.recorder import Recorder
from actuated_characters.recorder.session_filter import Heard
from actuated_characters.recorder.topics import RecordedTopic, wanted_topics
from msgs_config.bus.composition import UNTIL_A_MESSAGE, ComposableNode, Turns
from msgs_config.bus.in_process import InProcessNode
from msgs_config.bus.node import Executor, StopFlag

_FLUSH_PERIOD = 0.5  # s: messages that are older outlive even a kill of the process


class InProcessRecorder(ComposableNode):
    """Records all topics in the order in which their messages were published."""

    def __init__(self, node: InProcessNode, progress: Callable[[int], object]) -> None:
        """Open the bag and listen; `progress` is told the last tick now and then.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or the directory cannot be written to.
        """
        super().__init__(node)
        settings = RecorderSettings.given(node.given_parameters())
        self._progress = progress
        self._progress_period = settings.progress_period or float("inf")  # 0: never
        self._recorded = wanted_topics(node, settings)
        self._recorder = Recorder(node, settings)
        self._heard_ns = 0
        try:
            for recorded in self._recorded:
                self._recorder.add(recorded, recorded.topic.quality)
                node.listen(recorded.topic, partial(self._hear, recorded))
        except BaseException:
            self._recorder.close()
            raise

    def _hear(self, recorded: RecordedTopic, raw: bytes) -> None:
        self._heard_ns = max(time.time_ns(), self._heard_ns)  # the wall clock may be set back
        self._recorder.take(Heard(recorded, raw, self._heard_ns))

    def turns(self, stop: StopFlag, executor: Executor) -> Turns:
        """Flush the bag and tell the progress where it is time; others' turns are the work."""
        next_flush, next_word = 0.0, 0.0 if self._progress_period < float("inf") else float("inf")
        while not stop:
            now = time.monotonic()
            if now >= next_flush:
                next_flush = now + _FLUSH_PERIOD
                self._recorder.flush()
            if now >= next_word:
                next_word = now + self._progress_period
                self._progress(self._recorder.last_tick)
            yield UNTIL_A_MESSAGE

    def close(self) -> None:
        """Complete the bag; closing again does nothing."""
        self._recorder.close()

    def conclude(self) -> None:
        """Write the figures.

        Raises:
            RecordingError: something failed, or states are missing.
        """
        self._recorder.conclude(dict.fromkeys(self._recorded, 0))
