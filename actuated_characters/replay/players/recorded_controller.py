"""The node `player` in the controller's place: it sends the commands that a bag has."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from std_srvs.srv import Trigger

from actuated_characters.bags.recording import Recording
from actuated_characters.replay.comparison import EFFORT, POSITION, VELOCITY, clock_of
from actuated_characters.replay.players.controller_parameters import reset_changes
from actuated_characters.replay.players.processes import PlayerReport
from actuated_characters.replay.players.simulator_inputs import SimulatorInputs, make_inputs
from actuated_characters.replay.world import read_world
from msgs_config.arrays import FloatArray
from msgs_config.bus.dds import create_publisher
from msgs_config.bus.polling import DirectSubscription, PollingExecutor
from msgs_config.bus.ros_parameters import declare, given_parameters, set_request
from msgs_config.errors import RunError
from msgs_config.messages import topics
from msgs_config.messages.clock import FIRST_TICK
from msgs_config.messages.joint_state import JointStateDecoder, JointStateEncoder, state_in_layout
from msgs_config.messages.projectiles import ThrowCodec
from msgs_config.messages.session import SESSION, given_session, read_session
from msgs_config.messages.state import StampedState
from msgs_config.messages.wrenches import encode_wrenches
from msgs_config.parameters import Parameter, resolve
from msgs_config.runtime.process import StopSignal

PARAMETERS = [
    Parameter("recording", "", "the bag, or the directory of its run"),
    Parameter("world", 0, "which of the bag's worlds to play, counted from 0"),
    Parameter("states", "states.npz", "where the states go that come back"),
    SESSION,
]

_ACKNOWLEDGE_TIMEOUT = 10.0  # s until the simulator has a push or throw


class RecordedController(Node):
    """Answers each state as it was answered then: torques, what came before them, or a reset."""

    def __init__(self) -> None:
        """Read the recording, and offer the topics of each of its characters.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or the recording cannot be played.
        """
        super().__init__("player")
        values = resolve(PARAMETERS, given_parameters(self))
        declare(self, PARAMETERS, values)
        self._file = Path(values.text("states"))
        world, _ = read_world(Path(values.text("recording")), values.integer("world"))
        self._tick_clock, self._throws = clock_of(world[0]), world[0].throws
        self._reset_client = self.create_client(Trigger, f"{topics.SIM_NODE}/reset")
        self._changes = reset_changes(world)
        self._setter = self.create_client(
            SetParametersAtomically, f"{topics.SIM_NODE}/set_parameters_atomically"
        )
        session = given_session(values)
        self._throw_codec = ThrowCodec(session)
        self._throw_topic = create_publisher(self, topics.THROW)
        inputs = make_inputs(world)
        self._characters = [
            _CharacterTopics(self, *each, session) for each in zip(world, inputs, strict=True)
        ]
        self._ticks, self._resets = len(inputs[0].commands), inputs[0].resets
        self._report = PlayerReport()

    def run(self, stop: StopSignal) -> None:
        """Play until the last state has come back, or until `stop`; then write the states.

        Raises:
            RunError: the simulator does not answer, or it leaves out a state.
        """
        executor = PollingExecutor(self)
        try:
            while not stop and not self._is_subscribed():
                executor.rest()
                self._report.tell_wait(
                    lambda: "sim_node to listen to torques, pushes, throws and resets"
                )
            self._play(stop, executor)
        finally:
            executor.close()
            np.savez(self._file, **self._arrays())  # type: ignore[arg-type]  # no flag is among them

    def _is_subscribed(self) -> bool:
        """Whether the simulator receives all that it will be sent."""
        publishers = [self._throw_topic, *(p for each in self._characters for p in each.publishers)]
        is_ready = self._reset_client.service_is_ready() and self._setter.service_is_ready()
        return is_ready and all(each.get_subscription_count() for each in publishers)

    def _play(self, stop: StopSignal, executor: PollingExecutor) -> None:
        """Answer state after state, each when all characters have it."""
        self._played = 0  # states that all characters have
        self._report.begin_wait()
        while not stop and self._played <= self._ticks:
            received = [each.receive() for each in self._characters]  # of all, not until one
            if any(received):
                executor.received()
                executor.serve()
            else:
                executor.rest()
                self._report.tell_wait(lambda: f"the state of tick {FIRST_TICK + self._played}")
            if min(len(each.states) for each in self._characters) > self._played:
                if self._played < self._ticks:
                    self._replay_tick(self._played, stop, executor)
                self._played += 1
                self._report.tell_state(self._played)
                self._report.begin_wait()

    def _replay_tick(self, tick: int, stop: StopSignal, executor: PollingExecutor) -> None:
        """Let the simulator do what it did in a tick, counted from 0."""
        if tick in self._resets:
            if change := self._changes.get(tick + 1):
                self._set(change, stop, executor)
            self._reset_client.call_async(Trigger.Request())  # the next state is its answer
            for each in self._characters:
                each.last_sent = []  # that answers a state before the reset
            return
        # all of it is there before the last command lets the simulator go on
        self._throw(tick)
        for each in self._characters:
            each.push(tick)
        for each in self._characters:
            each.command(tick)

    def _set(self, change: dict[str, Any], stop: StopSignal, executor: PollingExecutor) -> None:
        """Change parameters of the simulator, which count from the reset that follows."""
        future = self._setter.call_async(set_request(change))
        self._report.begin_wait()
        while not stop and not future.done():
            executor.rest()
            self._report.tell_wait(lambda: f"sim_node to accept {', '.join(change)}")
        response = future.result() if future.done() else None
        if response is not None and not response.result.successful:
            raise RunError(f"sim_node rejected {', '.join(change)}: {response.result.reason}")

    def _throw(self, tick: int) -> None:
        """Send what was thrown as a tick began; returns when the simulator has it."""
        throws = self._throws[tick] if self._throws else ()
        for throw in throws:
            stamp_ns = self._tick_clock.stamp_ns(FIRST_TICK + tick)
            self._throw_topic.publish(self._throw_codec.encode(stamp_ns, throw))
        if throws and not self._throw_topic.is_acknowledged(_ACKNOWLEDGE_TIMEOUT):
            raise RunError(f"the throws of tick {FIRST_TICK + tick} were not acknowledged")

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


class _CharacterTopics:
    """The topics of a character: what is sent to it, and the states that come back."""

    def __init__(
        self, node: Node, recording: Recording, inputs: SimulatorInputs, session: str
    ) -> None:
        """Offer the topics, below the character's name where there are several."""
        name = recording.world.name
        self.states: list[StampedState] = []  # each once
        self.last_sent: list[bytes] = []  # commands
        self.size = recording.layout.size
        self._inputs, self._session = inputs, session
        self._layout, self._clock = recording.layout, clock_of(recording)
        self._decoder = JointStateDecoder()
        self._encoder = lru_cache(maxsize=16)(lambda names: JointStateEncoder(names, session))
        self._torques = create_publisher(node, topics.JOINT_TORQUES.under(name))
        self._wrenches = create_publisher(node, topics.EXTERNAL_WRENCH.under(name))
        self.publishers = self._torques, self._wrenches
        self._subscription = DirectSubscription(node, topics.JOINT_STATES.under(name))

    def receive(self) -> bool:
        """Take a state if one is there; returns whether there was one.

        Raises:
            RunError: it is not the next one.
        """
        state = self._next_state()
        if state is None:
            return False
        expected = self._clock.stamp_ns(FIRST_TICK + len(self.states))
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
            stamp_ns = self._clock.stamp_ns(FIRST_TICK + tick)
            own = replace(push, stamp_ns=stamp_ns, frame_id=self._session)
            self._wrenches.publish(encode_wrenches(own))
            if not self._wrenches.is_acknowledged(_ACKNOWLEDGE_TIMEOUT):
                raise RunError(f"the push of tick {FIRST_TICK + tick} was not acknowledged")

    def command(self, tick: int) -> None:
        """Send what was commanded in a tick."""
        stamp_ns = self._clock.stamp_ns(FIRST_TICK + tick)
        self.last_sent = [
            self._encoder(each.names).encode(stamp_ns, effort=each.efforts)
            for each in self._inputs.commands[tick]
        ]
        for raw in self.last_sent:
            self._torques.publish(raw)
