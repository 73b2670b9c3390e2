"""`player`: stands in the controller's place, and sends what a bag has of it."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from rclpy.duration import Duration
from rclpy.node import Node
from std_srvs.srv import Trigger

from actuated_characters.bags.recording import Recording
from actuated_characters.replay.players.base import Ticks, Watch
from actuated_characters.replay.players.script import Script, make_scripts, read_world
from msgs_config.arrays import FloatArray
from msgs_config.errors import RunError
from msgs_config.messages import topics
from msgs_config.messages.clock import FIRST_TICK, TickClock
from msgs_config.messages.joint_state import (
    JointArrays,
    JointStateDecoder,
    JointStateEncoder,
    state_in_layout,
)
from msgs_config.messages.projectiles import ThrowCodec
from msgs_config.messages.session import (
    ANONYMOUS,
    SESSION,
    SessionBinding,
    given_session,
    read_session,
)
from msgs_config.messages.state import StampedState
from msgs_config.messages.wrenches import encode_wrenches
from msgs_config.parameters import Parameter, resolve
from msgs_config.runtime.polling import DirectSubscription, PollingExecutor
from msgs_config.runtime.process import StopSignal
from msgs_config.runtime.ros_parameters import declare, given_parameters
from msgs_config.shared_parameters import RATE

PARAMETERS = [
    Parameter("recording", "", "the bag, or the directory of its run"),
    Parameter("world", 0, "which of the bag's worlds to play, counted from 0"),
    Parameter("states", "states.npz", "where the states go that come back"),
    SESSION,
]

_MOST_FOREIGN = 1000  # states in a row
_ACKNOWLEDGED = Duration(seconds=10)  # until the simulator has a push


class CommandPlayer(Node):
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
        self._resetting = self.create_client(Trigger, f"{topics.SIM_NODE}/reset")
        self._binding = SessionBinding(
            given_session(values), lambda: self.count_publishers(topics.JOINT_STATES.name)
        )
        self._thrower = _Thrower(self, world[0], self._binding)
        self._parts = [
            _Part(self, *each, self._binding)
            for each in zip(world, make_scripts(world), strict=True)
        ]
        self._ticks = self._parts[0].script.ticks
        self._resets = self._parts[0].script.resets

    def run(self, stop: StopSignal) -> None:
        """Play until the last state has come back, or until `stop`; then write the states.

        Raises:
            RunError: the simulator does not answer, or it leaves out a state.
        """
        spinner, watch = PollingExecutor(self), Watch()
        try:
            while not stop and not self._is_heard():
                spinner.rest()
                watch.look(lambda: "sim_node to listen to torques, pushes, throws and resets")
            self._play(stop, spinner)
        finally:
            spinner.close()
            np.savez(self._file, **self._arrays())  # type: ignore[arg-type]  # no flag is among them

    def _is_heard(self) -> bool:
        heard = [self._thrower.is_heard, *(part.is_heard for part in self._parts)]
        return self._resetting.service_is_ready() and all(heard)

    def _play(self, stop: StopSignal, spinner: PollingExecutor) -> None:
        """Answer state after state, each when all characters have it."""
        watch, ticks = Watch(), Ticks()
        self._played = 0  # states that all characters have
        while not stop and self._played <= self._ticks:
            self._binding.look(time.monotonic())
            received = [part.receive() for part in self._parts]
            if any(received):
                spinner.received()
                spinner.serve()
            else:
                spinner.rest()
                watch.look(lambda: f"the state of tick {FIRST_TICK + self._played}")
            if min(len(part.states) for part in self._parts) > self._played:
                if self._played < self._ticks:
                    self._answer(self._played)
                self._played += 1
                ticks.tell(self._played)
                watch.restart()

    def _answer(self, tick: int) -> None:
        """Let the simulator do what it did in a tick, counted from 0."""
        if tick in self._resets:
            self._resetting.call_async(Trigger.Request())  # the next state is its answer
            for part in self._parts:
                part.forget()
            return
        # all of it is there before the last command lets it go on
        self._thrower.throw(tick)
        for part in self._parts:
            part.push(tick)
        for part in self._parts:
            part.command(tick)

    def _arrays(self) -> dict[str, FloatArray]:
        """What has come back: `position_0` (m, n) and so on, of each character."""
        arrays = {}
        for number, part in enumerate(self._parts):
            still = np.full(part.size, np.nan)
            states = part.states
            columns = {
                "position": [state.position for state in states],
                "velocity": [state.velocity for state in states],
                "effort": [still if state.effort is None else state.effort for state in states],
            }
            for name, rows in columns.items():
                arrays[f"{name}_{number}"] = np.array(rows, dtype=float).reshape(-1, part.size)
        return arrays


class _Thrower:
    """Sends what was thrown into a world."""

    def __init__(self, node: Node, recording: Recording, binding: SessionBinding) -> None:
        """Offer the topic."""
        self._binding = binding
        self._throws = recording.throws
        self._clock = TickClock(int(recording.parameters[RATE.name]))
        self._publisher = topics.create_publisher(node, topics.THROW)

    @property
    def is_heard(self) -> bool:
        """Whether the simulator subscribes."""
        return bool(self._publisher.get_subscription_count())

    def throw(self, tick: int) -> None:
        """Send what was thrown as a tick began; the simulator has it then."""
        throws = self._throws[tick] if self._throws else ()
        for throw in throws:
            stamp_ns = self._clock.stamp_ns(FIRST_TICK + tick)
            codec = ThrowCodec(self._binding.bound or ANONYMOUS)
            self._publisher.publish(codec.encode(stamp_ns, throw))
        if throws and not self._publisher.wait_for_all_acked(_ACKNOWLEDGED):
            raise RunError(f"the throws of tick {FIRST_TICK + tick} were not acknowledged")


class _Part:
    """One character: what is sent to it, and the states that come back."""

    def __init__(
        self, node: Node, recording: Recording, script: Script, binding: SessionBinding
    ) -> None:
        """Offer the topics, below the character's name where there are several."""
        name = recording.world.name
        self._binding = binding
        self.script = script
        self.states: list[StampedState] = []  # each once
        self.size = recording.layout.size
        self._layout = recording.layout
        self._clock = TickClock(int(recording.parameters[RATE.name]))
        self._decoder = JointStateDecoder()
        self._encoders: dict[tuple[str, ...], JointStateEncoder] = {}
        self._torques = topics.create_publisher(node, topics.JOINT_TORQUES.under(name))
        self._wrenches = topics.create_publisher(node, topics.EXTERNAL_WRENCH.under(name))
        self._inbox = DirectSubscription(node, topics.JOINT_STATES.under(name))
        self._last_sent: list[bytes] = []

    @property
    def is_heard(self) -> bool:
        """Whether the simulator subscribes to torques and pushes."""
        publishers = (self._torques, self._wrenches)
        return all(publisher.get_subscription_count() for publisher in publishers)

    def receive(self) -> bool:
        """Take a state if one is there; whether there was one. That of another simulator is none.

        Raises:
            RunError: it is not the next one.
        """
        arrays = self._next_state()
        if arrays is None:
            return False
        state = state_in_layout(self._layout, arrays)
        self._binding.take(read_session(arrays.frame_id))
        expected = self._clock.stamp_ns(FIRST_TICK + len(self.states))
        if state.stamp_ns == expected:
            self.states.append(state)
        elif state.stamp_ns > expected:
            raise RunError(f"the state of {expected} ns was not heard; {state.stamp_ns} ns came")
        else:  # it is published again where an answer was not heard, or another character's
            for raw_command in self._last_sent:
                self._torques.publish(raw_command)
        return True

    def _next_state(self) -> JointArrays | None:
        """The next state of the bound simulator, before the first of any; None if there is none."""
        for _ in range(_MOST_FOREIGN):
            raw = self._inbox.take()
            if raw is None:
                return None
            arrays = self._decoder.decode(raw)
            session = read_session(arrays.frame_id)
            if session == self._binding.bound or (
                not self.states and self._binding.admits(session)
            ):
                return arrays
        return None

    def forget(self) -> None:
        """Send nothing again: a reset answers the present state."""
        self._last_sent = []

    def push(self, tick: int) -> None:
        """Send what pushed during a tick, for that tick alone; the simulator has it then."""
        push = self.script.pushes[tick]
        if push is not None:
            stamp_ns = self._clock.stamp_ns(FIRST_TICK + tick)
            session = self._binding.bound or ANONYMOUS
            own = replace(push, stamp_ns=stamp_ns, frame_id=session)
            self._wrenches.publish(encode_wrenches(own))
            if not self._wrenches.wait_for_all_acked(_ACKNOWLEDGED):
                raise RunError(f"the push of tick {FIRST_TICK + tick} was not acknowledged")

    def command(self, tick: int) -> None:
        """Send what was commanded in a tick."""
        stamp_ns = self._clock.stamp_ns(FIRST_TICK + tick)
        self._last_sent = []
        for command in self.script.commands[tick]:
            encoder = self._encoders.get(command.names)
            if encoder is None:
                session = self._binding.bound or ANONYMOUS
                encoder = JointStateEncoder(command.names, session)
                self._encoders[command.names] = encoder
            self._last_sent.append(encoder.encode(stamp_ns, effort=command.efforts))
        for raw in self._last_sent:
            self._torques.publish(raw)
