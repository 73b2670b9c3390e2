"""Asks controllers for the states in which their references begin, before the first state."""

import math
import time

from rclpy.node import Node

from msgs_config.errors import LayoutError, MessageError, SimulationError
from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointStateDecoder, state_in_layout
from msgs_config.messages.state import StampedState
from msgs_config.runtime.once_logger import OnceLogger
from msgs_config.runtime.polling import DirectSubscription, PollingExecutor
from msgs_config.runtime.process import StopSignal
from msgs_config.runtime.ros_parameters import declare
from sim_node.initial_state import (
    GIVEN,
    INITIAL_STATE,
    POSITION,
    VELOCITY,
    as_values,
    begins_with_reference,
    check_state,
)
from sim_node.interface.publisher_diagnosis import describe_publishers, publisher_names
from sim_node.parameters import CharacterParameters, SimulatorParameters
from sim_node.physics.simulation import Simulation
from sim_node.timing.watchdog import Watchdog, WatchdogEvent

_EXPLAIN_AFTER = 2.0  # s without the states before the node says what is missing
_REMEDY = (
    f"start controller_node with the same character, in the character's namespace, or set "
    f"'{INITIAL_STATE}' to {GIVEN}"
)


class InitialStates:
    """The initial states of a simulator's characters, as far as controllers have to say them."""

    def __init__(self, node: Node, cast: SimulatorParameters, simulation: Simulation) -> None:
        """Subscribe to the controllers of the characters that begin with their references."""
        self._node = node
        self._cast = cast
        self._simulation = simulation
        self._questions = [
            _Question(node, part) for part in cast.parts if begins_with_reference(part.values)
        ]
        open_names = {
            question.part.prefix + name
            for question in self._questions
            for name in (POSITION, VELOCITY)
        }
        self.known = tuple(p for p in cast.declared if p.name not in open_names)
        """The parameters whose values are known from the beginning."""
        self._open = [p for p in cast.declared if p.name in open_names]

    def settle(self, stop: StopSignal, spinner: PollingExecutor) -> SimulatorParameters | None:
        """Wait for the states, and begin in them; the characters with the parameters that say so.

        None if `stop` came first.

        Raises:
            SimulationError: a controller has not said in time where its reference begins.
        """
        if not self._wait(stop, spinner):
            return None
        states = {question.part.name: question.close() for question in self._questions}
        if not states:
            return self._cast
        self._simulation.begin_in(states)
        cast = self._cast.with_values({name: as_values(state) for name, state in states.items()})
        declare(self._node, self._open, cast.values)  # the node takes them as it does changes
        return cast

    def _wait(self, stop: StopSignal, spinner: PollingExecutor) -> bool:
        """Wait until every question has its answer; whether it has, or `stop` came first."""
        timeout = self._cast.values.number("initial_state_timeout")
        patience = Watchdog(math.inf, _EXPLAIN_AFTER, timeout)
        patience.restart(time.monotonic())
        while missing := [question for question in self._questions if not question.is_answered()]:
            if stop:
                return False
            spinner.rest()
            for due in patience.due(time.monotonic()):
                sentence = "; ".join(question.describe() for question in missing)
                if due is WatchdogEvent.TIMEOUT:
                    raise SimulationError(
                        f"no initial state within {timeout:g} s; {sentence}; {_REMEDY}"
                    )
                self._node.get_logger().warning(f"waiting for the initial state; {sentence}")
        return True


class _Question:
    """In which state one character's reference begins."""

    def __init__(self, node: Node, part: CharacterParameters) -> None:
        self.part = part
        self._node = node
        self._topic = topics.INITIAL_STATE.of(topics.CONTROLLER_NODE).under(part.name)
        self._of = f" of '{part.name}'" if part.name else ""
        self._once_logger = OnceLogger(node)
        self._decoder = JointStateDecoder()
        self._messages = DirectSubscription(node, self._topic)
        self._contested = False
        self._rejection = ""
        self._state: StampedState | None = None

    def is_answered(self) -> bool:
        """Whether one controller, and no other, has said a state; the last one that it said counts.

        A message does not tell its publisher. So where there were several, whatever they said is
        left, and the one that remains is asked again.
        """
        if self._node.count_publishers(self._topic.name) > 1:
            self._contested, self._state = True, None
        elif self._contested:
            self._contested = False
            self._messages.close()
            self._messages = DirectSubscription(self._node, self._topic)
        elif (raw := self._messages.take()) is not None:
            self._take(raw)
        return self._state is not None

    def _take(self, raw: bytes) -> None:
        self._state, self._rejection = None, ""
        try:
            state = state_in_layout(self.part.character.layout, self._decoder.decode(raw))
            check_state(self.part.character, state, self.part.values.number("speed_limit"))
        except (MessageError, LayoutError) as error:
            self._rejection = f"initial state{self._of} rejected: {error}"
            self._once_logger.log_once(self._rejection)
            return
        self._state = state

    def describe(self) -> str:
        """Why there is no answer."""
        if self._contested:
            nodes = ", ".join(publisher_names(self._node, self._topic))
            return f"several controllers publish on '{self._topic.name}': {nodes}; one must remain"
        return self._rejection or describe_publishers(self._node, self._topic)

    def close(self) -> StampedState:
        """End the subscription; the answer."""
        self._messages.close()
        assert self._state is not None
        return self._state
