"""Reads the serialised messages of a run and measures it."""

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String

from actuated_characters.metrics.run_metrics import Measurement
from actuated_characters.metrics.tick_assembler import TickAssembler
from msgs_config.arrays import FloatArray
from msgs_config.errors import RecordingError
from msgs_config.messages import configuration, topics
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.configuration import RunConfiguration
from msgs_config.messages.joint_state import JointStateDecoder, decode, state_in_layout
from msgs_config.messages.state import StampedReference

CONFIGURATION = topics.CONFIGURATION.of(topics.SIM_NODE).name
REFERENCE = topics.REFERENCE.of(topics.CONTROLLER_NODE).name
COUNTS = {  # what the simulator says of it, and what it is called here
    "rejected": "rejected_commands",
    "duplicate": "duplicate_commands",
    "rejected_pushes": "rejected_pushes",
    "rejected_throws": "rejected_throws",
}
HEARD = frozenset(
    {CONFIGURATION, REFERENCE}
    | {topic.name for topic in (topics.JOINT_STATES, topics.JOINT_TORQUES, topics.DIAGNOSTICS)}
)
"""The topics that are of any use for the figures."""

_MOST_EARLY = 20_000  # messages
_MOST_EARLY_BYTES = 1 << 26  # of them together


class MetricsCollector:
    """Takes messages as they come; has the figures at the end.

    What a topic says can be read only once the simulator's configuration is known, so whatever
    comes before it is kept.
    """

    def __init__(self, simulator: str = topics.SIM_NODE) -> None:
        """`simulator` is the name of its status in the diagnostics."""
        self._simulator = simulator
        self._decoder = JointStateDecoder()
        self._configuration: RunConfiguration | None = None
        self._configuration_text = ""
        self._early: list[tuple[str, bytes, int]] = []
        self._early_bytes = 0
        self._counts: dict[str, int | None] = dict.fromkeys(COUNTS)
        self._first_command_ns: int | None = None
        self._last_state_ns = 0

    @property
    def last_tick(self) -> int:
        """Number of the last tick whose state came; 0 before the first."""
        return 0 if self._configuration is None else self._assembler.last_tick

    @property
    def missing_ticks(self) -> int:
        """Ticks whose state never came, before the last that did."""
        return 0 if self._configuration is None else self._assembler.missing_ticks

    def take(self, topic: str, raw: bytes, published_ns: int) -> None:
        """Take a serialised message that was published at a wall time in ns.

        Raises:
            ActuatedCharactersError: the message is not what its topic should carry.
        """
        if topic == CONFIGURATION:
            self._configure(decode(raw, String).data)
        elif self._configuration is None:
            self._early_bytes += len(raw)
            if len(self._early) == _MOST_EARLY or self._early_bytes > _MOST_EARLY_BYTES:
                raise RecordingError(f"nothing on '{CONFIGURATION}', which says what states mean")
            self._early.append((topic, raw, published_ns))
        elif topic == topics.JOINT_STATES.name:
            self._take_state(self._configuration, raw, published_ns)
        elif topic == REFERENCE:
            self._take_reference(self._configuration, raw)
        elif topic == topics.JOINT_TORQUES.name:
            self._first_command_ns = self._first_command_ns or published_ns
        elif topic == topics.DIAGNOSTICS.name:
            self._take_counts(decode(raw, DiagnosticArray))

    def results(self) -> tuple[dict[str, object], FloatArray]:
        """The figures of the run, and its series: one row a tick, see `metrics.COLUMNS`.

        Raises:
            RecordingError: there was no simulator to listen to.
        """
        if self._configuration is None:
            raise RecordingError("no simulator was heard")
        self._assembler.finish()
        wall_ns = self._last_state_ns - (self._first_command_ns or self._last_state_ns)
        figures = self._measurement.summary(wall_ns / NANOSECONDS_PER_SECOND)
        counts = {COUNTS[name]: count for name, count in self._counts.items()}
        head = {"character": self._configuration.character}
        missing = {"missing_ticks": self.missing_ticks}
        missing |= {"dropped_references": self._assembler.dropped_references}
        return head | figures | counts | missing, self._measurement.series()

    def _configure(self, text: str) -> None:
        if self._configuration is not None:
            if text != self._configuration_text:
                raise RecordingError("another simulator, or the same one restarted, was heard")
            return
        found = configuration.parse(text)
        self._configuration, self._configuration_text = found, text
        self._measurement = Measurement(found)
        self._assembler = TickAssembler(self._measurement, int(found.parameters["rate"]))
        early, self._early = self._early, []
        for message in early:
            self.take(*message)

    def _take_state(self, known: RunConfiguration, raw: bytes, published_ns: int) -> None:
        before = self._assembler.last_tick
        self._assembler.add_state(state_in_layout(known.layout, self._decoder.decode(raw)))
        if self._assembler.last_tick > before:
            self._last_state_ns = published_ns

    def _take_reference(self, known: RunConfiguration, raw: bytes) -> None:
        state = state_in_layout(known.layout, self._decoder.decode(raw))
        self._assembler.add_reference(
            StampedReference(state.stamp_ns, state.position, state.velocity)
        )

    def _is_own(self, session: str) -> bool:
        """Whether a status is of the simulator that is measured, or does not say of which."""
        return self._configuration is None or session in ("", self._configuration.session)

    def _take_counts(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {item.key: item.value for item in status.values}
            if status.name == self._simulator and self._is_own(values.get("session", "")):
                self._counts |= {name: int(values[name]) for name in self._counts if name in values}
