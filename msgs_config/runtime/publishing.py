"""Publishers on the topics of the contract, of serialised messages."""

import time
from collections.abc import Iterable
from typing import TypeAlias

from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher

from msgs_config.messages.topic import Topic

Outgoing: TypeAlias = tuple[Publisher, bytes]
"""A serialised message and its publisher."""


def create_publisher(node: Node, topic: Topic) -> Publisher:
    """A node's publisher on a topic of the contract."""
    return node.create_publisher(
        topic.message_type,
        topic.name,
        topic.qos,
        # each default callback is one thing more that the executor looks at in each turn
        event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
    )


def has_subscribers(publisher: Publisher) -> bool:
    """Whether anybody subscribes; asked at every tick, so without rclpy's guard of the handle."""
    return bool(publisher.handle.get_subscription_count())


def publish_together(messages: Iterable[Outgoing]) -> None:
    """Publish serialised messages in a row.

    The first wakes its subscribers up, which takes longer than all else; of messages with work
    between them each would find its subscribers asleep again.
    """
    for publisher, raw in list(messages):  # all are made before the first is published
        publisher.handle.publish_raw(raw)


def flush(publishers: Iterable[Publisher], seconds: float) -> bool:
    """Wait until every subscriber has all that was published, at the most `seconds`; whether so."""
    deadline = time.monotonic() + seconds
    return all(
        publisher.wait_for_all_acked(Duration(seconds=max(deadline - time.monotonic(), 0.0)))
        for publisher in publishers
    )
