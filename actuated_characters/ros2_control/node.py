"""`ros2_control_bridge`: a simulator's controller, whose commands a controller manager makes."""

import time

import numpy as np

from actuated_characters.ros2_control.fence import Fence, ServiceFence
from actuated_characters.ros2_control.law import CommandedLaw
from actuated_characters.ros2_control.manager import ControllerManager
from actuated_characters.ros2_control.parameters import (
    BridgeSettings,
    declared,
    law_settings,
    resolved,
)
from actuated_characters.ros2_control.timetable import Timetable, UpdatePeriod
from controller_node.interface.simulators import Simulators
from controller_node.interface.state_decoder import StateDecoder
from msgs_config.bus.composition import AT_ONCE, UNTIL_A_MESSAGE, ComposableNode, Turns
from msgs_config.bus.dds import DdsNode
from msgs_config.bus.live_parameters import LiveParameters
from msgs_config.bus.node import BusNode, Executor, StopFlag
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.bus.publishing import flush
from msgs_config.character.loading import load_character
from msgs_config.character.urdf.ros2_control import HARDWARE, controlled_joints
from msgs_config.errors import (
    CharacterError,
    ClockError,
    ConfigurationError,
    LayoutError,
    MessageError,
)
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.configuration import RunConfiguration
from msgs_config.messages.joint_state import JointStateEncoder
from msgs_config.messages.session import ANONYMOUS
from msgs_config.messages.state import StampedState
from msgs_config.parameters import Values
from msgs_config.shared_parameters import DEFAULT_CHARACTER, GRAVITY, RATE, collides, placed

_PATIENCE = 10.0  # s of wall time that an update may take while the world stands
_FLUSH_TIME = 0.5  # s that the simulator may take to acknowledge the last answer


class BridgeNode(ComposableNode):
    """Answers each state by a law that follows what a controller manager commanded last.

    Until the world begins its first state stands, unanswered, while the controller manager's clock
    goes on: controllers become active from that very state, however long their start takes.
    """

    def __init__(self, node: BusNode | None = None, fence: Fence | None = None) -> None:
        """Read the parameters, build the law, and offer the topics.

        Without a place on a bus it is a node of ROS, with a fence unless a parameter says no.

        Raises:
            ActuatedCharactersError: a parameter or the character cannot be used.
        """
        ros = DdsNode(topics.BRIDGE_NODE) if node is None else None
        super().__init__(ros or node)  # type: ignore[arg-type]
        given = self.node.given_parameters()
        loaded = load_character(str(given.get("character", DEFAULT_CHARACTER)), collides(given))
        self._character = placed(loaded, given)
        joints = controlled_joints(self._character)
        values = resolved(self._character, given)
        self.node.declare(declared(self._character), values)
        self._settings = BridgeSettings.of(values)
        self._period = UpdatePeriod(int(values[RATE.name]), self._settings.update_rate)  # type: ignore[arg-type]
        self._start_ns = self._period.whole_ns(self._settings.start_time)
        self._timetable = Timetable(self._period)
        self._clock = TickClock(self._period.rate_hz)
        self._logger = OnceLogger(self.node.get_logger())
        self._law = CommandedLaw(
            self._character,
            law_settings(self._character, values),
            self._timetable,
            values.number(GRAVITY.name),
        )
        if ros is not None and self._settings.fence:
            fence = ServiceFence(ros, HARDWARE)
        self._fence = fence
        self._open_topics(joints, values)

    def _open_topics(self, joints: list[str], values: Values) -> None:
        layout = self._character.layout
        self._entries, self._joints = layout.indices(tuple(joints)), joints
        self._manager = ControllerManager(self.node, layout, joints, self._fence, self._logger)
        self._simulators = Simulators(
            self.node, self._settings.session.id, self._clock, self._check, self._logger
        )
        self._decoder = StateDecoder(layout, self._clock)
        self._torques = self.node.publisher(topics.JOINT_TORQUES)
        self._states = self.node.subscription(topics.JOINT_STATES)
        self._answered: tuple[bytes, bytes] | None = None  # the last state and its answer
        self._encoder = JointStateEncoder(joints)
        LiveParameters(self.node, declared(self._character), values, self._take_parameters)

    def _take_parameters(self, values: Values) -> None:
        self._law.settings = law_settings(self._character, values)

    def _check(self, found: RunConfiguration) -> None:
        """Raise an error if a simulator simulates something else than this bridge was made for."""
        if found.probe is None:
            return
        if found.layout.dof_names != self._character.layout.dof_names:
            raise CharacterError(
                f"the simulator's character '{found.character}' has other degrees of freedom than "
                f"'{self._character.name}'; set 'character' to the simulator's"
            )
        if found.parameters.get(RATE.name) != self._period.rate_hz:
            raise ConfigurationError(
                f"the simulator's parameter 'rate' is {found.parameters.get(RATE.name)}, the "
                f"bridge's is {self._period.rate_hz}; they must be the same"
            )
        self._law.check_agreement(found.probe)

    def turns(self, stop: StopFlag, executor: Executor) -> Turns:
        """Answer states until `stop`.

        Raises:
            ActuatedCharactersError: the simulator simulates something else than this bridge was
                made for.
        """
        try:
            while not stop:
                self._simulators.take_messages(time.monotonic())
                raw = self._next_state()
                if raw is None:
                    yield UNTIL_A_MESSAGE
                    continue
                executor.received()
                executor.serve()
                for seconds in self._take_state(raw, executor):
                    if stop:
                        return
                    yield seconds
                yield AT_ONCE
        finally:
            flush((self._torques,), _FLUSH_TIME)

    def _next_state(self) -> bytes | None:
        """The next state; in real time the newest."""
        raw = self._simulators.next_state(self._states.take)
        while self._simulators.runs_on and raw is not None:
            newer = self._simulators.next_state(self._states.take)
            if newer is None:
                break
            raw = newer
        return raw

    def _take_state(self, raw: bytes, executor: Executor) -> Turns:
        if self._answered is not None and raw == self._answered[0]:
            self._torques.publish(self._answered[1])
            return
        try:
            state, frame_id = self._decoder.decode(raw)
        except (MessageError, LayoutError, ClockError) as error:
            self._logger.log_once(f"state ignored: {error}")
            return
        if self._simulators.bind(frame_id):
            session = self._simulators.bound or ANONYMOUS
            self._encoder = JointStateEncoder(self._joints, session)
            self._answered = None
        if self._simulators.disagrees() or not self._torques.get_subscription_count():
            return  # the simulator publishes the state again
        yield from self._answer(raw, state, executor)

    def _answer(self, raw: bytes, state: StampedState, executor: Executor) -> Turns:
        tick = self._clock.tick(state.stamp_ns)
        if self._answered is None or state.effort is None:
            if not self._timetable.now_ns:
                yield from self._stand(state, executor)
            self._timetable.begin(tick)
            self._law.begin_episode(tick, state)
        if self._timetable.is_update(tick):
            exchange = self._manager.exchange(self._timetable.now_ns, state, executor)
            command = yield from exchange
            if command is not None:
                self._law.follow(command, state)
        effort = self._law.effort(tick, state)[self._entries]
        answer = self._encoder.encode(state.stamp_ns, effort=np.ascontiguousarray(effort))
        self._torques.publish(answer)
        self._answered = raw, answer

    def _stand(self, state: StampedState, executor: Executor) -> Turns:
        """Let the clock go on, as fast as the wall's, until the world may begin.

        It may one period after a controller has first commanded anything, or where there is a time
        for it, then. Each update is waited for once there was one: a late command would be taken
        for the answer to what comes next.
        """
        self.node.get_logger().info("the world stands until a controller commands its joints")
        patience, commands_anything = self._period.seconds, False
        while not (
            commands_anything and self._timetable.now_ns + self._period.ns >= self._start_ns
        ):
            self._timetable.stand()
            until = time.monotonic() + self._period.seconds
            command = yield from self._manager.exchange(
                self._timetable.now_ns, state, executor, patience
            )
            if command is not None:
                patience, commands_anything = _PATIENCE, command.commands_anything
            if not commands_anything and self._timetable.now_ns > self._start_ns > 0:
                self._logger.log_once(
                    f"'start_time' is over, {self._settings.start_time:g} s, and no controller "
                    "commands anything; the world begins with the first command"
                )
            while (rest := until - time.monotonic()) > 0.0:
                yield rest
