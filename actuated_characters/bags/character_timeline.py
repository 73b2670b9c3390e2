"""Collects the messages of a bag on one character, as arrays that grow."""

import json
from array import array
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from actuated_characters.bags.node_parameters import NodeParameters, SimulatorConfigurations
from actuated_characters.bags.plans import PlanArrays, decode_plan
from actuated_characters.bags.rebuilding import Rebuilt
from actuated_characters.bags.world_timeline import Beginnings
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.errors import LayoutError, MessageError, RecordingError
from msgs_config.memory import is_own
from msgs_config.messages import topics
from msgs_config.messages.cdr import decode_string
from msgs_config.messages.clock import TickClock
from msgs_config.messages.configuration import FILES, SINCE
from msgs_config.messages.joint_state import JointStateDecoder, state_in_layout
from msgs_config.messages.keyframe import decode_keyframe
from msgs_config.messages.pins import PinArrays, decode_pins
from msgs_config.messages.session import ANONYMOUS, read_session
from msgs_config.messages.wrenches import WrenchArrays, decode_wrenches
from msgs_config.shared_parameters import RATE

CONFIGURATION = topics.CONFIGURATION.of(topics.SIM_NODE).name
_CONTROLLER = topics.CONFIGURATION.of(topics.CONTROLLER_NODE).name
_MODE = topics.MODE.of(topics.CONTROLLER_NODE).name
_PLAN = topics.PLAN.of(topics.CONTROLLER_NODE).name
_REFERENCE = topics.REFERENCE.of(topics.CONTROLLER_NODE).name
_CONTROLLER_KEYFRAME = topics.CONTROLLER_KEYFRAME.of(topics.CONTROLLER_NODE).name
_UNREADABLE_JSON = (ValueError, KeyError, TypeError, RecursionError)  # raised for foreign JSON
_MOST_EARLY = 50_000  # messages before the configuration, which is latched and comes first
_MOST_NAMED = 3  # gaps that an error names


@dataclass(frozen=True, slots=True)
class CommandArrays:
    """A command as it was sent, in the sender's order, whether the simulator took it or not."""

    names: tuple[str, ...]  # (m,)
    efforts: FloatArray  # (m,) N m or N
    published_ns: int  # wall time


@dataclass(frozen=True)
class ModeChange:
    """The mode of a controller from a state on, and the facts that led to it."""

    stamp_ns: int
    mode: str
    facts: dict[str, Any]


@dataclass
class States:
    """States one after another, their numbers in one row."""

    stamps_ns: "array[int]" = field(default_factory=lambda: array("q"))
    published_ns: "array[int]" = field(default_factory=lambda: array("q"))
    position: "array[float]" = field(default_factory=lambda: array("d"))
    velocity: "array[float]" = field(default_factory=lambda: array("d"))
    effort: "array[float]" = field(default_factory=lambda: array("d"))

    def integers(self, name: str) -> IntArray:
        """Stamps or times of publishing (t,), ns."""
        return np.frombuffer(getattr(self, name), dtype=np.int64)

    def rows(self, name: str, size: int) -> FloatArray:
        """Positions, velocities or efforts (t, size)."""
        return np.frombuffer(getattr(self, name)).reshape(len(self.stamps_ns), size)


class CharacterTimeline:
    """All messages on one character, which is in one namespace.

    The simulator's configuration says what a message means; messages before it are kept until it
    comes. States before the first one of an episode, or of a keyframe, are left out.
    """

    def __init__(self, namespace: str, begins: Beginnings) -> None:
        """`namespace` is without the leading slash; `begins` has the keyframes' stamps so far."""
        self.namespace, self._begins = namespace, begins
        self.keyframes: dict[int, bytes] = {}  # of the controller, serialised, by stamp
        self.has_wall_times = True  # False: times of publishing are simulated log times
        self.simulator = SimulatorConfigurations(namespace)
        self.states, self.references = States(), States()
        self.contacts: dict[int, WrenchArrays] = {}  # by stamp
        self.applied: dict[int, WrenchArrays] = {}  # by stamp, the pushes that acted
        self.pins: dict[int, PinArrays] = {}  # by stamp, those in force
        self.commands: dict[int, list[CommandArrays]] = {}  # by stamp
        self.controller: list[NodeParameters] = []
        self.modes: list[ModeChange] = []
        self.plans: dict[int, PlanArrays] = {}  # by stamp
        self.pushes_sent = self.pins_sent = 0
        # states before the first one of an episode: stamp, message, when it was published
        self._amid: list[tuple[int, bytes, int]] = []
        self.begins_amid = False  # its first state is in the middle of an episode
        self._controller_text = ""
        self._early: list[tuple[str, bytes, int]] = []
        self._early_lost = False
        self.gaps: list[tuple[int, int]] = []  # first and last of ticks whose states are missing
        self.repeated = 0  # states that came again, as in a pause
        self._last_tick = 0
        self._decoder, self._references, self._commands = (JointStateDecoder() for _ in range(3))

    @property
    def skipped_states(self) -> int:
        """How many states came before the first one of an episode."""
        return len(self._amid)

    @property
    def rebuilt(self) -> Rebuilt | None:
        """The simulator's first configuration, and what is built from it; None before it."""
        return self.simulator.rebuilt

    def take(self, name: str, raw: bytes, published_ns: int) -> None:
        """Take a message on one of `TOPICS`.

        Raises:
            ActuatedCharactersError: it is no message of the topic's type and meaning.
        """
        if self.rebuilt is not None or name == CONFIGURATION:
            self._TAKERS[name](self, raw, published_ns)
        elif len(self._early) < _MOST_EARLY:
            self._early.append((name, raw, published_ns))
        else:
            self._early_lost = True

    def finish(self) -> Rebuilt:
        """Check that there are states of each tick; return their character.

        Where no episode begins, nor a keyframe came before its state, they begin with the first one
        of a keyframe that came behind it; else they are those of the middle of an episode, from
        which nothing follows.

        Raises:
            RecordingError: there are none, or not all of them.
        """
        if not self.states.stamps_ns and not self._amid:
            raise RecordingError(f"no states, nothing on '{topics.JOINT_STATES.name}'")
        if not self.states.stamps_ns:
            amid, keyframes = self._amid, self._begins.keyframes
            begins = (row for row, (stamp_ns, *_) in enumerate(amid) if stamp_ns in keyframes)
            first = next(begins, -1)
            self.begins_amid = first < 0
            self._amid = amid[: max(first, 0)]
            for _, raw, published_ns in amid[max(first, 0) :]:
                self._take_state(raw, published_ns)
        if self.gaps:
            ranges = [f"{a} to {b}" if b > a else f"{a}" for a, b in self.gaps[:_MOST_NAMED]]
            more = len(self.gaps) - _MOST_NAMED
            tail = f" and {more} more times" if more > 0 else ""
            raise RecordingError(f"the states of ticks {', '.join(ranges)}{tail} are missing")
        assert self.rebuilt is not None
        self.simulator.check_start(self.states.stamps_ns[0])
        return self.rebuilt

    def _take_configuration(self, raw: bytes, published_ns: int) -> None:
        is_first = self.rebuilt is None
        if is_first and self._early_lost:
            raise RecordingError(f"'{CONFIGURATION}' comes only after {_MOST_EARLY} other messages")
        self.simulator.take(decode_string(raw))
        if not is_first:
            return
        assert self.rebuilt is not None
        known = self.rebuilt.known
        rate = known.parameters.get(RATE.name)
        if not isinstance(rate, int):
            raise RecordingError(f"the simulator's 'rate' is {rate}, not a number")
        self._layout, self._clock = known.layout, TickClock(rate)
        self._no_effort = np.full(self._layout.size, np.nan).tobytes()
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
        tick, states = self._clock.tick(state.stamp_ns), self.states
        if not states.stamps_ns:
            if state.stamp_ns < self._begins.first_ns:
                return
            is_begin = state.effort is None or state.stamp_ns in self._begins.keyframes
            if not is_begin and not self.begins_amid:
                self._amid.append((state.stamp_ns, raw, published_ns))
                return
        elif tick <= self._last_tick:
            self.repeated += 1
            self._check_repeated(tick, state.position.tobytes() + state.velocity.tobytes())
            return
        elif tick > self._last_tick + 1:
            self.gaps.append((self._last_tick + 1, tick - 1))
        self._last_tick = tick
        states.stamps_ns.append(state.stamp_ns)
        states.published_ns.append(published_ns)
        states.position.frombytes(state.position.tobytes())
        states.velocity.frombytes(state.velocity.tobytes())
        states.effort.frombytes(self._no_effort if state.effort is None else state.effort.tobytes())

    def _check_repeated(self, tick: int, content: bytes) -> None:
        """Check that a state that is published again, as in a pause, is the same one."""
        row, size = tick - self._clock.tick(self.states.stamps_ns[0]), self._layout.size
        entries = slice(row * size, (row + 1) * size)
        known = self.states.position[entries].tobytes() + self.states.velocity[entries].tobytes()
        if row >= 0 and not self.gaps and content != known:
            raise RecordingError(f"two states of tick {tick}; was its simulator restarted?")

    def _take_push(self, raw: bytes, published_ns: int) -> None:
        self.pushes_sent += 1

    def _take_pin(self, raw: bytes, published_ns: int) -> None:
        self.pins_sent += 1

    def _take_applied_pins(self, raw: bytes, published_ns: int) -> None:
        pins = decode_pins(raw)
        self.pins[pins.stamp_ns] = pins

    def _take_contacts(self, raw: bytes, published_ns: int) -> None:
        contacts = decode_wrenches(raw)
        self.contacts[contacts.stamp_ns] = contacts

    def _take_applied(self, raw: bytes, published_ns: int) -> None:
        applied = decode_wrenches(raw)
        self.applied[applied.stamp_ns] = applied

    def _take_reference(self, raw: bytes, published_ns: int) -> None:
        state = state_in_layout(self._layout, self._references.decode(raw))
        references = self.references
        references.stamps_ns.append(state.stamp_ns)
        references.position.frombytes(state.position.tobytes())
        references.velocity.frombytes(state.velocity.tobytes())

    def _take_command(self, raw: bytes, published_ns: int) -> None:
        assert self.rebuilt is not None
        with suppress(MessageError):  # the simulator did not take an unreadable command either
            sent = self._commands.decode(raw)
            if read_session(sent.frame_id) in (ANONYMOUS, self.rebuilt.known.session):
                command = CommandArrays(sent.names, sent.effort, published_ns)
                self.commands.setdefault(sent.stamp_ns, []).append(command)

    def _take_controller(self, raw: bytes, published_ns: int) -> None:
        text = decode_string(raw)
        if text == self._controller_text:  # a latched message comes again to each new listener
            return
        self._controller_text = text
        with suppress(*_UNREADABLE_JSON):
            content = json.loads(text)
            parameters = dict(content["parameters"])
            files = dict(content.get(FILES, {}))
            self.controller.append(NodeParameters(parameters, content.get(SINCE), files))

    def _take_keyframe(self, raw: bytes, published_ns: int) -> None:
        if self.states.stamps_ns[1:2]:  # that of the first state is there; no other is needed
            return
        keyframe = decode_keyframe(raw)
        if is_own(keyframe.memory):
            self.keyframes[keyframe.stamp_ns] = raw

    def _take_plan(self, raw: bytes, published_ns: int) -> None:
        with suppress(MessageError):  # raised for a plan of another controller
            plan = decode_plan(raw)
            self.plans[plan.stamp_ns] = plan

    def _take_mode(self, raw: bytes, published_ns: int) -> None:
        with suppress(*_UNREADABLE_JSON):
            facts = dict(json.loads(decode_string(raw)))
            change = ModeChange(int(facts.pop("stamp_ns")), str(facts.pop("mode")), facts)
            if change not in self.modes[-1:]:  # a latched message comes again to each new listener
                self.modes.append(change)

    _TAKERS: ClassVar[dict[str, Callable[["CharacterTimeline", bytes, int], None]]] = {
        CONFIGURATION: _take_configuration,
        topics.JOINT_STATES.name: _take_state,
        topics.JOINT_TORQUES.name: _take_command,
        topics.EXTERNAL_WRENCH.name: _take_push,
        topics.APPLIED_WRENCH.name: _take_applied,
        topics.PIN.name: _take_pin,
        topics.APPLIED_PIN.name: _take_applied_pins,
        topics.CONTACTS.name: _take_contacts,
        _REFERENCE: _take_reference,
        _CONTROLLER: _take_controller,
        _CONTROLLER_KEYFRAME: _take_keyframe,
        _MODE: _take_mode,
        _PLAN: _take_plan,
    }
    TOPICS: ClassVar = tuple(_TAKERS)
