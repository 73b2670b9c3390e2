"""Collects what a bag says of one character, message by message, as arrays that grow."""

import json
from array import array
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from std_msgs.msg import String

from actuated_characters.bags.plans import PlanArrays, decode_plan
from actuated_characters.bags.rebuilding import Rebuilt, rebuild
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.errors import LayoutError, MessageError, RecordingError
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.joint_state import JointStateDecoder, decode, state_in_layout
from msgs_config.messages.session import ANONYMOUS, read_session
from msgs_config.messages.wrenches import WrenchArrays, decode_wrenches
from msgs_config.parameters import with_present_names
from msgs_config.shared_parameters import RATE

CONFIGURATION = topics.CONFIGURATION.of(topics.SIM_NODE).name
_CONTROLLER = topics.CONFIGURATION.of(topics.CONTROLLER_NODE).name
MODE = topics.MODE.of(topics.CONTROLLER_NODE).name
PLAN = topics.PLAN.of(topics.CONTROLLER_NODE).name
_REFERENCE = topics.REFERENCE.of(topics.CONTROLLER_NODE).name
_MOST_EARLY = 50_000  # messages before the configuration, which is latched and comes first
_MOST_NAMED = 3  # gaps


@dataclass(frozen=True, slots=True)
class CommandArrays:
    """A command as it was sent, in the sender's order; what was made of it is another matter."""

    names: tuple[str, ...]  # (m,)
    efforts: FloatArray  # (m,) N m or N
    published_ns: int  # wall time


@dataclass(frozen=True)
class ControllerSettings:
    """A controller's parameters, and since when they are in force."""

    parameters: dict[str, Any]
    after_stamp_ns: int | None  # in force for states after that stamp; None: from the start


@dataclass(frozen=True)
class ModeChange:
    """What a controller does from a state on, and what led to it."""

    stamp_ns: int
    mode: str
    facts: dict[str, Any]


@dataclass
class States:
    """States of consecutive ticks, as they come."""

    stamps_ns: "array[int]" = field(default_factory=lambda: array("q"))
    published_ns: "array[int]" = field(default_factory=lambda: array("q"))
    position: "array[float]" = field(default_factory=lambda: array("d"))
    velocity: "array[float]" = field(default_factory=lambda: array("d"))
    effort: "array[float]" = field(default_factory=lambda: array("d"))


def matrix(numbers: "array[float]", columns: int, rows: int) -> FloatArray:
    """Rows of numbers that came one after another, (rows, columns)."""
    return np.frombuffer(numbers, dtype=float).reshape(rows, columns)


def integers(numbers: "array[int]") -> IntArray:
    """Whole numbers that came one after another."""
    return np.frombuffer(numbers, dtype=np.int64)


class CharacterTimeline:
    """All that is said in one namespace.

    What a message means is known with the simulator's configuration; what comes before it is kept.
    States before the first one of an episode are left out.
    """

    def __init__(self, namespace: str) -> None:
        """`namespace` is without the leading slash."""
        self.namespace = namespace
        self.rebuilt: Rebuilt | None = None
        self.states = States()
        self.references = States()
        self.contacts: dict[int, WrenchArrays] = {}  # by stamp, as all that follows
        self.applied_wrench: dict[int, WrenchArrays] = {}
        self.commands: dict[int, list[CommandArrays]] = {}
        self.controller: list[ControllerSettings] = []
        self.modes: list[ModeChange] = []
        self.plans: dict[int, PlanArrays] = {}
        self.pushes_sent = 0
        self._controller_text = self._configuration_text = ""
        self._early: list[tuple[str, bytes, int]] = []
        self._early_lost = False
        self._gaps: list[tuple[int, int]] = []
        self._last_tick = 0
        self.skipped_states = 0  # before the first one of an episode
        self._decoder, self._references, self._commands = (JointStateDecoder() for _ in range(3))
        self._take: dict[str, Callable[[bytes, int], None]] = {
            topics.JOINT_STATES.name: self._take_state,
            topics.JOINT_TORQUES.name: self._take_command,
            topics.CONTACTS.name: self._take_contacts,
            topics.APPLIED_WRENCH.name: self._take_applied,
            topics.EXTERNAL_WRENCH.name: self._take_push,
            _REFERENCE: self._take_reference,
            _CONTROLLER: self._take_controller,
            MODE: self._take_mode,
            PLAN: self._take_plan,
        }

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self._layout.size

    def take(self, name: str, raw: bytes, published_ns: int) -> None:
        """Take a message on the topic of that name, relative to the namespace.

        Raises:
            ActuatedCharactersError: it is not what the topic should carry.
        """
        if name == CONFIGURATION:
            self._configure(raw)
        elif self.rebuilt is not None:
            self._take[name](raw, published_ns)
        elif len(self._early) < _MOST_EARLY:
            self._early.append((name, raw, published_ns))
        else:
            self._early_lost = True

    def finish(self) -> None:
        """Check that there are states of each tick.

        Raises:
            RecordingError: there are none, or not all of them, or no first one of an episode.
        """
        if not self.states.stamps_ns and not self.skipped_states:
            raise RecordingError(f"no states, nothing on '{topics.JOINT_STATES.name}'")
        if not self.states.stamps_ns:
            raise RecordingError(
                "it begins in the middle of an episode, and no other begins in it: there is no "
                "state from which the rest follows"
            )
        if self._gaps:
            ranges = [f"{a} to {b}" if b > a else f"{a}" for a, b in self._gaps[:_MOST_NAMED]]
            more = f" and {len(self._gaps) - _MOST_NAMED} more times"
            tail = more if len(self._gaps) > _MOST_NAMED else ""
            raise RecordingError(f"the states of ticks {', '.join(ranges)}{tail} are missing")

    def _configure(self, raw: bytes) -> None:
        text = decode(raw, String).data
        if self.rebuilt is not None:
            if text != self._configuration_text:
                raise RecordingError("several simulators, or one restarted")
            return
        if self._early_lost:
            raise RecordingError(f"'{CONFIGURATION}' comes only after {_MOST_EARLY} other messages")
        self.rebuilt, self._configuration_text = rebuild(text, self.namespace), text
        rate = self.rebuilt.known.parameters.get(RATE.name)
        if not isinstance(rate, int):
            raise RecordingError(f"the simulator's 'rate' is {rate}, not a number")
        self._session = self.rebuilt.known.session
        self._layout, self._clock = self.rebuilt.known.layout, TickClock(rate)
        self._nothing = np.full(self._layout.size, np.nan).tobytes()
        early, self._early = self._early, []
        for message in early:
            self.take(*message)

    def _take_state(self, raw: bytes, published_ns: int) -> None:
        try:
            state = state_in_layout(self._layout, self._decoder.decode(raw))
        except LayoutError as error:
            assert self.rebuilt is not None
            name = self.rebuilt.known.character
            raise RecordingError(f"the states are not those of {name}: {error}") from error
        tick, kept = self._clock.tick(state.stamp_ns), self.states
        if not kept.stamps_ns:
            if state.effort is not None:
                self.skipped_states += 1
                return
        elif tick <= self._last_tick:
            self._check_repeated(tick, state.position.tobytes() + state.velocity.tobytes())
            return
        elif tick > self._last_tick + 1:
            self._gaps.append((self._last_tick + 1, tick - 1))
        self._last_tick = tick
        kept.stamps_ns.append(state.stamp_ns)
        kept.published_ns.append(published_ns)
        kept.position.frombytes(state.position.tobytes())
        kept.velocity.frombytes(state.velocity.tobytes())
        kept.effort.frombytes(self._nothing if state.effort is None else state.effort.tobytes())

    def _check_repeated(self, tick: int, content: bytes) -> None:
        """A state that is published again, as in a pause, is the same one."""
        row, size = tick - self._clock.tick(self.states.stamps_ns[0]), self._layout.size
        if row < 0 or self._gaps:
            return
        entries = slice(row * size, (row + 1) * size)
        known = self.states.position[entries].tobytes() + self.states.velocity[entries].tobytes()
        if content != known:
            raise RecordingError(f"two states of tick {tick}; was its simulator restarted?")

    def _take_reference(self, raw: bytes, published_ns: int) -> None:
        state, kept = state_in_layout(self._layout, self._references.decode(raw)), self.references
        kept.stamps_ns.append(state.stamp_ns)
        kept.position.frombytes(state.position.tobytes())
        kept.velocity.frombytes(state.velocity.tobytes())

    def _take_command(self, raw: bytes, published_ns: int) -> None:
        with suppress(MessageError):  # nor did the simulator take it
            sent = self._commands.decode(raw)
            if read_session(sent.frame_id) not in (ANONYMOUS, self._session):
                return
            command = CommandArrays(sent.names, sent.effort, published_ns)
            self.commands.setdefault(sent.stamp_ns, []).append(command)

    def _take_contacts(self, raw: bytes, published_ns: int) -> None:
        wrenches = decode_wrenches(raw)
        self.contacts[wrenches.stamp_ns] = wrenches

    def _take_applied(self, raw: bytes, published_ns: int) -> None:
        wrenches = decode_wrenches(raw)
        self.applied_wrench[wrenches.stamp_ns] = wrenches

    def _take_push(self, raw: bytes, published_ns: int) -> None:
        self.pushes_sent += 1

    def _take_controller(self, raw: bytes, published_ns: int) -> None:
        text = decode(raw, String).data
        if text == self._controller_text:  # latched, it comes to each new listener
            return
        self._controller_text = text
        with suppress(ValueError, KeyError, TypeError, RecursionError):  # of another controller
            content = json.loads(text)
            settings = ControllerSettings(
                with_present_names(dict(content["parameters"])),
                content.get("parameters_after_stamp_ns"),
            )
            self.controller.append(settings)

    def _take_plan(self, raw: bytes, published_ns: int) -> None:
        with suppress(MessageError):  # of another controller
            plan = decode_plan(raw)
            self.plans[plan.stamp_ns] = plan

    def _take_mode(self, raw: bytes, published_ns: int) -> None:
        with suppress(ValueError, KeyError, TypeError, RecursionError):  # of another controller
            facts = dict(json.loads(decode(raw, String).data))
            change = ModeChange(int(facts.pop("stamp_ns")), str(facts.pop("mode")), facts)
            if change not in self.modes[-1:]:  # latched, it comes to each new listener
                self.modes.append(change)
