"""`controller_node`: answers each state with joint torques, the state's stamp echoed."""

import time
from collections.abc import Callable, Iterable
from contextlib import suppress

from controller_node.actuation import describe_actuation
from controller_node.behaviours.base import Surroundings
from controller_node.controller import Controller
from controller_node.controller_setups import ControllerSetups
from controller_node.interface.answer_report import AnswerReport
from controller_node.interface.awaited_messages import AwaitedMessages
from controller_node.interface.publishers import ControllerPublishers, Reply
from controller_node.interface.simulator_check import check_simulator
from controller_node.interface.simulators import Simulators
from controller_node.interface.stamped_topics import StampedTopics
from controller_node.interface.state_decoder import StateDecoder
from controller_node.parameters import (
    PARAMETERS,
    ControllerOptions,
    character_parameters,
    check_world,
)
from msgs_config.bus.composition import AT_ONCE, UNTIL_A_MESSAGE, ComposableNode, Turns, ros_node
from msgs_config.bus.keyframe_publisher import KeyframePublisher
from msgs_config.bus.live_parameters import LiveParameters
from msgs_config.bus.node import BusNode, Executor, StopFlag
from msgs_config.bus.once_logger import UNLOGGED, OnceLogger
from msgs_config.bus.publishing import publish_together
from msgs_config.character.loading import load_character
from msgs_config.errors import ClockError, LayoutError, MessageError
from msgs_config.messages import configuration, topics
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.keyframe import read_keyframe
from msgs_config.messages.session import ANONYMOUS
from msgs_config.messages.state import StampedState
from msgs_config.parameters import Values, resolve
from msgs_config.shared_parameters import DEFAULT_CHARACTER, collides, placed


class ControllerNode(ComposableNode):
    """Subscribes to `joint_states`; publishes `joint_torques` and `~/reference`."""

    def __init__(self, node: BusNode | None = None) -> None:
        """Read the parameters, build the controller, and offer the topics.

        Without a place on a bus it is a node of ROS.

        Raises:
            ActuatedCharactersError: a parameter, the character or the clip cannot be used.
        """
        super().__init__(node or ros_node(topics.CONTROLLER_NODE))
        given = self.node.given_parameters()
        loaded = load_character(str(given.get("character", DEFAULT_CHARACTER)), collides(given))
        self._character = placed(loaded, given)
        self._layout = self._character.layout
        declared = PARAMETERS + character_parameters(self._character, given)
        values = resolve(declared, given)
        self.node.declare(declared, values)
        self._setups = ControllerSetups(self._character, declared, values)
        self._log_warnings(self._character.warnings)
        self._log_warnings(self._setups.in_force.warnings)
        self._going_on = self._read_keyframe()
        self._last_reply: Reply | None = None
        self._published_first: StampedState | None = None
        self._is_answering = False
        self._upcoming: Values | None = None
        self._episode_ns: int | None = None
        self._once_logger = OnceLogger(self.node.get_logger())
        self._report = AnswerReport(self.node, self._character.name)
        self._serve: Callable[[], None] = lambda: None
        self._open_topics()
        self._publish_first_state()
        LiveParameters(self.node, declared, values, self._take_parameters, self._check_parameters)

    def _log_warnings(self, warnings: Iterable[str]) -> None:
        for warning in warnings:
            self.node.get_logger().warning(warning)

    def _read_keyframe(self) -> int:
        """Go on from the keyframe that the parameters name; its stamp, 0 if they name none."""
        path = ControllerOptions.of(self._values).keyframes.file
        if not path:
            return 0
        keyframe = read_keyframe(path)
        self._setups.go_on(keyframe.memory)
        return keyframe.stamp_ns

    def _open_topics(self) -> None:
        controller, logger = self._controller, self._once_logger
        self._decoder = StateDecoder(self._layout, controller.clock)
        self._simulators = Simulators(
            self.node,
            ControllerOptions.of(self._values).session.id,
            controller.clock,
            lambda found: check_simulator(self._setups.in_force, self._character, found),
            logger,
        )
        self._awaited = AwaitedMessages(
            self.node, controller, self._character, self._simulators, logger
        )
        self._pending_state: bytes | None = None  # a state whose other messages are awaited
        # After all others: a simulator that has found this one has found the others as well.
        self._states = self.node.subscription(topics.JOINT_STATES)
        self._outputs = ControllerPublishers(
            self.node, self._layout, self._setups.in_force.driven, self._simulators.bound
        )
        self._stamped_topics = StampedTopics(self.node, controller, self._outputs, logger)
        self._keyframes = KeyframePublisher(
            self.node,
            topics.CONTROLLER_KEYFRAME.of(self.node.get_name()),
            controller.clock,
            ControllerOptions.of(self._values).keyframes,
            at_once=bool(self._going_on),
        )
        self._publish_configuration()

    @property
    def _controller(self) -> Controller:
        return self._setups.in_force.controller

    @property
    def _values(self) -> Values:
        return self._setups.in_force.values

    def _publish_configuration(self) -> None:
        """Publish the parameters in force, and since which state they are."""
        since_ns = None if self._last_reply is None else self._last_reply.state.stamp_ns
        setup = self._setups.in_force
        self._outputs.publish_configuration(
            configuration.describe(
                self._character,
                self._values,
                since_ns,
                actuation=describe_actuation(len(setup.driven), self._layout.size),
                files=setup.files,
            )
        )

    def _publish_first_state(self) -> None:
        """Publish where the next episode's reference begins, if that is new."""
        first = self._setups.first_state
        if first is not self._published_first:  # each setup of an episode makes a new object
            self._published_first = first
            self._outputs.publish_initial_state(first)

    def turns(self, stop: StopFlag, executor: Executor) -> Turns:
        """Answer states until `stop`.

        Raises:
            ActuatedCharactersError: the simulator simulates something else than this controller
                was made for.
        """
        self._serve = executor.serve
        self._controller.while_planning(self._serve)
        try:
            while not stop:
                yield self._spin_once(executor)
        finally:
            self._report.publish(self._other_counts, at_once=True)
            self._outputs.flush()

    def _spin_once(self, executor: Executor) -> float:
        """Answer a state if there is one; the turn's result."""
        self._report.publish(self._other_counts)
        self._simulators.take_messages(time.monotonic())
        raw = self._next_state()
        if raw is not None:
            executor.received()
            executor.serve()  # a flood of states must not keep services waiting
            self._take_state(raw)
            return AT_ONCE
        if self._pending_state is not None:
            self._take_state(self._pending_state)
        self._outputs.make_up(self._last_reply)
        return UNTIL_A_MESSAGE

    def _next_state(self) -> bytes | None:
        """The next state; in real time the newest, for the others have been overtaken."""
        raw = self._simulators.next_state(self._states.take)
        if raw is None or not self._simulators.runs_on:
            return raw
        for _ in range(topics.JOINT_STATES.quality.depth):
            newer = self._simulators.next_state(self._states.take)
            if newer is None:
                break
            self._overtake(raw)
            raw = newer
        return raw

    def _overtake(self, raw: bytes) -> None:
        """Leave a state without an answer, except that it may be the first of an episode."""
        self._report.counts["overtaken"] += 1
        if self._is_answered(raw):
            return
        with suppress(MessageError, LayoutError, ClockError):
            state, _ = self._decoder.decode(raw)
            if state.effort is None:
                self._begin_episode(state.stamp_ns)

    def _take_state(self, raw: bytes) -> None:
        if not self._is_heard():
            return  # the simulator publishes the state again
        if self._is_answered(raw):
            assert self._last_reply is not None
            self._report.counts["repeated"] += 1
            self._outputs.publish(self._last_reply)
            return
        try:
            state, frame_id = self._decoder.decode(raw)
        except (MessageError, LayoutError, ClockError) as error:
            self._report.counts["ignored"] += 1
            self._once_logger.log_once(f"state ignored: {error}")
            return
        self._bind(frame_id)
        episode_ns = self._episode_of(state)
        if episode_ns is None:
            return  # the simulator publishes the state again
        if self._simulators.disagrees():
            self._pending_state = raw
            return
        surroundings = self._awaited.until(state.stamp_ns, episode_ns)
        if surroundings is None:
            self._pending_state = raw
            return  # the simulator publishes these messages again, too
        self._pending_state = None
        self._check_rate(state)
        self._stamped_topics.take(state.stamp_ns, episode_ns)
        self._answer_state(raw, state, episode_ns, surroundings)

    def _answer_state(
        self, raw: bytes, state: StampedState, episode_ns: int, surroundings: Surroundings
    ) -> None:
        if self._keyframes.is_due(state.stamp_ns) and not self._simulators.runs_on:
            self._publish_keyframe(state.stamp_ns)  # in real time it would delay the answer
        started = time.perf_counter()
        self._is_answering = True
        effort, reference = self._controller.compute_effort(state, episode_ns, *surroundings)
        self._is_answering = False
        self._last_reply = self._outputs.make_reply(raw, state, effort, reference)
        self._report.answer_times.add(time.perf_counter() - started)
        self._report.counts["answered"] += 1
        mode, outlook = self._controller.mode, self._controller.outlook
        self._outputs.publish_changes(mode, outlook, state.stamp_ns)
        self._outputs.publish(self._last_reply)
        self._stamped_topics.judge(state, reference)
        if self._upcoming is not None:
            self._take_parameters(self._upcoming)

    def _publish_keyframe(self, stamp_ns: int) -> None:
        """Publish what this controller goes on from, before its answer to a stamp's state."""
        setup, session = self._setups.in_force, self._simulators.bound or ANONYMOUS
        memory = setup.keyframe_format.write(setup.controller)
        publish_together(self._keyframes.messages(stamp_ns, session, memory))

    def _is_answered(self, raw: bytes) -> bool:
        """Whether a state, serialised, is the one that was answered last, of the same simulator."""
        reply = self._last_reply
        return (
            reply is not None and reply.raw_state == raw and reply.session == self._simulators.bound
        )

    def _bind(self, frame_id: str) -> None:
        """Bind to the simulator of a usable state, if none is bound, and forget another one's."""
        if self._simulators.bind(frame_id):
            self._episode_ns = self._pending_state = None
            self._outputs.bind(self._simulators.bound or ANONYMOUS)
            self._awaited.restart()

    def _is_heard(self) -> bool:
        """Whether all that are to hear the first answer are there; later ones wait for none."""
        if self._last_reply is not None:
            return True
        wanted = ControllerOptions.of(self._values).wait_for_subscribers
        return self._outputs.torque_subscribers >= wanted

    def _check_rate(self, state: StampedState) -> None:
        """Log if states come several ticks apart: their stamps fit any multiple of the rate."""
        reply = self._last_reply
        if reply is None or state.effort is None or self._simulators.runs_on:
            return
        rate_hz, apart_ns = self._controller.clock.rate_hz, state.stamp_ns - reply.state.stamp_ns
        apart = round(apart_ns * rate_hz / NANOSECONDS_PER_SECOND)
        if apart > 1 and reply.session == self._simulators.bound:
            self._once_logger.log_once(
                f"states come {apart} ticks of {rate_hz} Hz apart; set 'rate' to the simulator's"
            )

    def _episode_of(self, state: StampedState) -> int | None:
        """Stamp of the first state of the state's episode; None if it is not known yet.

        A first state, without effort, begins another episode even with the stamp of the one before:
        the simulator may have been started again. A controller that joins later learns the stamp
        from the latched topic, once.
        """
        if state.effort is None:
            # A changed configuration came before the state.
            self._simulators.take_messages(time.monotonic())
            if self._simulators.bound is None:
                return None  # not the simulator that this controller was made for
            self._begin_episode(state.stamp_ns)
        elif self._episode_ns is None:
            found_ns = self._simulators.episode_before(state.stamp_ns)
            if found_ns is not None and state.stamp_ns == self._going_on:
                self._episode_ns = found_ns  # the controller is in it already
            elif found_ns is not None:
                self._begin_episode(found_ns)
        if self._episode_ns is None or self._episode_ns > state.stamp_ns:
            return None
        return self._episode_ns

    def _begin_episode(self, stamp_ns: int) -> None:
        """Forget the episode before; a first state that waits for its contacts may do it again."""
        if self._setups.begin_episode():
            self._use_controller()
        self._episode_ns = stamp_ns
        self._controller.begin_episode(stamp_ns)
        self._outputs.begin_episode()
        self._stamped_topics.begin_episode()
        self._awaited.begin()

    def _use_controller(self) -> None:
        """Go on with another controller, in force from the first state of an episode on."""
        controller = self._controller
        controller.while_planning(self._serve)
        self._awaited.use(controller)
        self._stamped_topics.use(controller, None)
        self._outputs.drive(self._setups.in_force.driven)
        self._simulators.check_again()
        self._publish_configuration()

    def _other_counts(self) -> dict[str, object]:
        """What else the diagnostics tell."""
        unlogged = {UNLOGGED: self._once_logger.unlogged}
        return {**self._simulators.counts, **self._stamped_topics.refused, **unlogged}

    def _check_parameters(self, values: Values) -> None:
        coming = self._setups.check(values)
        if coming is not None:
            self._awaited.check(coming.controller)
            simulator = self._simulators.configuration
            check_world(values, {} if simulator is None else simulator.parameters)

    def _take_parameters(self, values: Values) -> None:
        """Take changed settings, all at once; they count from the next state on."""
        if self._is_answering:  # services are answered while a plan is waited for
            self._upcoming = values
            return
        self._upcoming, before = None, self._setups.upcoming
        self._setups.take(values)
        coming = self._setups.upcoming
        if coming is not None and coming is not before:
            self._log_warnings(coming.warnings)
        upcoming = None if coming is None else coming.controller
        self._stamped_topics.use(self._controller, upcoming)
        self._publish_first_state()
        self._publish_configuration()
