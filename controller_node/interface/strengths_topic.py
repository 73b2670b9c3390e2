"""Strengths of joints that come over a topic."""

from rclpy.node import Node
from sensor_msgs.msg import JointState

from controller_node.controller import Controller
from controller_node.interface.publishers import Publishers
from controller_node.interface.stamped_message import decode_stamped
from controller_node.strength import strengths_of
from msgs_config.messages import topics
from msgs_config.runtime.once_logger import OnceLogger
from msgs_config.runtime.stamped_subscription import StampedSubscription


class StrengthTopic:
    """Takes `~/strength`, each message before the answer to a state, and says which it took."""

    def __init__(
        self, node: Node, controller: Controller, outputs: Publishers, logger: OnceLogger
    ) -> None:
        self._controller = controller
        self._outputs = outputs
        self._messages = StampedSubscription(node, topics.STRENGTH, "refused ", self._use, logger)
        self._now_ns = self._episode_ns = 0

    @property
    def refused(self) -> int:
        """How many were refused."""
        return self._messages.rejected

    def take(self, state_ns: int, episode_ns: int) -> None:
        """Take what has come before the answer to the state of a stamp, ns.

        One without a stamp counts from this state on, one with a stamp from its tick on. One that
        is wrong is refused whole, and what was in force goes on.
        """
        self._now_ns, self._episode_ns = state_ns, episode_ns
        self._messages.take()

    def _use(self, raw: bytes) -> None:
        message, start_ns = decode_stamped(raw, JointState, "strength", self._now_ns)
        layout, clock = self._controller.layout, self._controller.clock
        start_ns = clock.stamp_ns(clock.first_tick_from(start_ns))
        strengths = strengths_of(layout, tuple(message.name), tuple(message.effort), start_ns)
        self._controller.set_strengths(strengths, episode_ns=self._episode_ns)
        self._outputs.publish_strengths(strengths)
