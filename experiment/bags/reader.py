"""Reads recordings: rosbag2 directories of serialised messages, without ROS' rosbag2."""

from collections.abc import Collection, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from rclpy.serialization import deserialize_message
from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader, ReaderError

from msgs_config.errors import RecordingError, one_of

# The last three are what rosbags lets through when a file is damaged.
_READING_ERRORS = (ReaderError, OSError, ValueError, KeyError, OverflowError)


class RecordedMessage(NamedTuple):
    """A message of a recording, serialised as it was received."""

    topic: str
    log_time_ns: int
    raw: bytes
    type_name: str  # as "sensor_msgs/msg/JointState"

    def decode(self) -> Any:
        """The message as an object of its ROS class.

        Raises:
            RecordingError: The class is not installed, or the bytes are no such message.
        """
        try:
            return deserialize_message(self.raw, _message_class(self.type_name))
        except (ImportError, AttributeError) as error:
            raise RecordingError(f"message type {self.type_name} is not installed") from error
        except RuntimeError as error:
            raise RecordingError(
                f"message on '{self.topic}' at {self.log_time_ns} ns is no {self.type_name}"
            ) from error


def read_messages(path: Path, topics: Collection[str] | None = None) -> Iterator[RecordedMessage]:
    """Yield the messages of a rosbag2 directory, or those of `topics` only.

    They come in the order of their log times, those of equal time as they were written.

    Raises:
        RecordingError: There is no complete recording at `path`, or it has none of a topic's name.
    """
    if not (path / "metadata.yaml").is_file():  # as a recorder leaves it that was killed
        raise RecordingError(f"no complete recording at {path}: it has no metadata.yaml")
    try:
        with Reader(path) as reader:
            connections = _select(reader.connections, topics)
            if not connections:  # to rosbags an empty selection means everything
                return
            for connection, log_time_ns, raw in reader.messages(connections):
                yield RecordedMessage(connection.topic, log_time_ns, raw, connection.msgtype)
    except _READING_ERRORS as error:
        raise RecordingError(f"cannot read recording {path}: {error}") from error


def _select(connections: list[Connection], topics: Collection[str] | None) -> list[Connection]:
    if topics is None:
        return connections
    recorded = {connection.topic for connection in connections}
    for topic in topics:
        if topic not in recorded:
            raise RecordingError(one_of("topic", topic, sorted(recorded)))
    return [connection for connection in connections if connection.topic in topics]


@cache
def _message_class(type_name: str) -> Any:
    *module, name = type_name.split("/")
    return getattr(import_module(".".join(module)), name)
