"""Writes what was heard of a run into a bag, and measures the run; however it was heard."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from actuated_characters.bags.forked_from import given_origin
from actuated_characters.bags.format.metadata import BAG
from actuated_characters.bags.format.storage import SIMULATED
from actuated_characters.bags.last_parts import LastPartsWriter
from actuated_characters.bags.writer import BagWriter
from actuated_characters.metrics.collector import HEARD, MetricsCollector
from actuated_characters.recorder.log_time import SimulatedLogTime
from actuated_characters.recorder.parameters import RecorderSettings
from actuated_characters.recorder.run_directory import metrics_directory, write_metrics
from actuated_characters.recorder.session_filter import Heard, SessionFilter, find_session
from actuated_characters.recorder.topics import RecordedTopic, simulator_name
from msgs_config.bus.node import BusNode
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.errors import ActuatedCharactersError, RecordingError
from msgs_config.messages import topics
from msgs_config.messages.clock import FIRST_TICK
from msgs_config.messages.session import REMEDY, SESSION, named
from msgs_config.messages.topic import Quality

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

_BYTES_PER_MB = 10**6


class Recorder:
    """The bag, the figures, and the session that both are of."""

    def __init__(self, node: BusNode, settings: RecorderSettings) -> None:
        """Open the bag, in a directory below which the figures go as well.

        `node` names the topics, and has the log.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or the directory cannot be written to.
        """
        self._node, self._log = node, node.get_logger()
        self._directory = Path(settings.directory)
        self._once_logger = OnceLogger(self._log)
        self._failure: str | None = None
        self._filter = SessionFilter(settings.session.id, self._once_logger.log_once)
        self._collectors = {
            name: MetricsCollector(simulator_name(node, name)) for name in settings.names
        }
        self._origin = given_origin(settings.forked_from)
        self._bag = self._open_bag(settings)
        is_simulated = settings.log_time == SIMULATED
        self.log_time = SimulatedLogTime() if is_simulated else None
        self._log.info(f"recording to {self._directory}")

    def _open_bag(self, settings: RecorderSettings) -> BagWriter | LastPartsWriter | None:
        if not settings.write_bag:
            return None
        path = self._directory / BAG
        options = {"compression": settings.compression, "log_time": settings.log_time}
        least = round(settings.last_megabytes * _BYTES_PER_MB)
        bag = LastPartsWriter(path, least, **options) if least else BagWriter(path, **options)
        for name, origin in self._origin.items():
            bag.set_custom_data(name, origin.to_json())
        return bag

    def add(self, recorded: RecordedTopic, offered: "Quality | QoSProfile") -> None:
        """Record a topic from now on, whose publishers offer this.

        Raises:
            RecordingError: the bag does not take it.
        """
        if self._bag is not None:
            self._bag.add_topic(recorded.name, recorded.topic.type_name, offered)

    @property
    def last_tick(self) -> int:
        """The last tick of which every character's state has come."""
        return min(collector.last_tick for collector in self._collectors.values())

    def take(self, message: Heard) -> bool:
        """Take the next message; whether it, or some that waited for it, are kept."""
        passed = self._filter.take(message)
        for each in passed:
            self._keep(each)
        return bool(passed)

    def flush(self) -> bool:
        """Hand what was written to the operating system; whether there is a bag."""
        return self._to_bag(lambda bag: bag.flush())

    def close(self) -> None:
        """Keep what still waited, and complete the bag."""
        for message in self._filter.finish():
            self._keep(message)
        if self.log_time is not None:
            for message, log_time_ns in self.log_time.finish():
                self._write(message, log_time_ns)
        self._to_bag(lambda bag: bag.close())

    def conclude(self, lost: Mapping[RecordedTopic, int]) -> None:
        """Write the figures, and log which messages were lost, by the topics that were recorded.

        Raises:
            RecordingError: something failed, or states are missing.
        """
        for recorded, count in lost.items():
            if count:
                self._log.warning(f"'{recorded.name}': {count} messages lost")
        for name, collector in self._collectors.items():
            self._conclude_character(name, collector, lost)
        if self._failure is not None:
            raise RecordingError(self._failure)

    def fail(self, sentence: str) -> None:
        """Note that something failed: the rest is recorded, and `conclude` says the first."""
        if self._failure is None:
            self._failure = sentence
            self._log.error(sentence)

    def _to_bag(self, act: Callable[[BagWriter | LastPartsWriter], None]) -> bool:
        """Do something with the bag; where it fails the run goes on, and is measured, without."""
        if self._bag is not None:
            try:
                act(self._bag)
            except RecordingError as error:
                self.fail(str(error))
                self._bag = None
        return self._bag is not None

    def _write(self, message: Heard, log_time_ns: int) -> None:
        recorded, raw, published_ns = message
        self._to_bag(lambda bag: bag.write(recorded.name, raw, log_time_ns, published_ns))

    def _keep(self, message: Heard) -> None:
        recorded, raw, published_ns = message
        if self.log_time is None:
            self._to_bag(lambda bag: bag.write(recorded.name, raw, published_ns))
        else:
            for each, log_time_ns in self.log_time.take(message):
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
                    self.fail(sentence)

    def _conclude_character(
        self, name: str, collector: MetricsCollector, lost: Mapping[RecordedTopic, int]
    ) -> None:
        of_it = f" of '{name}'" if name else ""
        try:
            metrics, series = collector.results()
            if dropped := metrics["dropped_references"]:
                self._log.warning(f"{dropped} references{of_it} belong to no state")
            own = [each for each in lost if each.character in (None, name)]
            foreign = {each.name: self._filter.dropped(each.name) for each in own}
            metrics |= {name: asdict(origin) for name, origin in self._origin.items()} | {
                "lost_messages": {each.name: lost[each] for each in own if lost[each]},
                "foreign_messages": {topic: count for topic, count in foreign.items() if count},
            }
            directory = metrics_directory(self._directory, name, is_alone=not name)
            write_metrics(directory, metrics, series)
        except RecordingError as error:
            self.fail(f"{error}{of_it}")
        states = self._node.resolve_topic_name(topics.JOINT_STATES.under(name).name)
        if collector.last_tick <= FIRST_TICK and self._filter.dropped(states):
            self.fail(
                f"session {named(self._filter.bound)}{of_it} was recorded and never answered, "
                f"while others published states, too; {REMEDY}, or set '{SESSION.name}'"
            )
        elif collector.last_tick <= FIRST_TICK:
            self.fail(f"no tick{of_it} was recorded: the simulator's first state had no answer")
        if collector.missing_ticks:
            self.fail(f"{collector.missing_ticks} ticks{of_it} were missed")
