"""`sim_node`, but it is a bag that speaks: a state, and the next one when that is answered."""

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from actuated_characters.bags.recording import CommandArrays, read_recording
from actuated_characters.replay.players.base import PATIENCE, Ticks, Watch
from actuated_characters.replay.players.findings import commanded, merged
from actuated_characters.replay.players.session import NewSession
from actuated_characters.replay.players.steering import parameter_changes
from actuated_characters.replay.players.stream import (
    AROUND,
    STEERING,
    RecordedTick,
    read_stream,
    read_ticks,
)
from msgs_config.arrays import BoolArray
from msgs_config.errors import MessageError, RecordingError, RunError
from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointStateDecoder, encode_clock
from msgs_config.messages.session import (
    ANONYMOUS,
    SESSION,
    given_session,
    make_session,
    read_session,
)
from msgs_config.parameters import Parameter, resolve
from msgs_config.runtime.once_logger import OnceLogger
from msgs_config.runtime.polling import DirectSubscription, PollingExecutor
from msgs_config.runtime.process import StopSignal
from msgs_config.runtime.ros_parameters import declare, given_parameters

PARAMETERS = [
    Parameter("recording", "", "the bag, or the directory of its run"),
    Parameter("character", "", "whose states, where there are several"),
    Parameter("commands", "commands.npz", "where the commands go that answer them"),
    Parameter(
        "steers",
        True,
        "send what steered the controller then: parameters, trajectories and strengths",
    ),
    Parameter(
        "fixed", [], "parameters of controller_node that are not changed as they were", texts=True
    ),
    SESSION,
    Parameter("start_patience", PATIENCE, "wait this long for a controller; 0: forever", unit="s"),
]

_REPUBLISH_PERIOD = 0.5  # s, as the simulator's
_ACKNOWLEDGED = Duration(seconds=10)  # until the controller has a trajectory or strengths


class StatePlayer(Node):
    """Publishes recorded states in lockstep with the controller that answers them."""

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
        self._said = NewSession(self._session)
        path = Path(values.text("recording"))
        self._start_patience = values.number("start_patience") or math.inf
        self._recording = read_recording(path, values.text("character") or None)
        self._stream = read_stream(path, self._recording)
        self._ticks = read_ticks(path, self._recording)
        self._expected = ~np.isnan(commanded(self._recording))  # (t + 1, n)
        if not self._expected.any():
            raise RecordingError(f"recording {path} has no commands to compare others with")
        self._received = np.full(self._expected.shape, np.nan)
        self._steers = values.flag("steers")
        fixed = values.texts("fixed")
        self._changes = parameter_changes(self._recording, fixed) if self._steers else {}
        self._runs_on = self._recording.parameters.get("mode") == "realtime"
        self._decoder, self._once_logger = JointStateDecoder(), OnceLogger(self)
        self._open_topics()

    def _open_topics(self) -> None:
        self._configuration = topics.create_publisher(self, topics.CONFIGURATION)
        self._episode = topics.create_publisher(self, topics.EPISODE)
        self._clock_topic = topics.create_publisher(self, topics.CLOCK)
        self._around = {topic.name: topics.create_publisher(self, topic) for topic in AROUND}
        self._steering = {
            topic.name: topics.create_publisher(self, topic)
            for topic in STEERING
            if self._steers and topic.name in self._stream.steered
        }
        self._setting = self.create_client(
            SetParametersAtomically, f"{topics.CONTROLLER_NODE}/set_parameters_atomically"
        )
        self._torques = DirectSubscription(self, topics.JOINT_TORQUES)
        self._state = topics.create_publisher(self, topics.JOINT_STATES)

    def run(self, stop: StopSignal) -> None:
        """Play until the last state is answered, or until `stop`; then write the commands.

        Raises:
            RunError: no answer comes, or the controller does not take a parameter.
        """
        self._stop, self._spinner = stop, PollingExecutor(self)
        try:
            self._configuration.publish(self._said.configuration(self._stream.configuration))
            self._wait(
                self._is_heard,
                lambda: (
                    f"a controller that subscribes to {self._state.topic_name} and publishes "
                    f"{self.resolve_topic_name(topics.JOINT_TORQUES.name)}"
                ),
                self._start_patience,
            )
            ticks = Ticks()
            for row, tick in enumerate(self._ticks):
                if stop:
                    break
                self._play(row, tick)
                ticks.tell(row + 1)
        finally:
            self._spinner.close()
            np.savez(self._file, commands=self._received)

    def _is_heard(self) -> bool:
        """Whether there is a controller, and all that it is sent will reach it."""
        publishers = [self._state, *self._steering.values()]
        if self._changes and not self._setting.service_is_ready():
            return False
        answers = self.count_publishers(topics.JOINT_TORQUES.name)
        return bool(answers) and all(each.get_subscription_count() for each in publishers)

    def _play(self, row: int, tick: RecordedTick) -> None:
        """Publish a state, and wait for what answers it."""
        wanted = self._expected[row]
        begins = row in self._stream.episodes
        if self._runs_on and not wanted.any() and not begins:
            return  # the controller never saw it: it took the newest one
        if self._steers:
            self._send_steering(row)
        stamp_ns = int(self._recording.stamps_ns[row])
        if begins:
            self._episode.publish(self._said.episode(self._stream.episodes[row]))
        self._clock_topic.publish(encode_clock(stamp_ns))
        for name, raw in tick.around:
            self._around[name].publish(self._said.beside_state(name, raw))
        raw_state = self._said.state(tick.state)
        self._state.publish(raw_state)
        if not wanted.any():
            return  # it was not answered then either, or the answer was lost
        self._wait_for_answer(row, stamp_ns, raw_state)
        for change in self._changes.get(row, ()):
            self._set(change)

    def _wait_for_answer(self, row: int, stamp_ns: int, raw: bytes) -> None:
        """Take commands until they cover what was commanded; the state is sent again meanwhile.

        A controller that was started for this answers at once with all that it has.
        """
        next_time = time.monotonic() + _REPUBLISH_PERIOD

        def missing() -> BoolArray:
            lacks: BoolArray = self._expected[row] & np.isnan(self._received[row])
            return lacks

        def is_answered() -> bool:
            nonlocal next_time
            while (command := self._take(stamp_ns)) is not None:
                found = merged(self._recording.layout, (command,))
                first = np.isnan(self._received[row])
                self._received[row, first] = found[first]
                if self._steers or not missing().any():
                    return True
            if time.monotonic() > next_time:
                next_time = time.monotonic() + _REPUBLISH_PERIOD
                self._state.publish(raw)
            return False

        names = self._recording.layout.dof_names
        self._wait(
            is_answered,
            lambda: (
                f"commands that answer the state of {stamp_ns} ns, of "
                + _some([name for name, lacks in zip(names, missing(), strict=True) if lacks])
            ),
            PATIENCE,
        )

    def _take(self, stamp_ns: int) -> CommandArrays | None:
        """The next command that answers a state, if one is there."""
        while (raw := self._torques.take()) is not None:
            self._spinner.received()
            try:
                command = self._decoder.decode(raw)
            except MessageError as error:
                self._once_logger.log_once(f"command ignored: {error}")
                continue
            is_own = read_session(command.frame_id) in (self._session, ANONYMOUS)
            if is_own and command.stamp_ns == stamp_ns:
                return CommandArrays(command.names, command.effort, 0)
        return None

    def _send_steering(self, row: int) -> None:
        for name, message in self._stream.steering.get(row, ()):
            publisher = self._steering[name]
            publisher.publish(message)
            if not publisher.wait_for_all_acked(_ACKNOWLEDGED):
                raise RunError(f"controller_node did not acknowledge a message on '{name}'")

    def _set(self, change: dict[str, Any]) -> None:
        """Change parameters of the controller, as they were changed then."""
        parameters = [
            RosParameter(name, value=value).to_parameter_msg() for name, value in change.items()
        ]
        future = self._setting.call_async(SetParametersAtomically.Request(parameters=parameters))
        names = _some(list(change))
        self._wait(future.done, lambda: f"controller_node to take {names}", PATIENCE)
        response = future.result() if future.done() else None  # not done when it is to stop
        if response is not None and not response.result.successful:
            raise RunError(f"controller_node does not take {names}: {response.result.reason}")

    def _wait(
        self, condition: Callable[[], bool], what: Callable[[], str], patience: float
    ) -> None:
        watch = Watch(patience)
        while not self._stop and not condition():
            self._spinner.rest()
            watch.look(what)


def _some(names: list[str]) -> str:
    """Names as a sentence has them, not too many."""
    shown = ", ".join(f"'{name}'" for name in names[:3])
    return f"{shown} and {len(names) - 3} more" if len(names) > 3 else shown
