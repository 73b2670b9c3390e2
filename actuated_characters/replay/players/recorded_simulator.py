"""The node `sim_node` as a bag: it publishes a state, and the next one when that is answered."""

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node

from actuated_characters.bags.recording import CommandArrays, Recording, read_recording
from actuated_characters.replay.command_comparison import merge_commands, recorded_commands
from actuated_characters.replay.players.controller_parameters import late_topics, parameter_changes
from actuated_characters.replay.players.processes import ANSWER_TIMEOUT, PlayerReport
from actuated_characters.replay.players.simulator_outputs import (
    REQUESTS,
    SessionRewriter,
    opponent_of,
    read_opponent,
    read_rare_messages,
    read_ticks,
    tick_topics,
)
from msgs_config.arrays import BoolArray
from msgs_config.bus.dds import create_publisher
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.bus.polling import DirectSubscription, PollingExecutor
from msgs_config.bus.ros_parameters import declare, given_parameters, set_request
from msgs_config.errors import MessageError, RecordingError, RunError
from msgs_config.messages import topics
from msgs_config.messages.cdr import encode_clock
from msgs_config.messages.joint_state import JointStateDecoder
from msgs_config.messages.session import (
    ANONYMOUS,
    SESSION,
    given_session,
    make_session,
    read_session,
)
from msgs_config.messages.topic import Topic
from msgs_config.parameters import Parameter, resolve
from msgs_config.runtime.process import StopSignal

PARAMETERS = [
    Parameter("recording", "", "the bag, or the directory of its run"),
    Parameter("character", "", "name of the recording to play, where there are several"),
    Parameter("commands", "commands.npz", "where the commands go that answer the states"),
    Parameter(
        "repeat_requests",
        True,
        "repeat what the controller was asked for then: parameters, trajectories and strengths",
    ),
    Parameter(
        "fixed", [], "parameters of controller_node that are not changed as they were", texts=True
    ),
    SESSION,
    Parameter("start_timeout", ANSWER_TIMEOUT, "for a controller; 0: no limit", unit="s"),
]

_REPUBLISH_PERIOD = 0.5  # s, as the simulator's
_ACKNOWLEDGE_TIMEOUT = 10.0  # s until the controller has a trajectory or strengths


class RecordedSimulator(Node):
    """Publishes recorded states, in lockstep with the controller that answers them."""

    def __init__(self) -> None:
        """Read the recording, and offer the simulator's topics.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or the recording cannot be played.
        """
        super().__init__(topics.SIM_NODE)
        values = resolve(PARAMETERS, given_parameters(self))
        declare(self, PARAMETERS, values)
        self._file = Path(values.text("commands"))
        self._session = given_session(values) or make_session(self.get_fully_qualified_name())
        self._rewriter = SessionRewriter(self._session)
        self._path = path = Path(values.text("recording"))
        self._start_timeout = values.number("start_timeout") or math.inf
        self._recording = read_recording(path, values.text("character") or None)
        self._rare = read_rare_messages(path, self._recording)
        self._ticks = read_ticks(path, self._recording)
        recorded = ~np.isnan(recorded_commands(self._recording))  # (t + 1, n)
        if not recorded.any():
            raise RecordingError(f"recording {path} has no commands to compare others with")
        self._received = np.full(recorded.shape, np.nan)
        self._awaited = recorded | _needed_commands(self._recording)
        self._repeats = values.flag("repeat_requests")
        fixed = values.texts("fixed")
        self._changes = parameter_changes(self._recording, fixed) if self._repeats else {}
        self._is_realtime = self._recording.parameters.get("mode") == "realtime"
        self._decoder, self._once_logger = JointStateDecoder(), OnceLogger(self.get_logger())
        self._report = PlayerReport()
        self._open_topics()

    def _open_topics(self) -> None:
        rare = (topics.CONFIGURATION, topics.EPISODE)
        of_ticks = tick_topics(self._recording)
        self._outputs = {topic.name: create_publisher(self, topic) for topic in (*rare, *of_ticks)}
        self._clock_topic = create_publisher(self, topics.CLOCK)
        self._requests = {
            topic.name: create_publisher(self, topic)
            for topic in REQUESTS
            if self._repeats and topic.name in self._rare.requested
        }
        self._parameter_client = self.create_client(
            SetParametersAtomically, f"{topics.CONTROLLER_NODE}/set_parameters_atomically"
        )
        self._opponent = opponent_of(self._recording)
        if self._opponent:
            topic = topics.JOINT_STATES.under(f"/{self._opponent}")
            self._outputs[self._opponent] = create_publisher(self, topic)
            self._opponents_states = read_opponent(self._path, self._recording)
        self._late = late_topics(self._recording)
        self._torques = DirectSubscription(self, topics.JOINT_TORQUES)

    def run(self, stop: StopSignal) -> None:
        """Play until the last state is answered, or until `stop`; then write the commands.

        Raises:
            RunError: no answer comes, or the controller does not accept a parameter.
        """
        self._stop, self._executor = stop, PollingExecutor(self)
        try:
            self._publish(topics.CONFIGURATION, self._rare.configurations[0])
            self._wait(
                self._is_subscribed,
                lambda: (
                    f"a controller that subscribes to {self._outputs['joint_states'].topic_name} "
                    f"and publishes {self.resolve_topic_name(topics.JOINT_TORQUES.name)}"
                ),
                self._start_timeout,
            )
            for row, messages in enumerate(self._ticks):
                if stop:
                    break
                self._play(row, messages)
                self._report.tell_state(row + 1)
        finally:
            self._executor.close()
            np.savez(self._file, commands=self._received)

    def _publish(self, topic: Topic, raw: bytes) -> bytes:
        """Publish a message of the bag in this node's session; returns it."""
        own = self._rewriter.rewrite(topic, raw)
        self._outputs[topic.name].publish(own)
        return own

    def _publish_opponent(self) -> bytes:
        """Publish the next state of the opponent in this node's session; returns it."""
        own = self._rewriter.rewrite(topics.JOINT_STATES, next(self._opponents_states))
        self._outputs[self._opponent].publish(own)
        return own

    def _is_subscribed(self) -> bool:
        """Whether there is a controller, and all that it is sent will reach it."""
        requests = [each for name, each in self._requests.items() if name not in self._late]
        publishers = [self._outputs[topics.JOINT_STATES.name], *requests]
        if self._changes and not self._parameter_client.service_is_ready():
            return False
        answers = self.count_publishers(topics.JOINT_TORQUES.name)
        return bool(answers) and all(each.get_subscription_count() for each in publishers)

    def _play(self, row: int, messages: list[tuple[Topic, bytes]]) -> None:
        """Publish the messages of a tick, its state at the end, and wait for the answer."""
        is_answered = bool(self._awaited[row].any())
        begins = row in self._rare.episodes
        if self._is_realtime and not is_answered and not begins:
            return  # the controller never saw it: it took the newest one
        if self._repeats:
            self._send_requests(row)
        if row and (configuration := self._rare.configurations.get(row)) is not None:
            self._publish(topics.CONFIGURATION, configuration)
        if begins:
            self._publish(topics.EPISODE, self._rare.episodes[row])
        stamp_ns = int(self._recording.stamps_ns[row])
        self._clock_topic.publish(encode_clock(stamp_ns))
        sent = [(topic.name, self._publish(topic, raw)) for topic, raw in messages]
        if self._opponent:
            sent.append((self._opponent, self._publish_opponent()))
        if is_answered:  # else the simulator may have gone on without
            self._wait_for_answer(row, stamp_ns, sent)
            for change in self._changes.get(row, ()):
                self._set(change)

    def _wait_for_answer(self, row: int, stamp_ns: int, sent: list[tuple[str, bytes]]) -> None:
        """Take commands until they cover those awaited; `sent` is sent again meanwhile.

        A controller that was started for this answers at once with all that it has.
        """
        next_time = time.monotonic() + _REPUBLISH_PERIOD
        received, layout = self._received[row], self._recording.layout

        def missing() -> list[str]:
            lacks = np.flatnonzero(self._awaited[row] & np.isnan(received))
            return [layout.dof_names[entry] for entry in lacks]

        def is_answered() -> bool:
            nonlocal next_time
            while (command := self._take(stamp_ns)) is not None:
                first = np.isnan(received)
                received[first] = merge_commands(layout, (command,))[first]
                if self._repeats or not missing():
                    return True
            if time.monotonic() > next_time:
                next_time = time.monotonic() + _REPUBLISH_PERIOD
                for name, raw in sent:
                    self._outputs[name].publish(raw)
            return False

        self._wait(
            is_answered,
            lambda: f"commands that answer the state of {stamp_ns} ns, of {_some(missing())}",
        )

    def _take(self, stamp_ns: int) -> CommandArrays | None:
        """The next command that answers a state, if one is there."""
        while (raw := self._torques.take()) is not None:
            self._executor.received()
            try:
                command = self._decoder.decode(raw)
            except MessageError as error:
                self._once_logger.log_once(f"command rejected: {error}")
                continue
            is_own = read_session(command.frame_id) in (self._session, ANONYMOUS)
            if is_own and command.stamp_ns == stamp_ns:
                return CommandArrays(command.names, command.effort, 0)
        return None

    def _send_requests(self, row: int) -> None:
        for name, message in self._rare.requests.get(row, ()):
            publisher = self._requests[name]
            self._wait(publisher.get_subscription_count, lambda: "controller_node to subscribe")
            publisher.publish(message)
            if not publisher.is_acknowledged(_ACKNOWLEDGE_TIMEOUT):
                raise RunError(f"controller_node did not acknowledge a message on '{name}'")

    def _set(self, change: dict[str, Any]) -> None:
        """Change parameters of the controller, as they were changed then."""
        future = self._parameter_client.call_async(set_request(change))
        names = _some(list(change))
        self._wait(future.done, lambda: f"controller_node to accept {names}")
        response = future.result() if future.done() else None  # not done when it is to stop
        if response is not None and not response.result.successful:
            raise RunError(f"controller_node rejected {names}: {response.result.reason}")

    def _wait(
        self,
        condition: Callable[[], object],
        what: Callable[[], str],
        timeout: float = ANSWER_TIMEOUT,
    ) -> None:
        self._report.begin_wait()
        while not self._stop and not condition():
            self._executor.rest()
            self._report.tell_wait(what, timeout)


def _needed_commands(recording: Recording) -> BoolArray:
    """Which commands (t + 1, n) the simulator went on with, whether they are in the bag or not.

    A recorder may find a controller after its first answers. Only a simulator in lockstep without
    a timeout is known to have had all commands in each tick, but for a reset.
    """
    parameters = recording.parameters
    needed = np.zeros((len(recording.stamps_ns), recording.layout.size), dtype=np.bool_)
    if parameters.get("mode") != "realtime" and not parameters.get("lockstep_timeout"):
        needed[:-1] = recording.layout.mask(parameters["commanded_joints"])
        needed[recording.episode_rows[1:] - 1] = False
    return needed


def _some(names: list[str]) -> str:
    """At most three names, and the number of the others, for a message."""
    shown = ", ".join(f"'{name}'" for name in names[:3])
    return f"{shown} and {len(names) - 3} more" if len(names) > 3 else shown
