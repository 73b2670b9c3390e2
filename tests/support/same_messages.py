"""The messages of two bags, topic by topic, but for what wall time decides."""

import re
from pathlib import Path

from actuated_characters.bags.reader import read_messages
from msgs_config.messages import topics

_SESSION = re.compile(rb"#[0-9a-f]{12}")
_ONCE_A_SECOND = f"/{topics.DIAGNOSTICS.name.lstrip('/')}"  # of wall time, with durations
_SHOWN_AGAIN = (
    f"/{topics.VISUALIZATION.name}"  # of any character, while a tick waits, also one of no sample
)


def messages_by_topic(bag: Path) -> dict[str, list[bytes]]:
    """Of each topic the messages, which name no session; each once.

    A tick that waits is published again, and so is what is latched for who comes late: how often
    depends on how long discovery takes.
    """
    found: dict[str, list[bytes]] = {}
    for message in read_messages(bag):
        if message.topic != _ONCE_A_SECOND:
            found.setdefault(message.topic, []).append(_SESSION.sub(b"#", message.raw))
    return {topic: list(dict.fromkeys(messages)) for topic, messages in found.items()}


def assert_same_messages(alone: Path, sent: Path) -> None:
    """The bag of a run in one process has what that of a run over topics has, in that order."""
    one, other = messages_by_topic(alone), messages_by_topic(sent)
    assert one.keys() == other.keys()
    for topic, messages in one.items():
        found, shown = other[topic], set(messages)
        if topic.endswith(_SHOWN_AGAIN):
            found = [raw for raw in found if raw in shown]
        assert messages == found, topic
