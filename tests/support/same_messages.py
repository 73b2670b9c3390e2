"""The messages of two bags, topic by topic, but for what wall time decides."""

import re
from pathlib import Path

from actuated_characters.bags.reader import read_messages
from msgs_config.messages import topics

_SESSION = re.compile(rb"#[0-9a-f]{12}")
_WALL_TIME = {topics.DIAGNOSTICS.name}  # once a second of it, with durations


def messages_by_topic(bag: Path) -> dict[str, list[bytes]]:
    """Of each topic the messages, which name no session; each once.

    A tick that waits is published again, and so is what is latched for who comes late: how often
    depends on how long discovery takes.
    """
    found: dict[str, list[bytes]] = {}
    for message in read_messages(bag):
        if message.topic not in _WALL_TIME:
            found.setdefault(message.topic, []).append(_SESSION.sub(b"#", message.raw))
    return {topic: list(dict.fromkeys(messages)) for topic, messages in found.items()}


def assert_same_messages(first: Path, second: Path) -> None:
    """Two bags have the same topics with the same messages in the same order."""
    one, other = messages_by_topic(first), messages_by_topic(second)
    assert one.keys() == other.keys()
    for topic, messages in one.items():
        assert messages == other[topic], topic
