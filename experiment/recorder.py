"""`recorder`: writes what goes over the topics into a bag, and measures it."""

import time
from pathlib import Path

from rclpy.node import Node

from experiment.bags.writer import BagWriter
from experiment.figures import BAG, write_figures
from experiment.listener import RunListener
from msgs_config import topics
from msgs_config.errors import ActuatedCharactersError, RecordingError
from msgs_config.node_parameters import declare, given_parameters
from msgs_config.parameters import Parameter, resolve
from msgs_config.polling import DirectSubscription, Spinner
from msgs_config.process import StopSignal

PARAMETERS = [
    Parameter("directory", "recording", "where bag, summary.json and measurements.csv go"),
    Parameter("write_bag", True, "write the bag; without it the recorder only measures"),
    Parameter("contacts", False, "record what touched what at each tick, and with which wrenches"),
    Parameter(
        "applied_wrench",
        True,
        "record what pushed at each tick, empty or not, which a run with pushes is repeated by",
    ),
    Parameter("progress_period", 0.0, "print the tick this often; 0: never", unit="s"),
]
_DRAIN_PERIOD = 0.004  # s between looks at the topics: one waking up for many messages

# Each has a parameter of its name: the simulator works them out for who listens, at each tick.
_COSTLY = [topics.CONTACTS, topics.APPLIED_WRENCH]

# The streams come last: when a publisher of theirs sees its subscriber, all others are there too.
_TOPICS = [
    topics.CLOCK,
    topics.EPISODE,
    topics.DIAGNOSTICS,
    topics.CONFIGURATION.of(topics.SIM_NODE),
    topics.CONFIGURATION.of(topics.CONTROLLER_NODE),
    topics.EXTERNAL_WRENCH,
    topics.REFERENCE.of(topics.CONTROLLER_NODE),
    topics.JOINT_TORQUES,
    topics.JOINT_STATES,
]


class RecorderNode(Node):
    """Listens to everything and says nothing, so that it is never in the way of the loop."""

    def __init__(self) -> None:
        """Open the bag and the subscriptions.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or the directory cannot be written to.
        """
        super().__init__(topics.RECORDER_NODE)
        values = resolve(PARAMETERS, given_parameters(self))
        declare(self, PARAMETERS, values)
        self._directory = Path(values.text("directory"))
        self._progress_period = values.number("progress_period")
        self._bag = BagWriter(self._directory / BAG) if values.flag("write_bag") else None
        self._listener = RunListener(self.resolve_topic_name(topics.SIM_NODE).lstrip("/"))
        self._failure: str | None = None
        self._recorded_names: dict[str, str] = {}
        self._published: dict[str, int] = {}  # ns of wall time, of each topic's last message
        self._inboxes: list[tuple[str, DirectSubscription]] = []
        wanted = [topic for topic in _COSTLY if values.flag(topic.name)]
        for topic in wanted + _TOPICS:
            resolved = self._recorded_names[topic.name] = self.resolve_topic_name(topic.name)
            if self._bag is not None:
                self._bag.add_topic(resolved, topic.message_type, topic.qos)
            self._inboxes.append((topic.name, DirectSubscription(self, topic)))

        self.get_logger().info(f"recording to {self._directory}")

    def run(self, stop: StopSignal) -> None:
        """Record until `stop`, then take what is still on its way and write the figures.

        Raises:
            RecordingError: ticks were missing, or the bag could not be written.
        """
        spinner = Spinner(self)
        next_progress = 0.0
        try:
            while not stop:
                self._drain()
                spinner.serve()
                if self._progress_period > 0.0 and next_progress <= time.monotonic():
                    next_progress = time.monotonic() + self._progress_period
                    print(f"tick {self._listener.last_tick}", flush=True)
                time.sleep(_DRAIN_PERIOD)
            while self._drain():
                pass
        finally:
            spinner.close()
            self._close_bag()
        write_figures(self._directory, *self._listener.results())
        if self._listener.missing_ticks:
            raise RecordingError(f"{self._listener.missing_ticks} ticks were missed")
        if self._failure is not None:
            raise RecordingError(self._failure)

    def _drain(self) -> int:
        """Take all messages that are there, in the order in which they were published."""
        batch = []
        for name, inbox in self._inboxes:
            while (received := inbox.take_stamped()) is not None:
                # the wall clock may be set back; a topic's own order stays
                self._published[name] = max(received[1], self._published.get(name, 0))
                batch.append((self._published[name], name, received[0]))
        batch.sort(key=lambda message: message[0])
        for published_ns, name, raw in batch:
            self._keep(name, raw, published_ns)
        return len(batch)

    def _keep(self, name: str, raw: bytes, published_ns: int) -> None:
        try:
            if self._bag is not None:
                self._bag.write(self._recorded_names[name], raw, published_ns)
        except RecordingError as error:  # the run goes on, and is measured, without its bag
            self._fail(str(error))
            self._bag = None
        try:
            self._listener.take(name, raw, published_ns)
        except ActuatedCharactersError as error:
            self._fail(f"cannot measure '{name}': {error}")

    def _close_bag(self) -> None:
        try:
            if self._bag is not None:
                self._bag.close()
        except RecordingError as error:
            self._fail(str(error))

    def _fail(self, sentence: str) -> None:
        if self._failure is None:
            self._failure = sentence
            self.get_logger().error(sentence)
