"""The node `player` in the controller's place: it sends the commands that a bag has."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.replay.comparison import (
    EFFORT,
    POSITION,
    VELOCITY,
    clock_of,
    first_tick_of,
)
from actuated_characters.replay.players.controller_parameters import reset_changes
from actuated_characters.replay.players.player import Player
from actuated_characters.replay.players.simulator_inputs import SimulatorInputs, make_inputs
from actuated_characters.replay.world import read_world
from msgs_config.arrays import FloatArray
from msgs_config.bus.composition import Turns, ros_node
from msgs_config.bus.node import BusNode, declared_settings
from msgs_config.errors import RunError
from msgs_config.messages import topics
from msgs_config.messages.clock import FIRST_TICK
from msgs_config.messages.joint_state import JointStateDecoder, JointStateEncoder, state_in_layout
from msgs_config.messages.pins import encode_pins
from msgs_config.messages.projectiles import ThrowCodec
from msgs_config.messages.session import GivenSession, read_session
from msgs_config.messages.state import StampedState
from msgs_config.messages.wrenches import encode_wrenches
from msgs_config.settings import Settings, parameter


class RecordedControllerSettings(Settings):
    """Which recording is played, and where what comes back goes."""

    recording: str = parameter("", "the bag, or the directory of its run")
    world: int = parameter(0, "which of the bag's worlds to play, counted from 0")
    states: str = parameter("states.npz", "where the states go that come back")
    session: GivenSession = GivenSession()


class RecordedController(Player):
    """Answers each state as it was answered then: torques, what came before them, or a reset."""

    def __init__(self, node: BusNode | None = None) -> None:
        """Read the recording, and offer the topics of each of its characters.

        Without a place on a bus it is a node of ROS.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or the recording cannot be played.
        """
        super().__init__(node or ros_node("player"))
        settings = declared_settings(self.node, RecordedControllerSettings)
        self._file = Path(settings.states)
        world, _ = read_world(Path(settings.recording), settings.world)
        self._tick_clock, self._throws = clock_of(world[0]), world[0].throws
        self._first_tick = _first_tick(world[0])
        self._simulator = self.node.client(topics.SIM_NODE, {"reset": False})
        self._changes = reset_changes(world)
        session = settings.session.id
        self._throw_codec = ThrowCodec(session)
        self._throw_topic = self.node.publisher(topics.THROW)
        inputs = make_inputs(world)
        self._characters = [
            _CharacterTopics(self.node, *each, session) for each in zip(world, inputs, strict=True)
        ]
        self._ticks, self._resets = len(inputs[0].commands), inputs[0].resets

    def play(self) -> Turns:
        """Play until the last state has come back, or until `stop`; then write the states.

        Raises:
            RunError: the simulator does not answer, or it leaves out a state.
        """
        self._played = 0  # states that all characters have
        try:
            yield from self.wait(
                self._is_subscribed,
                lambda: "sim_node to listen to torques, pushes, pins, throws and resets",
            )
            while not self.stop and self._played <= self._ticks:
                yield from self.wait(
                    self._has_states, lambda: f"the state of tick {self._first_tick + self._played}"
                )
                if self._played < self._ticks and not self.stop:
                    yield from self._replay_tick(self._played)
                self._played += 1
                self.tell_state(self._played)
        finally:
            np.savez(self._file, **self._arrays())  # type: ignore[arg-type]  # no flag is among them

    def _is_subscribed(self) -> bool:
        """Whether the simulator receives all that it will be sent."""
        publishers = [self._throw_topic, *(p for each in self._characters for p in each.publishers)]
        return self._simulator.is_ready and all(p.get_subscription_count() for p in publishers)

    def _has_states(self) -> bool:
        """Take what has come; whether every character has one more state."""
        for each in self._characters:
            while each.receive():
                self.executor.received()
        return min(len(each.states) for each in self._characters) > self._played

    def _replay_tick(self, tick: int) -> Turns:
        """Let the simulator do what it did in a tick, counted from 0."""
        if tick in self._resets:
            if change := self._changes.get(tick + 1):
                yield from self.set_parameters(self._simulator, topics.SIM_NODE, change)
            self._simulator.call("reset")  # the next state is its answer
            for each in self._characters:
                each.last_sent = []  # that answers a state before the reset
            return
        # all of it is there before the last command lets the simulator go on
        self._throw(tick)
        for each in self._characters:
            each.push(tick)
            each.pin(tick)
        for each in self._characters:
            each.command(tick)

    def _throw(self, tick: int) -> None:
        """Send what was thrown as a tick began; returns when the simulator has it."""
        throws = self._throws[tick] if self._throws else ()
        for throw in throws:
            stamp_ns = self._tick_clock.stamp_ns(self._first_tick + tick)
            self._throw_topic.publish(self._throw_codec.encode(stamp_ns, throw))
        if throws:
            self.acknowledge(
                self._throw_topic, f"what was thrown at tick {self._first_tick + tick}"
            )

    def _arrays(self) -> dict[str, FloatArray]:
        """What has come back: `position_0` (m, n) and so on, of each character."""
        arrays = {}
        for number, each in enumerate(self._characters):
            nothing = np.full(each.size, np.nan)
            columns = {
                POSITION: [state.position for state in each.states],
                VELOCITY: [state.velocity for state in each.states],
                EFFORT: [nothing if s.effort is None else s.effort for s in each.states],
            }
            for name, rows in columns.items():
                arrays[f"{name}_{number}"] = np.array(rows, dtype=float).reshape(-1, each.size)
        return arrays


def _first_tick(recording: Recording) -> int:
    """The tick of the simulator's first state: the keyframe's, or that of a simulator anew."""
    return FIRST_TICK if recording.keyframe is None else first_tick_of(recording)


class _CharacterTopics:
    """The topics of a character: what is sent to it, and the states that come back."""

    def __init__(
        self, node: BusNode, recording: Recording, inputs: SimulatorInputs, session: str
    ) -> None:
        """Offer the topics, below the character's name where there are several."""
        name = recording.world.name
        self.states: list[StampedState] = []  # each once
        self.last_sent: list[bytes] = []  # commands
        self.size = recording.layout.size
        self._inputs, self._session = inputs, session
        self._layout, self._clock = recording.layout, clock_of(recording)
        self._first_tick = _first_tick(recording)
        self._decoder = JointStateDecoder()
        self._encoder = lru_cache(maxsize=16)(lambda names: JointStateEncoder(names, session))
        self._torques = node.publisher(topics.JOINT_TORQUES.under(name))
        self._wrenches = node.publisher(topics.EXTERNAL_WRENCH.under(name))
        self._pins = node.publisher(topics.PIN.under(name))
        self.publishers = self._torques, self._wrenches, self._pins
        self._subscription = node.subscription(topics.JOINT_STATES.under(name))

    def receive(self) -> bool:
        """Take a state if one is there; returns whether there was one.

        Raises:
            RunError: it is not the next one.
        """
        state = self._next_state()
        if state is None:
            return False
        expected = self._clock.stamp_ns(self._first_tick + len(self.states))
        if state.stamp_ns == expected:
            self.states.append(state)
        elif state.stamp_ns > expected:
            raise RunError(f"the state of {expected} ns was not heard; {state.stamp_ns} ns came")
        else:  # it is published again where an answer was not heard, or another character's
            for raw_command in self.last_sent:
                self._torques.publish(raw_command)
        return True

    def _next_state(self) -> StampedState | None:
        """The next state of the simulator of this session; None if there is none."""
        while (raw := self._subscription.take()) is not None:
            arrays = self._decoder.decode(raw)
            if read_session(arrays.frame_id) == self._session:
                return state_in_layout(self._layout, arrays)
        return None

    def push(self, tick: int) -> None:
        """Send what pushed during a tick, for that tick alone; returns when the simulator has it.

        Raises:
            RunError: it does not acknowledge the message.
        """
        push = self._inputs.pushes[tick]
        if push is not None:
            stamp_ns = self._clock.stamp_ns(self._first_tick + tick)
            own = replace(push, stamp_ns=stamp_ns, frame_id=self._session)
            self._wrenches.publish(encode_wrenches(own))
            Player.acknowledge(self._wrenches, f"the push of tick {self._first_tick + tick}")

    def pin(self, tick: int) -> None:
        """Send what changed the pins as a tick began; returns when the simulator has it.

        Raises:
            RunError: it does not acknowledge the message.
        """
        pins = self._inputs.pins[tick]
        if pins is not None:
            stamp_ns = self._clock.stamp_ns(self._first_tick + tick)
            own = replace(pins, stamp_ns=stamp_ns, frame_id=self._session)
            self._pins.publish(encode_pins(own))
            Player.acknowledge(self._pins, f"the pins of tick {self._first_tick + tick}")

    def command(self, tick: int) -> None:
        """Send what was commanded in a tick."""
        stamp_ns = self._clock.stamp_ns(self._first_tick + tick)
        self.last_sent = [
            self._encoder(each.names).encode(stamp_ns, effort=each.efforts)
            for each in self._inputs.commands[tick]
        ]
        for raw in self.last_sent:
            self._torques.publish(raw)
