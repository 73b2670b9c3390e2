"""Reads one topic for the recorder: every message once, in order; counts those that are lost."""

from collections.abc import Iterator

from rclpy.event_handler import QoSRequestedIncompatibleQoSInfo, SubscriptionEventCallbacks
from rclpy.node import Node

from actuated_characters.recorder.loss_count import LossCount
from actuated_characters.recorder.topics import RecordedTopic
from msgs_config.bus.polling import DirectSubscription


class TopicReader:
    """Takes all messages of a topic, with a queue that outlasts long pauses."""

    def __init__(self, node: Node, recorded: RecordedTopic) -> None:
        """Subscribe. Publishers whose quality of service does not fit are logged, once."""
        self._node = node
        self.recorded = recorded
        self._last_ns = 0
        self._is_refused = False
        self._subscription = DirectSubscription(
            node,
            recorded.topic.for_listener(),
            SubscriptionEventCallbacks(incompatible_qos=self._refuse, use_default_callbacks=False),
        )
        self._loss = LossCount(self._subscription.count_publishers_ever)

    @property
    def lost_messages(self) -> int:
        """How many messages never came, between those that did."""
        return self._loss.lost_messages

    def take(self, most: int) -> Iterator[tuple[int, bytes]]:
        """Yield the messages that are there, with the wall time of publishing, ns.

        No more than `most`: otherwise a publisher that is faster than this would never let it end.
        The wall clock may be set back; the times of a topic are not.
        """
        for _ in range(most):
            received = self._subscription.take_received()
            if received is None:
                break
            self._loss.take(received.number)
            self._last_ns = max(received.published_ns, self._last_ns)
            yield self._last_ns, received.raw

    def _refuse(self, info: QoSRequestedIncompatibleQoSInfo) -> None:
        if not self._is_refused:
            self._is_refused = True
            self._node.get_logger().warning(
                f"a publisher of '{self.recorded.name}' is not recorded: its QoS does not fit "
                f"({info.last_policy_kind.name})"
            )
