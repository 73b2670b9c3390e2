"""`fork`: repeats what a recorded run was sent, at the same ticks, and then sends what is new.

It does what any node may do: it pauses the simulator, takes steps, and calls services between
them. Up to the fork it compares each state with the recorded one.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from actuated_characters.fork.inputs import Stop
from actuated_characters.fork.script import PACE, ForkSettings, Script, read_script
from actuated_characters.replay.comparison import (
    EFFORT,
    POSITION,
    VELOCITY,
    clock_of,
    first_difference,
)
from actuated_characters.replay.players.controller_parameters import late_topics
from actuated_characters.replay.players.player import ANSWER_TIMEOUT, Player
from actuated_characters.replay.players.simulator_outputs import REQUESTS
from msgs_config.bus.composition import Turns, ros_node
from msgs_config.bus.node import BusNode, Publisher, Subscription, declared_settings
from msgs_config.errors import ReplayError
from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointStateDecoder, state_in_layout
from msgs_config.messages.pins import encode_pins
from msgs_config.messages.projectiles import ThrowCodec
from msgs_config.messages.session import read_session
from msgs_config.messages.state import StampedState
from msgs_config.messages.wrenches import encode_wrenches
from msgs_config.versions import describe_changes, installed_versions

_STRENGTH = topics.STRENGTH.of(topics.CONTROLLER_NODE)
_BEHAVIOUR = topics.BEHAVIOUR.of(topics.CONTROLLER_NODE)
_REST = 0.01  # s between looks at the topics: one waking up for many messages
_SERVICES = {"pause": True, "step": False, "reset": False}  # whether each takes a flag
_HELD_PACE = 1e-9  # of it: the first tick is years away, while states and their answers pass


class ForkNode(Player):
    """Steps the simulator from input to input, and lets it run after the last one."""

    def __init__(self, node: BusNode | None = None, script: Script | None = None) -> None:
        """Play a script; without one read the recording and the new inputs.

        Without a place on a bus it is a node of ROS.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or the recording cannot be repeated.
        """
        super().__init__(node or ros_node("fork"), silent=True)
        settings = declared_settings(self.node, ForkSettings)
        script = script or read_script(settings)
        self._recording, self._row = script.recording, script.row
        self._stops, self._requests = script.stops, script.requests
        self._tick_clock, self._first_tick = clock_of(script.recording), script.first_tick
        self._session = settings.session.id
        self._throw_codec = ThrowCodec(self._session)
        self._state_decoder, self._torque_decoder = JointStateDecoder(), JointStateDecoder()
        self._compared = 0  # states
        self._answered_ns = 0  # stamp of the last answer
        self._open_topics(settings)

    def _open_topics(self, settings: ForkSettings) -> None:
        pushed, thrown = settings.wait_for_subscribers, settings.throw_subscribers
        requested = {name for each in self._requests.values() for name, _ in each}
        sent = [(topics.EXTERNAL_WRENCH, pushed), (topics.THROW, thrown)]
        if any(stop.pins for stop in self._stops.values()):
            sent.append((topics.PIN, settings.pin_subscribers))
        sent += [(topic, pushed) for topic in REQUESTS if topic.name in requested]
        if settings.strengths:
            sent.append((_STRENGTH, settings.strength_subscribers))
        if settings.behaviours:
            sent.append((_BEHAVIOUR, settings.behaviour_subscribers))
        self._outgoing: dict[str, tuple[Publisher, int]] = {
            topic.name: (self.node.publisher(topic), count) for topic, count in sent
        }
        self._clients = {
            topics.SIM_NODE: self.node.client(topics.SIM_NODE, _SERVICES),
            topics.CONTROLLER_NODE: self.node.client(topics.CONTROLLER_NODE),
        }
        self._torques: Subscription | None = None
        self._states: Subscription | None = None

    def play(self) -> Turns:
        """Repeat the run and send what is new, then stay until `stop`.

        Raises:
            ReplayError: a state before the fork, or its own, is not the recorded one.
            RunError: a node does not answer, or does not accept what it is sent.
        """
        # no limit for the start: the command that has started all knows one
        yield from self.wait(self._is_connected, lambda: "simulator and controller", np.inf)
        # the first tick is held by its time: a paused simulator would not repeat the first state
        yield from self._set(topics.SIM_NODE, {PACE: _HELD_PACE})
        yield from self._send(0)
        self._torques = self.node.subscription(topics.JOINT_TORQUES)
        self._states = self.node.subscription(topics.JOINT_STATES)  # which the simulator awaits
        yield from self._wait_for_answer(0, np.inf)
        if self._row < 0:
            yield from self._end_comparison()
        yield from self._call("pause")
        yield from self._set(topics.SIM_NODE, {PACE: 0.0})
        present = 0
        for row in sorted({*self._stops, *self._requests, self._row + 1} - {0}):
            if self.stop:
                return
            yield from self._step(present, row - 1)
            present = row - 1
            if row == self._row + 1:
                yield from self._end_comparison()
            yield from self._send(row)
            present += self._stops[row].resets
        self._torques.close()
        self._torques = None
        yield from self._call("pause", flag=False)
        while not self.stop:
            yield _REST

    def _is_connected(self) -> bool:
        """Whether all are there that will be called or sent something."""
        return all(each.is_ready for each in self._clients.values()) and all(
            self._is_heard(name) for name in self._outgoing.keys() - late_topics(self._recording)
        )

    def _is_heard(self, name: str) -> bool:
        """Whether all that are to hear a topic subscribe to it."""
        publisher, count = self._outgoing[name]
        return publisher.get_subscription_count() >= count

    def _step(self, present: int, row: int) -> Turns:
        """Go on from a row's state to another's."""
        if row > present:
            yield from self._set(topics.SIM_NODE, {"step_count": row - present})
            yield from self._call("step", timeout=np.inf)

    def _end_comparison(self) -> Turns:
        """Wait until all states up to the fork have been compared; the later ones are its own."""
        yield from self.wait(lambda: self._compared > self._row, lambda: f"state {self._compared}")
        assert self._states is not None
        self._states.close()
        self._states = None

    def _send(self, row: int) -> Turns:
        """Send the inputs of a stop."""
        stop = self._stops.get(row, Stop())
        if row and (stop.settings or stop.asks_controller or self._requests.get(row)):
            yield from self._wait_for_answer(row - 1)
        for node, settings in stop.settings:
            yield from self._set(node, settings)
        messages: list[tuple[str, bytes]] = [*self._requests.get(row, ())]
        messages += [(_STRENGTH.name, each.encode()) for each in stop.strengths]
        messages += [(_BEHAVIOUR.name, each.encode()) for each in stop.behaviours]
        for push in stop.pushes:
            content = replace(push.arrays(), frame_id=self._session)
            messages.append((topics.EXTERNAL_WRENCH.name, encode_wrenches(content)))
        for pin in stop.pins:
            messages.append((topics.PIN.name, encode_pins(pin.arrays(self._session))))
        for throw in stop.throws:
            raw = self._throw_codec.encode(throw.stamp_ns, throw.throw)
            messages.append((topics.THROW.name, raw))
        for name, message in messages:
            yield from self.wait(
                partial(self._is_heard, name), partial("subscribers of '{}'".format, name)
            )
            self._outgoing[name][0].publish(message)
        for name in dict.fromkeys(name for name, _ in messages):
            self.acknowledge(self._outgoing[name][0], f"what was sent on '{name}'")
        if stop.resets:
            yield from self._call("reset")

    def _wait_for_answer(self, row: int, timeout: float = ANSWER_TIMEOUT) -> Turns:
        stamp_ns = self._tick_clock.stamp_ns(self._first_tick + row)
        yield from self.wait(
            lambda: self._answered_ns >= stamp_ns,
            lambda: f"the answer to the state of {stamp_ns} ns",
            timeout,
        )

    def _set(self, node: str, settings: dict[str, Any]) -> Turns:
        yield from self.set_parameters(self._clients[node], node, settings)

    def _call(self, name: str, *, flag: bool = True, timeout: float = ANSWER_TIMEOUT) -> Turns:
        simulator = self._clients[topics.SIM_NODE]
        yield from self.call(simulator, topics.SIM_NODE, name, flag=flag, timeout=timeout)

    def look(self) -> None:
        """Take the states and torques that have come, of the session of this run.

        Raises:
            ReplayError: see `play`.
        """
        while self._states is not None and (raw := self._states.take()) is not None:
            arrays = self._state_decoder.decode(raw)
            expected_ns = self._tick_clock.stamp_ns(self._first_tick + self._compared)
            is_own = read_session(arrays.frame_id) == self._session
            if is_own and arrays.stamp_ns == expected_ns and self._compared <= self._row:
                self._compare(state_in_layout(self._recording.layout, arrays))
        while self._torques is not None and (raw := self._torques.take()) is not None:
            command = self._torque_decoder.decode(raw)
            if read_session(command.frame_id) == self._session:
                self._answered_ns = command.stamp_ns

    def _compare(self, state: StampedState) -> None:
        """Compare the next state, and the effort before it, with the recorded one's bits."""
        nothing = np.full(self._recording.layout.size, np.nan)
        found = {
            EFFORT: (nothing if state.effort is None else state.effort)[None],
            POSITION: state.position[None],
            VELOCITY: state.velocity[None],
        }
        difference = first_difference(self._recording, found, first_row=self._compared)
        if difference is not None:
            changed = describe_changes(self._recording.versions, installed_versions())
            raise ReplayError("; ".join(filter(None, (str(difference), changed))))
        self._compared += 1
