"""`fork`: repeats what a recorded run was sent, at the same ticks, and then sends what is new.

It does what any node may do: it pauses the simulator, takes steps, and calls services between
them. Up to the fork it compares each state with the recorded one.
"""

import json
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.client import Client
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from actuated_characters.bags.recording import read_recording
from actuated_characters.fork.inputs import ForkPoint, Stop, Stops, recorded_stops
from actuated_characters.replay.comparison import (
    EFFORT,
    POSITION,
    VELOCITY,
    clock_of,
    first_difference,
)
from actuated_characters.replay.players.controller_parameters import late_topics
from actuated_characters.replay.players.processes import ANSWER_TIMEOUT
from actuated_characters.replay.players.simulator_outputs import REQUESTS, read_rare_messages
from actuated_characters.runs.planned_files import Planned
from actuated_characters.runs.planned_throws import read_throws
from actuated_characters.runs.planned_wrenches import read_pushes
from msgs_config.bus.dds import create_publisher
from msgs_config.bus.node import Publisher
from msgs_config.bus.polling import DirectSubscription, PollingExecutor
from msgs_config.bus.ros_parameters import declare, given_parameters, set_request
from msgs_config.errors import ReplayError, RunError
from msgs_config.messages import topics
from msgs_config.messages.clock import FIRST_TICK, TickClock
from msgs_config.messages.joint_state import JointStateDecoder, state_in_layout
from msgs_config.messages.projectiles import ThrowCodec
from msgs_config.messages.session import SESSION, given_session, read_session
from msgs_config.messages.state import StampedState
from msgs_config.messages.wrenches import encode_wrenches
from msgs_config.parameters import Parameter, Values, resolve
from msgs_config.runtime.process import StopSignal
from msgs_config.versions import describe_changes, installed_versions

PARAMETERS = [
    Parameter("recording", "", "the bag, or the directory of its run"),
    Parameter("row", 0, "state from which on the fork differs, the first one being 0"),
    Parameter("ticks", 1, "length of the fork"),
    Parameter("later_inputs", True, "repeat what was sent from that state on, too"),
    Parameter("settings", "{}", "new parameters of nodes from that state on, JSON by node"),
    Parameter("file", "pushes.json", "new pushes, as a run writes them"),
    Parameter("throws", "throws.json", "new throws, as a run writes them"),
    Parameter("wait_for_subscribers", 1, "begin when this many subscribe to external_wrench"),
    Parameter("throw_subscribers", 1, "likewise to throw"),
    SESSION,
]

_ACKNOWLEDGE_TIMEOUT = 10.0  # s until a node has what it was sent
_PACE = "real_time_factor"
_REST = 0.01  # s between looks at the topics: one waking up for many messages
_HELD_PACE = 1e-9  # of it: the first tick is years away, while states and their answers pass


class ForkNode(Node):
    """Steps the simulator from input to input, and lets it run after the last one."""

    def __init__(self) -> None:
        """Read the recording and the new inputs.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or the recording cannot be repeated.
        """
        super().__init__("fork")
        values = resolve(PARAMETERS, given_parameters(self))
        declare(self, PARAMETERS, values)
        path, self._row = Path(values.text("recording")), values.integer("row")
        self._recording = recording = read_recording(path)
        point = ForkPoint(self._row, values.integer("ticks"), values.flag("later_inputs"))
        self._stops = recorded_stops(recording, point)
        pace = float(recording.parameters.get(_PACE) or 0.0)
        self._tick_clock = clock_of(recording)
        _add_new(self._stops, self._row, self._tick_clock, pace, values)
        rare = read_rare_messages(path, recording).requests
        self._requests = {row: rare[row] for row in rare if point.repeats(row)}
        self._session = given_session(values)
        self._throw_codec = ThrowCodec(self._session)
        self._state_decoder, self._torque_decoder = JointStateDecoder(), JointStateDecoder()
        self._compared = 0  # states
        self._answered_ns = 0  # stamp of the last answer
        self._open_topics(values)

    def _open_topics(self, values: Values) -> None:
        # with the parameters that say how many subscribers to wait for
        pushed, thrown = "wait_for_subscribers", "throw_subscribers"
        requested = {name for each in self._requests.values() for name, _ in each}
        sent = [(topics.EXTERNAL_WRENCH, pushed), (topics.THROW, thrown)]
        sent += [(topic, pushed) for topic in REQUESTS if topic.name in requested]
        self._outgoing: dict[str, tuple[Publisher, int]] = {
            topic.name: (create_publisher(self, topic), values.integer(count))
            for topic, count in sent
        }
        self._setters = {
            node: self.create_client(SetParametersAtomically, f"{node}/set_parameters_atomically")
            for node in (topics.SIM_NODE, topics.CONTROLLER_NODE)
        }
        of_simulator = {"pause": SetBool, "step": Trigger, "reset": Trigger}
        self._simulator_clients = {
            name: self.create_client(service, f"{topics.SIM_NODE}/{name}")
            for name, service in of_simulator.items()
        }
        self._torques: DirectSubscription | None = None
        self._states: DirectSubscription | None = None

    def run(self, stop: StopSignal) -> None:
        """Repeat the run and send what is new, then stay until `stop`.

        Raises:
            ReplayError: a state before the fork, or its own, is not the recorded one.
            RunError: a node does not answer, or does not accept what it is sent.
        """
        self._is_stopped, self._executor = stop, PollingExecutor(self)
        try:
            self._play()
            while not stop:
                self._executor.rest_for(_REST)
        finally:
            self._executor.close()

    def _play(self) -> None:
        # no limit for the start: the command that has started all knows one
        self._wait(self._is_connected, "simulator and controller", np.inf)
        # the first tick is held by its time: a paused simulator would not repeat the first state
        self._set(topics.SIM_NODE, {_PACE: _HELD_PACE})
        self._send(0)
        self._torques = DirectSubscription(self, topics.JOINT_TORQUES)
        self._states = DirectSubscription(self, topics.JOINT_STATES)  # which the simulator awaits
        self._wait_for_answer(0, np.inf)
        self._call("pause", SetBool.Request(data=True))
        self._set(topics.SIM_NODE, {_PACE: 0.0})
        present = 0
        for row in sorted({*self._stops, *self._requests, self._row + 1} - {0}):
            if self._is_stopped:
                return
            present = self._step(present, row - 1)
            if row == self._row + 1:
                self._end_comparison()
            self._send(row)
            present += self._stops[row].resets
        self._torques.close()
        self._torques = None
        self._call("pause", SetBool.Request(data=False))

    def _is_connected(self) -> bool:
        """Whether all are there that will be called or sent something."""
        clients: list[Client] = [*self._setters.values(), *self._simulator_clients.values()]
        return all(each.service_is_ready() for each in clients) and all(
            self._is_heard(name) for name in self._outgoing.keys() - late_topics(self._recording)
        )

    def _is_heard(self, name: str) -> bool:
        """Whether all that are to hear a topic subscribe to it."""
        publisher, count = self._outgoing[name]
        return publisher.get_subscription_count() >= count

    def _step(self, present: int, row: int) -> int:
        """Go on from a row's state to another's; returns that row."""
        if row > present:
            self._set(topics.SIM_NODE, {"step_count": row - present})
            self._call("step", Trigger.Request(), timeout=np.inf)
        return row

    def _end_comparison(self) -> None:
        """Wait until all states up to the fork have been compared; the later ones are its own."""
        self._wait(lambda: self._compared > self._row, f"state {self._compared}")
        assert self._states is not None
        self._states.close()
        self._states = None

    def _send(self, row: int) -> None:
        """Send the inputs of a stop."""
        stop = self._stops.get(row, Stop())
        if row and (stop.settings or self._requests.get(row)):
            self._wait_for_answer(row - 1)
        for node, settings in stop.settings:
            self._set(node, settings)
        messages: list[tuple[str, bytes]] = [*self._requests.get(row, ())]
        for push in stop.pushes:
            content = replace(push.arrays(), frame_id=self._session)
            messages.append((topics.EXTERNAL_WRENCH.name, encode_wrenches(content)))
        for throw in stop.throws:
            raw = self._throw_codec.encode(throw.stamp_ns, throw.throw)
            messages.append((topics.THROW.name, raw))
        for name, message in messages:
            self._wait(partial(self._is_heard, name), f"subscribers of '{name}'")
            self._outgoing[name][0].publish(message)
        for name in dict.fromkeys(name for name, _ in messages):
            if not self._outgoing[name][0].is_acknowledged(_ACKNOWLEDGE_TIMEOUT):
                raise RunError(f"what was sent on '{name}' was not acknowledged")
        if stop.resets:
            self._call("reset", Trigger.Request())

    def _wait_for_answer(self, row: int, timeout: float = ANSWER_TIMEOUT) -> None:
        stamp_ns = self._tick_clock.stamp_ns(FIRST_TICK + row)
        what = f"the answer to the state of {stamp_ns} ns"
        self._wait(lambda: self._answered_ns >= stamp_ns, what, timeout)

    def _set(self, node: str, settings: dict[str, Any]) -> None:
        """Set parameters of a node. Raises RunError if it rejects one."""
        response = self._ask(self._setters[node], set_request(settings))
        if response is not None and not response.result.successful:
            raise RunError(f"{node} rejected {', '.join(settings)}: {response.result.reason}")

    def _call(
        self, name: str, request: SetBool.Request | Trigger.Request, timeout: float = ANSWER_TIMEOUT
    ) -> None:
        """Call a service of the simulator. Raises RunError if it does not do it."""
        response = self._ask(self._simulator_clients[name], request, timeout)
        if response is not None and not response.success:
            raise RunError(f"sim_node did not {name}: {response.message}")

    def _ask(self, client: Client, request: object, timeout: float = ANSWER_TIMEOUT) -> Any:
        """The response of a service; None if this node is to stop meanwhile."""
        future = client.call_async(request)
        self._wait(future.done, client.srv_name, timeout)
        return future.result() if future.done() else None

    def _wait(
        self, condition: Callable[[], bool], what: str, timeout: float = ANSWER_TIMEOUT
    ) -> None:
        """Compare states until a condition holds, or until this node is to stop.

        Raises:
            ReplayError: see `run`.
            RunError: it took longer than the timeout in s.
        """
        deadline = time.monotonic() + timeout
        while not self._is_stopped:
            self._take_messages()
            self._executor.serve_pending()
            if condition():
                return
            if time.monotonic() > deadline:
                raise RunError(f"waited {timeout:g} s for {what}")
            time.sleep(_REST)

    def _take_messages(self) -> None:
        """Take the states and torques that have come, of the session of this run."""
        while self._states is not None and (raw := self._states.take()) is not None:
            arrays = self._state_decoder.decode(raw)
            expected_ns = self._tick_clock.stamp_ns(FIRST_TICK + self._compared)
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


def _add_new(stops: Stops, row: int, clock: TickClock, pace: float, values: Values) -> None:
    """Add the new inputs to stops: parameters at the fork, others in the episode that they are in.

    From the fork on the simulator has the recorded `pace`, unless there is a new one.
    """
    new = json.loads(values.text("settings"))
    if controller := new.get(topics.CONTROLLER_NODE):
        stops[row].settings.append((topics.CONTROLLER_NODE, controller))
    simulator = ({_PACE: pace} if pace else {}) | new.get(topics.SIM_NODE, {})
    if simulator:  # its parameters count from the tick on that begins in the state
        stops[row + 1].settings.append((topics.SIM_NODE, simulator))
    begins = [row, *(each for each, stop in stops.items() if stop.resets)]

    def stop_of(planned: Planned) -> Stop:
        at = clock.tick(planned.stamp_ns) - FIRST_TICK
        return stops[max(begin for begin in begins if begin <= at) + 1]

    for push in read_pushes(Path(values.text("file"))):
        stop_of(push).pushes.append(push)
    for throw in read_throws(Path(values.text("throws"))):
        stop_of(throw).throws.append(throw)
