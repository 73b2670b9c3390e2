"""The node `sim_node` as a bag: it publishes a state, and the next one when that is answered."""

import math
import time
from pathlib import Path

import numpy as np

from actuated_characters.bags.recording import CommandArrays, Recording, read_recording
from actuated_characters.replay.command_comparison import merge_commands, recorded_commands
from actuated_characters.replay.players.controller_parameters import late_topics, parameter_changes
from actuated_characters.replay.players.player import ANSWER_TIMEOUT, Player, some_of
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
from msgs_config.bus.composition import Turns, ros_node
from msgs_config.bus.node import BusNode, declared_settings
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.errors import MessageError, RecordingError
from msgs_config.messages import topics
from msgs_config.messages.cdr import encode_clock
from msgs_config.messages.joint_state import JointStateDecoder
from msgs_config.messages.session import (
    ANONYMOUS,
    GivenSession,
    make_session,
    read_session,
)
from msgs_config.messages.topic import Topic
from msgs_config.settings import Settings, parameter


class RecordedSimulatorSettings(Settings):
    """Which recording is played, and where what answers it goes."""

    recording: str = parameter("", "the bag, or the directory of its run")
    character: str = parameter("", "name of the recording to play, where there are several")
    commands: str = parameter("commands.npz", "where the commands go that answer the states")
    repeat_requests: bool = parameter(
        True,
        "repeat what the controller was asked for then: parameters, trajectories and strengths",
    )
    fixed: tuple[str, ...] = parameter(
        (), "parameters of controller_node that are not changed as they were"
    )
    session: GivenSession = GivenSession()
    start_timeout: float = parameter(ANSWER_TIMEOUT, "for a controller; 0: no limit", unit="s")


_REPUBLISH_PERIOD = 0.5  # s, as the simulator's


class RecordedSimulator(Player):
    """Publishes recorded states, in lockstep with the controller that answers them."""

    def __init__(self, node: BusNode | None = None) -> None:
        """Read the recording, and offer the simulator's topics.

        Without a place on a bus it is a node of ROS.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or the recording cannot be played.
        """
        super().__init__(node or ros_node(topics.SIM_NODE))
        settings = declared_settings(self.node, RecordedSimulatorSettings)
        self._file = Path(settings.commands)
        self._session = settings.session.id or make_session(self.node.get_fully_qualified_name())
        self._rewriter = SessionRewriter(self._session)
        self._path = path = Path(settings.recording)
        self._start_timeout = settings.start_timeout or math.inf
        self._recording = read_recording(path, settings.character or None)
        self._rare = read_rare_messages(path, self._recording)
        self._ticks = read_ticks(path, self._recording)
        recorded = ~np.isnan(recorded_commands(self._recording))  # (t + 1, n)
        if not recorded.any():
            raise RecordingError(f"recording {path} has no commands to compare others with")
        self._received = np.full(recorded.shape, np.nan)
        self._awaited = recorded | _needed_commands(self._recording)
        self._repeats = settings.repeat_requests
        self._changes = parameter_changes(self._recording, settings.fixed) if self._repeats else {}
        self._is_realtime = self._recording.parameters.get("mode") == "realtime"
        self._decoder, self._once_logger = JointStateDecoder(), OnceLogger(self.node.get_logger())
        self._open_topics()

    def _open_topics(self) -> None:
        rare = (topics.CONFIGURATION, topics.EPISODE)
        of_ticks = tick_topics(self._recording)
        self._outputs = {topic.name: self.node.publisher(topic) for topic in (*rare, *of_ticks)}
        self._clock_topic = self.node.publisher(topics.CLOCK)
        self._requests = {
            topic.name: self.node.publisher(topic)
            for topic in REQUESTS
            if self._repeats and topic.name in self._rare.requested
        }
        self._controller = self.node.client(topics.CONTROLLER_NODE)
        self._opponent = opponent_of(self._recording)
        if self._opponent:
            topic = topics.JOINT_STATES.under(f"/{self._opponent}")
            self._outputs[self._opponent] = self.node.publisher(topic)
            self._opponents_states = read_opponent(self._path, self._recording)
        self._late = late_topics(self._recording)
        self._torques = self.node.subscription(topics.JOINT_TORQUES)

    def play(self) -> Turns:
        """Play until the last state is answered, or until `stop`; then write the commands.

        Raises:
            RunError: no answer comes, or the controller does not accept a parameter.
        """
        try:
            self._publish(topics.CONFIGURATION, self._rare.configurations[0])
            yield from self.wait(
                self._is_subscribed,
                lambda: (
                    f"a controller that subscribes to {self._outputs['joint_states'].topic_name} "
                    f"and publishes {self.node.resolve_topic_name(topics.JOINT_TORQUES.name)}"
                ),
                self._start_timeout,
            )
            for row, messages in enumerate(self._ticks):
                if self.stop:
                    break
                yield from self._play_tick(row, messages)
                self.tell_state(row + 1)
        finally:
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
        if self._changes and not self._controller.is_ready:
            return False
        answers = self.node.count_publishers(topics.JOINT_TORQUES.name)
        return bool(answers) and all(each.get_subscription_count() for each in publishers)

    def _play_tick(self, row: int, messages: list[tuple[Topic, bytes]]) -> Turns:
        """Publish the messages of a tick, its state at the end, and wait for the answer."""
        is_answered = bool(self._awaited[row].any())
        begins = row in self._rare.episodes
        if self._is_realtime and not is_answered and not begins:
            return  # the controller never saw it: it took the newest one
        if self._repeats:
            yield from self._send_requests(row)
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
            yield from self._wait_for_answer(row, stamp_ns, sent)
            for change in self._changes.get(row, ()):
                yield from self.set_parameters(self._controller, topics.CONTROLLER_NODE, change)

    def _wait_for_answer(self, row: int, stamp_ns: int, sent: list[tuple[str, bytes]]) -> Turns:
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

        yield from self.wait(
            is_answered,
            lambda: f"commands that answer the state of {stamp_ns} ns, of {some_of(missing())}",
        )

    def _take(self, stamp_ns: int) -> CommandArrays | None:
        """The next command that answers a state, if one is there."""
        while (raw := self._torques.take()) is not None:
            self.executor.received()
            try:
                command = self._decoder.decode(raw)
            except MessageError as error:
                self._once_logger.log_once(f"command rejected: {error}")
                continue
            is_own = read_session(command.frame_id) in (self._session, ANONYMOUS)
            if is_own and command.stamp_ns == stamp_ns:
                return CommandArrays(command.names, command.effort, 0)
        return None

    def _send_requests(self, row: int) -> Turns:
        for name, message in self._rare.requests.get(row, ()):
            publisher = self._requests[name]
            yield from self.wait(
                publisher.get_subscription_count, lambda: "controller_node to subscribe"
            )
            publisher.publish(message)
            self.acknowledge(publisher, f"a message on '{name}'")


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
