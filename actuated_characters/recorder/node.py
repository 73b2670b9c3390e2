"""`recorder`: writes the messages on the topics into a bag, and measures the run."""

import os
import time
from collections.abc import Callable
from typing import Any

from rclpy.qos import QoSProfile

from actuated_characters.recorder.named_topics import NamedTopics
from actuated_characters.recorder.parameters import RecorderSettings
from actuated_characters.recorder.recorder import Recorder
from actuated_characters.recorder.session_filter import Heard
from actuated_characters.recorder.topic_reader import TopicReader
from actuated_characters.recorder.topics import RecordedTopic, wanted_topics
from msgs_config.bus.dds import DdsNode
from msgs_config.bus.node import StopFlag, declared_settings
from msgs_config.bus.polling import PollingExecutor
from msgs_config.errors import RecordingError
from msgs_config.messages import topics
from msgs_config.messages.topic import LISTENING_DEPTH, Quality

_DRAIN_PERIOD = 0.01  # s between looks at the topics: one waking up for many messages
_LONGEST_END = 20.0  # s for the messages that are on their way at the stop
_AT_ONCE = 1000  # messages of a topic, between flushes and answers to services
_SERVICE_PERIOD = 0.1  # s between turns of the executor, which looks at each of many topics
_FLUSH_PERIOD = 0.5  # s: messages that are older outlive even a kill of the recorder
_SEARCH_PERIOD = 0.2  # s between looks for the publishers of topics that are known by name alone


def _print(line: str) -> None:
    print(line, flush=True)


class RecorderNode(DdsNode):
    """Subscribes to all topics and publishes nothing, so that it never delays the loop."""

    def __init__(self, tell: Callable[[str], object] = _print, **options: Any) -> None:
        """Open the bag and the subscriptions; `options` are rclpy's own of every node.

        `tell` gets the lines about its progress.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or the directory cannot be written to.
        """
        super().__init__(topics.RECORDER_NODE, **options)
        settings = declared_settings(self, RecorderSettings)
        self._tell = tell
        self._progress_period = settings.progress_period
        self._readers: list[TopicReader] = []
        wanted = wanted_topics(self, settings)
        self._named = NamedTopics(self, settings.topics, {each.name for each in wanted})
        self._recorder = Recorder(self, settings)
        for recorded in wanted:
            self._add(recorded, recorded.topic.quality)

    def _add(self, recorded: RecordedTopic, offered: Quality | QoSProfile) -> None:
        """Record a topic from now on, whose publishers offer this."""
        self._recorder.add(recorded, offered)
        self._readers.append(TopicReader(self, recorded))

    def run(self, stop: StopFlag) -> None:
        """Record until `stop`, then take the messages on their way and write the figures.

        Raises:
            RecordingError: ticks were missing, or the bag could not be written.
        """
        executor = PollingExecutor(self, service_period=_SERVICE_PERIOD)
        due = {self._search: 0.0, self._flush: 0.0, self._tell_progress: 0.0}
        try:
            while not stop:
                self._drain()
                executor.serve()
                now = time.monotonic()
                for act, at in due.items():
                    if at <= now:
                        due[act] = now + act()
                time.sleep(_DRAIN_PERIOD)
            self._drain_rest()
        finally:
            executor.close()
            self._recorder.close()
        for name in sorted(self._named.missing):
            self.get_logger().warning(f"'{name}' had no publisher")
        self._recorder.conclude({each.recorded: each.lost_messages for each in self._readers})

    def _drain_rest(self) -> None:
        """Take the messages that were there at the stop, within a reasonable time."""
        deadline = time.monotonic() + _LONGEST_END
        rounds = LISTENING_DEPTH // _AT_ONCE  # more messages cannot have waited
        while more := self._drain(gives_way=False):
            rounds -= 1
            if rounds == 0 or time.monotonic() > deadline:
                break
        if more:
            self.get_logger().warning("messages still came at the end; the last are not recorded")
        if self._recorder.log_time is not None:
            for message in self._recorder.log_time.settle_rest():
                self._recorder.take(message)

    def _search(self) -> float:
        """Record topics whose first publisher has come; returns when to look again, s."""
        for recorded, offered in self._named.find_published():
            try:
                self._add(recorded, offered)
            except RecordingError as error:
                self._recorder.fail(str(error))
        return _SEARCH_PERIOD if self._named.missing else float("inf")

    def _flush(self) -> float:
        if self._recorder.flush() and self._progress_period > 0.0:
            self._tell(f"flushed {self._recorder.last_tick}")
        return _FLUSH_PERIOD

    def _tell_progress(self) -> float:
        if self._progress_period == 0.0:
            return float("inf")
        self._tell(f"tick {self._recorder.last_tick}")
        return self._progress_period

    def _drain(self, *, gives_way: bool = True) -> int:
        """Take some of each topic's messages, all of them if it keeps up, in the order of time.

        While the loop runs the nodes in it go first; at the end the recorder does not give way,
        or a flood from others would hold it up.
        """
        begun = time.monotonic()
        batch = [
            Heard(reader.recorded, raw, published_ns)
            for reader in self._readers
            for published_ns, raw in reader.take(_AT_ONCE)
        ]
        read = len(batch)
        if self._recorder.log_time is None:
            batch.sort(key=lambda message: message.published_ns)
        else:
            batch = self._recorder.log_time.settle(batch, begun, time.monotonic())
        for message in batch:
            if self._recorder.take(message) and gives_way:
                os.sched_yield()
        return read
