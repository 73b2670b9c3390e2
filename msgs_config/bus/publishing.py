"""Publishing of serialised messages."""

import time
from collections.abc import Iterable
from typing import TypeAlias

from msgs_config.bus.node import Publisher

Outgoing: TypeAlias = tuple[Publisher, bytes]
"""A serialised message and its publisher."""


def has_subscribers(publisher: Publisher) -> bool:
    """Whether anybody subscribes; what nobody hears need not be made."""
    return publisher.get_subscription_count() > 0


def publish_together(messages: Iterable[Outgoing]) -> None:
    """Publish serialised messages in a row.

    The first wakes its subscribers up, which takes longer than all else; of messages with work
    between them each would find its subscribers asleep again.
    """
    for publisher, raw in list(messages):  # all are made before the first is published
        publisher.publish(raw)


def flush(publishers: Iterable[Publisher], seconds: float) -> bool:
    """Wait until every subscriber has all that was published, at the most `seconds`; whether so."""
    deadline = time.monotonic() + seconds
    return all(each.is_acknowledged(max(deadline - time.monotonic(), 0.0)) for each in publishers)
