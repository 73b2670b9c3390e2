"""Measures a run from its serialised messages."""

import json
from collections import deque
from contextlib import suppress
from typing import Any

from actuated_characters.bags.rebuilding import rebuild
from actuated_characters.metrics.falls import PostureReader, reader_for
from actuated_characters.metrics.run_metrics import Measurement, Series
from actuated_characters.metrics.tick_assembler import TickAssembler
from msgs_config.errors import ActuatedCharactersError, MessageError, RecordingError
from msgs_config.messages import configuration, topics, typed
from msgs_config.messages.cdr import decode_string
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.configuration import RunConfiguration
from msgs_config.messages.joint_state import JointStateDecoder, state_in_layout
from msgs_config.messages.session import ANONYMOUS
from msgs_config.messages.state import StampedReference

CONFIGURATION = topics.CONFIGURATION.of(topics.SIM_NODE).name
MODE = topics.MODE.of(topics.CONTROLLER_NODE).name
REFERENCE = topics.REFERENCE.of(topics.CONTROLLER_NODE).name
COUNTS = {  # counts in the simulator's diagnostics, and their names as figures
    "rejected": "rejected_commands",
    "duplicate": "duplicate_commands",
    "rejected_pushes": "rejected_pushes",
    "rejected_throws": "rejected_throws",
    "rejected_pins": "rejected_pins",
}
HEARD = frozenset(
    topic.name for each in topics.TABLE if each.is_measured for topic in each.as_others_name_it
)
"""The topics that the figures are measured from."""

_MOST_EARLY = 20_000  # messages before the configuration; of more the oldest go
_MOST_EARLY_BYTES = 1 << 26  # bytes of them


class MetricsCollector:
    """Takes messages as they come; has the figures at the end.

    A message can be read only once the simulator's configuration is known; messages that come
    before it are kept until then, the newest ones, should it take long.
    """

    _measurement: Measurement

    def __init__(self, simulator: str = topics.SIM_NODE) -> None:
        """`simulator` is the name of its status in the diagnostics."""
        self._simulator = simulator
        # a decoder for each: it is fast for messages of one form, and a reference has no efforts
        self._states, self._references = JointStateDecoder(), JointStateDecoder()
        self._configuration: RunConfiguration | None = None
        self._texts: set[str] = set()  # the texts of all configurations so far
        self._early: deque[tuple[str, bytes, int | None]] = deque()
        self._early_bytes = 0
        self._states_too_early = 0  # of which the configuration came too late
        self._counts: dict[str, int | None] = dict.fromkeys(COUNTS.values())
        self._first_command_ns: int | None = None
        self._last_state_ns: int | None = 0

    @property
    def last_tick(self) -> int:
        """Number of the last tick whose state came; 0 before the first."""
        return 0 if self._configuration is None else self._assembler.last_tick

    @property
    def missing_ticks(self) -> int:
        """Number of ticks before the last one whose state never came, or could not be kept."""
        if self._configuration is None:
            return 0
        return self._states_too_early + self._assembler.missing_ticks

    def has_fallen(self) -> bool:
        """Whether the character has fallen so far; False where that is not known."""
        return self._configuration is not None and self._measurement.has_fallen()

    def take(self, topic: str, raw: bytes, published_ns: int | None) -> None:
        """Take a serialised message that was published at a wall time in ns; None if not known.

        Raises:
            ActuatedCharactersError: the message is not what its topic should carry.
        """
        if topic == CONFIGURATION:
            self._configure(decode_string(raw))
        elif self._configuration is None:
            self._keep_early(topic, raw, published_ns)
        elif topic == topics.JOINT_TORQUES.name:
            self._first_command_ns = self._first_command_ns or published_ns
        elif topic == MODE:
            self._take_mode(decode_string(raw))
        elif topic == topics.DIAGNOSTICS.name:
            with suppress(MessageError):  # it may be of any node
                self._take_counts(typed.decode(raw, topics.DIAGNOSTICS.type_name))
        elif topic == REFERENCE:
            state = state_in_layout(self._configuration.layout, self._references.decode(raw))
            desired = StampedReference(state.stamp_ns, state.position, state.velocity)
            self._assembler.add_reference(desired)
        elif topic == topics.JOINT_STATES.name:
            state = state_in_layout(self._configuration.layout, self._states.decode(raw))
            if self._assembler.add_state(state):
                self._last_state_ns = published_ns

    def results(self) -> tuple[dict[str, object], Series]:
        """The figures of the run, and its series: see `Measurement`.

        Raises:
            RecordingError: no simulator's configuration has come.
        """
        if self._configuration is None:
            nothing = f"nothing on '{CONFIGURATION}', which says what states mean"
            raise RecordingError(nothing if self._early else "no simulator was heard")
        self._assembler.finish()
        metrics = self._measurement.summary(self._wall_time())
        losses = {
            "missing_ticks": self.missing_ticks,
            "dropped_references": self._assembler.dropped_references,
        }
        head = {"character": self._configuration.character}
        return head | metrics | self._counts | losses, self._measurement.series()

    def _wall_time(self) -> float | None:
        """From the first command to the last state, s; None if not known."""
        last_ns = self._last_state_ns
        if last_ns is None:
            return None
        return (last_ns - (self._first_command_ns or last_ns)) / NANOSECONDS_PER_SECOND

    def _keep_early(self, topic: str, raw: bytes, published_ns: int | None) -> None:
        self._early.append((topic, raw, published_ns))
        self._early_bytes += len(raw)
        while len(self._early) > _MOST_EARLY or self._early_bytes > _MOST_EARLY_BYTES:
            topic, raw, _ = self._early.popleft()
            self._early_bytes -= len(raw)
            self._states_too_early += topic == topics.JOINT_STATES.name

    def _configure(self, text: str) -> None:
        if text in self._texts:  # a latched configuration may come again
            return
        self._texts.add(text)
        found, known = configuration.parse(text), self._configuration
        if known is not None:
            if found.session == ANONYMOUS or found.session != known.session:
                raise RecordingError("another simulator, or the same one restarted, was heard")
            self._measurement.change(found.parameters)  # a reset has changed the parameters
            return
        self._configuration = found
        self._measurement = Measurement(found, _postures(text))
        self._assembler = TickAssembler(self._measurement, int(found.parameters["rate"]))
        early, self._early = self._early, deque()
        for message in early:
            self.take(*message)

    def _take_mode(self, text: str) -> None:
        """Take the mode of a controller; what another maker's means there says nothing here."""
        with suppress(ValueError, KeyError, TypeError, RecursionError):
            content = json.loads(text)
            self._measurement.add_mode(int(content["stamp_ns"]), str(content["mode"]))

    def _take_counts(self, message: Any) -> None:
        """Take the simulator's counts; a status that names no session may be of any simulator."""
        assert self._configuration is not None
        for status in message.status:
            values = {item.key: item.value for item in status.values}
            own = values.get("session", "") in ("", self._configuration.session)
            if status.name == self._simulator and own:
                known = COUNTS.keys() & values.keys()
                self._counts |= {COUNTS[name]: int(values[name]) for name in known}


def _postures(text: str) -> PostureReader | None:
    """The reader of the postures of a configuration's character, as far as it can be built."""
    try:
        rebuilt = rebuild(text, "")
        return reader_for(rebuilt.character, rebuilt.world.terrain)
    except ActuatedCharactersError:  # another maker's simulator: whether it fell is not known
        return None
