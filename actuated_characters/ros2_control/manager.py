"""A controller manager as the bridge sees it: told states and the time, asked for commands."""

import math
import time
from collections.abc import Generator, Iterator, Sequence

import numpy as np

from actuated_characters.ros2_control.commands import JointCommand, command_in_layout
from actuated_characters.ros2_control.fence import Fence
from msgs_config.bus.composition import AT_ONCE, UNTIL_A_MESSAGE
from msgs_config.bus.node import BusNode, Executor
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.character.layout import JointLayout
from msgs_config.errors import LayoutError, MessageError
from msgs_config.messages import topics
from msgs_config.messages.cdr import encode_clock
from msgs_config.messages.joint_state import JointStateDecoder, JointStateEncoder
from msgs_config.messages.state import StampedState

Exchange = Generator[float, None, JointCommand | None]
"""Turns in which a command is waited for."""

_REPEAT_PERIOD = 0.5  # s of wall time: a best-effort reader may have lost the state or the clock
_EXPLAIN_AFTER = 4  # repetitions after which a user should read what is waited for
_FENCE_REST = 5e-5  # s between looks at a fence


class ControllerManager:
    """Publishes states and the clock, and pairs commands with them by their order.

    A controller manager updates once when the clock has moved on by its period, reads the last
    state that has come, and sends one command, with a stamp of whatever clock. So what comes after
    the clock has moved answers the state before.
    """

    def __init__(
        self,
        node: BusNode,
        layout: JointLayout,
        joints: Sequence[str],
        fence: Fence | None,
        logger: OnceLogger,
    ) -> None:
        """Offer the topics of these joints; without a fence states may be taken too late."""
        self._node, self._layout, self._fence, self._logger = node, layout, fence, logger
        self._entries = layout.indices(tuple(joints))
        self._encoder, self._decoder = JointStateEncoder(joints), JointStateDecoder()
        self._states = node.publisher(topics.ROBOT_JOINT_STATES)
        self._clock = node.publisher(topics.CLOCK)
        self._commands = node.subscription(topics.ROBOT_JOINT_COMMANDS)
        self.unasked = 0
        """Commands that came while none was asked for, and are not taken."""

    def exchange(
        self, time_ns: int, state: StampedState, executor: Executor, patience: float = math.inf
    ) -> Exchange:
        """Let it update from a state, at a time of its clock (ns); returns what it commands.

        None if it commands nothing within `patience`, s of wall time. A fence that is not there is
        not waited for.
        """
        until = time.monotonic() + patience
        self._publish_state(time_ns, state)
        yield from self._pass_fence(executor)
        self._discard()
        repetitions, repeat_at = 0, 0.0
        while (command := self._take()) is None:
            now = time.monotonic()
            if repetitions and now >= until:
                return None
            if now >= repeat_at:
                if repetitions:
                    self._publish_state(time_ns, state)
                self._clock.publish(encode_clock(time_ns))
                repetitions, repeat_at = repetitions + 1, now + _REPEAT_PERIOD
                if repetitions == _EXPLAIN_AFTER:
                    self._explain(time_ns)
            yield UNTIL_A_MESSAGE
        executor.received()
        return command

    def _publish_state(self, time_ns: int, state: StampedState) -> None:
        effort = np.zeros(self._layout.size) if state.effort is None else state.effort
        arrays = (values[self._entries] for values in (state.position, state.velocity, effort))
        self._states.publish(self._encoder.encode(time_ns, *arrays))

    def _pass_fence(self, executor: Executor) -> Iterator[float]:
        if self._fence is None or not self._fence.is_there:
            return
        repeat_at = 0.0
        while not self._fence.is_passed or not repeat_at:
            if time.monotonic() >= repeat_at:
                self._fence.raise_again()
                repeat_at = time.monotonic() + _REPEAT_PERIOD
            executor.serve_pending()
            if not self._fence.is_passed:
                if not self._fence.is_there:
                    return
                time.sleep(_FENCE_REST)
                yield AT_ONCE

    def _discard(self) -> None:
        while self._commands.take() is not None:
            self.unasked += 1

    def _take(self) -> JointCommand | None:
        raw = self._commands.take()
        if raw is None:
            return None
        try:
            return command_in_layout(self._layout, self._decoder.decode(raw))
        except (MessageError, LayoutError) as error:
            self._logger.log_once(f"command of the controller manager ignored: {error}")
            return None

    def _explain(self, time_ns: int) -> None:
        name = self._node.resolve_topic_name(topics.ROBOT_JOINT_COMMANDS.name)
        there = self._node.count_publishers(name)
        why = "nobody publishes it; is the controller manager running?"
        if there:
            why = "its hardware must be active, its use_sim_time true, its update_rate as here"
        self._logger.log_once(
            f"waiting for a command on '{name}' at {time_ns / 1e9:g} s of its clock; {why}",
            kind="waiting",
        )
