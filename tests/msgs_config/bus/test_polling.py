"""A subscription whose messages are taken one by one: what it keeps, and what it says it drops."""

import pytest
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from msgs_config.bus.polling import DirectSubscription, PollingExecutor
from msgs_config.messages.cdr import decode_string
from msgs_config.messages.topic import Quality, Topic
from tests.support.ros import wait_until

DEPTH = 5


@pytest.mark.parametrize(("depth", "is_logged"), [(DEPTH, True), (1, False)])
def test_of_more_than_it_keeps_the_oldest_go_and_that_is_said_once(
    context: Context, capfd: pytest.CaptureFixture[str], depth: int, is_logged: bool
) -> None:
    # Arrange
    topic = Topic("flood", "std_msgs/msg/String", Quality(depth))
    sender, receiver = (Node(name, context=context) for name in ("speaker", "listener"))
    publisher = sender.create_publisher(String, "flood", QoSProfile(depth=100))
    subscription, spinner = DirectSubscription(receiver, topic), PollingExecutor(receiver)
    try:
        wait_until(publisher.get_subscription_count, "a listener", step=spinner.serve_pending)

        # Act: the executor takes what nobody takes from it
        for number in range(4 * DEPTH):
            publisher.publish(String(data=str(number)))
            wait_until(
                lambda number=number: newest(subscription) == number,
                f"message {number}",
                step=spinner.serve_pending,
            )

        # Assert
        texts = [int(decode_string(raw)) for raw in iter(subscription.take, None)]
    finally:
        spinner.close()
        for node in (sender, receiver):
            node.destroy_node()
    assert texts == list(range(4 * DEPTH))[-depth:]
    assert subscription.dropped == (3 * DEPTH if is_logged else 0)
    assert capfd.readouterr().err.count("the oldest are dropped") == is_logged


def newest(subscription: DirectSubscription) -> int | None:
    """The number in the newest message that waits; None if none does."""
    pending = subscription._pending
    return int(decode_string(pending[-1].raw)) if pending else None
