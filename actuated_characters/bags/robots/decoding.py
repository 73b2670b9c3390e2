"""Decodes messages of any ROS 2 robot, also of types that are not installed here, such as tf2's."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from actuated_characters.bags.reader import RecordedMessage, read_messages
from msgs_config.errors import MessageError, RecordingError
from msgs_config.messages import typed


class Timed(NamedTuple):
    """A decoded message with when it was logged."""

    content: Any
    log_time_ns: int
    published_ns: int | None  # wall time; None where only a simulated log time is known


def decode(message: RecordedMessage) -> Any:
    """A message with the fields of its type.

    Raises:
        RecordingError: the type is not one of ROS' own, or the bytes are no such message.
    """
    try:
        return typed.decode(message.raw, message.type_name)
    except MessageError as error:
        raise RecordingError(
            f"message on '{message.topic}' at {message.log_time_ns} ns is no {message.type_name}"
        ) from error


def read_timed(bag: Path, topic: str) -> Iterator[Timed]:
    """The messages of one topic of a bag by log time.

    Raises:
        RecordingError: the bag cannot be read, or a message is not of its topic's type.
    """
    for message in read_messages(bag, [topic]):
        yield Timed(decode(message), message.log_time_ns, message.published_ns)


def stamp_ns(header: Any) -> int:
    """The stamp of a message's header, ns; 0 where its sender has set none."""
    return typed.nanoseconds(header.stamp)
