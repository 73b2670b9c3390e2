"""`recorder`: writes the messages on the topics into a bag, and measures the run."""

import os
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile

from actuated_characters.bags.format.metadata import BAG
from actuated_characters.bags.format.storage import LOG_TIME, SIMULATED
from actuated_characters.bags.last_parts import LastPartsWriter
from actuated_characters.bags.writer import BagWriter
from actuated_characters.metrics.collector import HEARD, MetricsCollector
from actuated_characters.recorder.log_time import SimulatedLogTime
from actuated_characters.recorder.parameters import PARAMETERS
from actuated_characters.recorder.session_filter import Heard, SessionFilter, find_session
from actuated_characters.recorder.topic_reader import TopicReader
from actuated_characters.recorder.topics import (
    NamedTopics,
    RecordedTopic,
    contract_topics,
    sensor_topics,
    simulator_name,
)
from actuated_characters.runs.forked_from import given_origin
from actuated_characters.runs.run_directory import metrics_directory, write_metrics
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.bus.polling import PollingExecutor
from msgs_config.bus.ros_parameters import declare, given_parameters
from msgs_config.errors import ActuatedCharactersError, RecordingError
from msgs_config.messages import topics
from msgs_config.messages.clock import FIRST_TICK
from msgs_config.messages.session import REMEDY, SESSION, given_session, named
from msgs_config.messages.topic import LISTENING_DEPTH
from msgs_config.parameters import Values, resolve
from msgs_config.runtime.process import StopSignal

_DRAIN_PERIOD = 0.01  # s between looks at the topics: one waking up for many messages
_LONGEST_END = 20.0  # s for the messages that are on their way at the stop
_AT_ONCE = 1000  # messages of a topic, between flushes and answers to services
_SERVICE_PERIOD = 0.1  # s between turns of the executor, which looks at each of many topics
_FLUSH_PERIOD = 0.5  # s: messages that are older outlive even a kill of the recorder
_BYTES_PER_MB = 10**6
_SEARCH_PERIOD = 0.2  # s between looks for the publishers of topics that are known by name alone


class RecorderNode(Node):
    """Subscribes to all topics and publishes nothing, so that it never delays the loop."""

    def __init__(self, **options: Any) -> None:
        """Open the bag and the subscriptions; `options` are rclpy's own of every node.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or the directory cannot be written to.
        """
        super().__init__(topics.RECORDER_NODE, **options)
        values = resolve(PARAMETERS, given_parameters(self))
        declare(self, PARAMETERS, values)
        self._directory = Path(values.text("directory"))
        self._progress_period = values.number("progress_period")
        self._failure: str | None = None
        self._once_logger = OnceLogger(self.get_logger())
        self._filter = SessionFilter(given_session(values), self._once_logger.log_once)
        self._readers: list[TopicReader] = []
        characters = values.texts("characters") or ("",)
        wanted = contract_topics(
            self, characters, values.texts("exclude"), measured_only=not values.flag("write_bag")
        )
        if values.flag("write_bag"):
            # first: the simulator begins when its states have all their subscribers
            wanted = sensor_topics(self, values.texts("sensors")) + wanted
        names = values.texts("topics")
        self._named = NamedTopics(self, names, {recorded.name for recorded in wanted})
        self._collectors = {
            name: MetricsCollector(simulator_name(self, name)) for name in characters
        }
        self._origin = given_origin(values)
        self._bag = self._open_bag(values)
        is_simulated = values.text(LOG_TIME) == SIMULATED
        self._log_time = SimulatedLogTime() if is_simulated else None
        for recorded in wanted:
            self._add(recorded, recorded.topic.qos)
        self.get_logger().info(f"recording to {self._directory}")

    def _open_bag(self, values: Values) -> BagWriter | LastPartsWriter | None:
        if not values.flag("write_bag"):
            return None
        path = self._directory / BAG
        options = {"compression": values.text("compression"), "log_time": values.text(LOG_TIME)}
        least = round(values.number("last_megabytes") * _BYTES_PER_MB)
        bag = LastPartsWriter(path, least, **options) if least else BagWriter(path, **options)
        for name, origin in self._origin.items():
            bag.set_custom_data(name, origin.to_json())
        return bag

    def _add(self, recorded: RecordedTopic, offered: QoSProfile) -> None:
        """Record a topic from now on, whose publishers offer this."""
        if self._bag is not None:
            self._bag.add_topic(recorded.name, recorded.topic.message_type, offered)
        self._readers.append(TopicReader(self, recorded))

    def run(self, stop: StopSignal) -> None:
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
            for message in self._filter.finish():
                self._keep(message)
            if self._log_time is not None:
                for message, log_time_ns in self._log_time.finish():
                    self._write(message, log_time_ns)
            self._to_bag(lambda bag: bag.close())
        self._conclude()

    def _drain_rest(self) -> None:
        """Take the messages that were there at the stop, within a reasonable time."""
        deadline = time.monotonic() + _LONGEST_END
        for _ in range(LISTENING_DEPTH // _AT_ONCE):  # no more was there
            if not self._drain(gives_way=False):
                return
            if time.monotonic() > deadline:
                break
        self.get_logger().warning("messages still came at the end; the last ones are not recorded")

    def _search(self) -> float:
        """Record topics whose first publisher has come; returns when to look again, s."""
        for recorded, offered in self._named.look():
            try:
                self._add(recorded, offered)
            except RecordingError as error:
                self._fail(str(error))
        return _SEARCH_PERIOD if self._named.missing else float("inf")

    def _flush(self) -> float:
        if self._to_bag(lambda bag: bag.flush()) and self._progress_period > 0.0:
            print(f"flushed {self._last_tick}", flush=True)
        return _FLUSH_PERIOD

    def _to_bag(self, act: Callable[[BagWriter | LastPartsWriter], None]) -> bool:
        """Do something with the bag; where it fails the run goes on, and is measured, without."""
        if self._bag is not None:
            try:
                act(self._bag)
            except RecordingError as error:
                self._fail(str(error))
                self._bag = None
        return self._bag is not None

    def _tell_progress(self) -> float:
        if self._progress_period == 0.0:
            return float("inf")
        print(f"tick {self._last_tick}", flush=True)
        return self._progress_period

    @property
    def _last_tick(self) -> int:
        """The last tick of which every character's state has come."""
        return min(collector.last_tick for collector in self._collectors.values())

    def _drain(self, *, gives_way: bool = True) -> int:
        """Take some of each topic's messages, all of them if it keeps up, in the order of time.

        While the loop runs the nodes in it go first; at the end the recorder does not give way,
        or a flood from others would hold it up.
        """
        begun_ns = time.time_ns()
        batch = [
            Heard(reader.recorded, raw, published_ns)
            for reader in self._readers
            for published_ns, raw in reader.take(_AT_ONCE)
        ]
        if self._log_time is None:
            batch.sort(key=lambda message: message.published_ns)
        else:
            batch = self._log_time.settle(batch, begun_ns if gives_way else None)
        for message in batch:
            if passed := self._filter.take(message):
                for each in passed:
                    self._keep(each)
                if gives_way:
                    os.sched_yield()
        return len(batch)

    def _write(self, message: Heard, log_time_ns: int) -> None:
        recorded, raw, published_ns = message
        self._to_bag(lambda bag: bag.write(recorded.name, raw, log_time_ns, published_ns))

    def _keep(self, message: Heard) -> None:
        recorded, raw, published_ns = message
        if self._log_time is None:
            self._to_bag(lambda bag: bag.write(recorded.name, raw, published_ns))
        else:
            for each, log_time_ns in self._log_time.take(message):
                self._write(each, log_time_ns)
        if recorded.own_name not in HEARD:
            return
        for name, collector in self._collectors.items():
            if recorded.character not in (None, name):
                continue
            try:
                collector.take(recorded.own_name, raw, published_ns)
            except ActuatedCharactersError as error:
                sentence = f"cannot measure '{recorded.name}': {error}"
                if self._filter.bound and find_session(message) is None:  # it may be from any node
                    self._once_logger.log_once(sentence)
                else:
                    self._fail(sentence)

    def _conclude(self) -> None:
        """Write the figures, and log which messages were lost.

        Raises:
            RecordingError: something failed, or states are missing.
        """
        for reader in self._readers:
            if count := reader.lost_messages:
                self.get_logger().warning(f"'{reader.recorded.name}': {count} messages lost")
        for name in sorted(self._named.missing):
            self.get_logger().warning(f"'{name}' had no publisher")
        for name, collector in self._collectors.items():
            self._conclude_character(name, collector)
        if self._failure is not None:
            raise RecordingError(self._failure)

    def _conclude_character(self, name: str, collector: MetricsCollector) -> None:
        of_it = f" of '{name}'" if name else ""
        try:
            metrics, series = collector.results()
            if dropped := metrics["dropped_references"]:
                self.get_logger().warning(f"{dropped} references{of_it} belong to no state")
            own = [each for each in self._readers if each.recorded.character in (None, name)]
            foreign = {each.recorded.name: self._filter.dropped(each.recorded.name) for each in own}
            lost_messages = {each.recorded.name: each.lost_messages for each in own}
            metrics |= {name: asdict(origin) for name, origin in self._origin.items()} | {
                "lost_messages": {topic: count for topic, count in lost_messages.items() if count},
                "foreign_messages": {topic: count for topic, count in foreign.items() if count},
            }
            directory = metrics_directory(self._directory, name, is_alone=not name)
            write_metrics(directory, metrics, series)
        except RecordingError as error:
            self._fail(f"{error}{of_it}")
        states = self.resolve_topic_name(topics.JOINT_STATES.under(name).name)
        if collector.last_tick <= FIRST_TICK and self._filter.dropped(states):
            self._fail(
                f"session {named(self._filter.bound)}{of_it} was recorded and never answered, "
                f"while others published states, too; {REMEDY}, or set '{SESSION.name}'"
            )
        elif collector.last_tick <= FIRST_TICK:
            self._fail(f"no tick{of_it} was recorded: the simulator's first state had no answer")
        if collector.missing_ticks:
            self._fail(f"{collector.missing_ticks} ticks{of_it} were missed")

    def _fail(self, sentence: str) -> None:
        if self._failure is None:
            self._failure = sentence
            self.get_logger().error(sentence)
