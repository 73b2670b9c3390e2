"""Recordings: rosbag2 directories of serialised messages, written and read without ROS' rosbag2.

What is written is version 9, stored as MCAP, as ROS 2 Jazzy's `ros2 bag record -s mcap` writes it.
"""

import json
from collections.abc import Collection, Iterator
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from rclpy.duration import Duration, Infinite
from rclpy.qos import LivelinessPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import Reader, ReaderError, StoragePlugin, Writer, WriterError

from msgs_config.errors import RecordingError, one_of

_LATEST_NS = 2**63 - 1  # rosbag2 holds times in int64
_NS_PER_S = 10**9

# The last three are what rosbags lets through when a file is damaged.
_READING_ERRORS = (ReaderError, OSError, ValueError, KeyError, OverflowError)


class BagWriter:
    """Writes serialised messages into a new rosbag2 directory.

    `close` makes the recording complete. Leaving the `with` block closes it after an error too:
    what came before an error is what explains it. For one thread only. A signal handler must not
    raise into `write` or `close`, which would leave half a record behind: let it set a flag.
    """

    def __init__(self, path: Path) -> None:
        """Create the directory `path`, and its parents.

        Raises:
            RecordingError: `path` exists already or cannot be created.
        """
        self._path = path
        self._connections: dict[str, Connection] = {}
        try:
            self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.open()
        except WriterError as error:
            raise RecordingError(
                f"recording {path} exists already; remove it or choose another directory"
            ) from error
        except OSError as error:
            raise RecordingError(f"cannot create recording {path}: {error.strerror}") from error
        self._is_open = True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        error_type: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def message_counts(self) -> dict[str, int]:
        """How many messages each topic has got so far; right after `close` as well."""
        return {name: self._writer.counts[to.id] for name, to in self._connections.items()}

    def add_topic(self, topic: str, message_type: type, qos: QoSProfile) -> None:
        """Announce a topic, with the quality of service that its publisher offers.

        Raises:
            RecordingError: The recording is closed or has the topic already, or the definition of
                the message type is not installed.
        """
        self._check_open()
        if topic in self._connections:
            raise RecordingError(f"recording {self._path} has topic '{topic}' already")
        definition = read_definition(message_type)
        self._connections[topic] = self._writer.add_connection(
            topic,
            definition.type_name,
            msgdef=definition.text,
            rihs01=definition.type_hash,
            offered_qos_profiles=[_offered(qos)],
        )

    def write(self, topic: str, raw: bytes, log_time_ns: int) -> None:
        """Append a message, serialised as CDR; `log_time_ns` is when it was published, ns.

        Raises:
            RecordingError: The recording is closed, the topic was never added, the time is out of
                range, or the disk refuses the data, which closes the recording.
        """
        self._check_open()
        if topic not in self._connections:
            raise RecordingError(one_of("topic", topic, list(self._connections)))
        if not 0 <= log_time_ns <= _LATEST_NS:
            raise RecordingError(f"log time {log_time_ns} ns is not within 0 to {_LATEST_NS} ns")
        try:
            self._writer.write(self._connections[topic], log_time_ns, raw)
        except OSError as error:
            self._abandon(error)

    def close(self) -> None:
        """Complete the recording: the rest of the messages, the index and the metadata.

        Closing again does nothing.

        Raises:
            RecordingError: The disk refuses the data.
        """
        if not self._is_open:
            return
        self._is_open = False
        try:
            self._writer.close()
        except OSError as error:
            self._abandon(error)

    def _check_open(self) -> None:
        if not self._is_open:
            raise RecordingError(f"recording {self._path} is closed")

    def _abandon(self, cause: OSError) -> None:
        """Give up the file, whose end is undefined now; it has no index and no metadata."""
        self._is_open = False
        with suppress(OSError):  # it flushes once more, to the same full disk
            self._writer.abort()
        raise RecordingError(
            f"recording {self._path} is incomplete, cannot write: {cause.strerror}"
        ) from cause


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


class MessageDefinition(NamedTuple):
    """What a reader that knows nothing of a message type needs to decode it."""

    type_name: str  # as "sensor_msgs/msg/JointState"
    text: str  # the .msg file, then the .msg files of all types in it, each below its name
    type_hash: str  # of REP 2016, "RIHS01_" and 64 hexadecimal digits


def read_definition(message_type: type) -> MessageDefinition:
    """The definition of a message type from the package that it is installed with.

    Raises:
        RecordingError: A file of the definition is not installed.
    """
    *namespace, _ = message_type.__module__.split(".")
    type_name = "/".join([*namespace, message_type.__name__])
    description = json.loads(_read_installed(type_name, ".json"))
    hashes = {entry["type_name"]: entry["hash_string"] for entry in description["type_hashes"]}
    texts = [_read_installed(type_name, ".msg")]
    for nested in description["type_description_msg"]["referenced_type_descriptions"]:
        package, _, name = nested["type_name"].split("/")
        text = _read_installed(nested["type_name"], ".msg")
        texts.append(f"{'=' * 80}\nMSG: {package}/{name}\n{text}")
    return MessageDefinition(type_name, "\n".join(texts), hashes[type_name])


def _read_installed(type_name: str, suffix: str) -> str:
    """The text of a type's file, from the `share` folder beside the package's Python code.

    The ament index would do in a full ROS install only: nothing points it to the pip wheels.
    """
    spec = find_spec(type_name.partition("/")[0])
    folders = spec.submodule_search_locations if spec else None
    for folder in folders or ():
        for prefix in Path(folder).parents:
            file = prefix / "share" / f"{type_name}{suffix}"
            if file.is_file():
                return file.read_text(encoding="utf-8")
    raise RecordingError(
        f"no definition of message type {type_name}: share/{type_name}{suffix} is not installed"
    )


def _offered(qos: QoSProfile) -> Qos:
    """The profile for rosbags; what is left open, as a publisher announces it (rosbag2 does so)."""
    return Qos(
        history=QosHistory(qos.history),
        depth=qos.depth,
        reliability=QosReliability(qos.reliability),
        durability=QosDurability(qos.durability),
        deadline=_qos_time(qos.deadline),
        lifespan=_qos_time(qos.lifespan),
        liveliness=QosLiveliness(qos.liveliness or LivelinessPolicy.AUTOMATIC),
        liveliness_lease_duration=_qos_time(qos.liveliness_lease_duration),
        avoid_ros_namespace_conventions=qos.avoid_ros_namespace_conventions,
    )


def _qos_time(duration: Duration) -> QosTime:
    return QosTime(*divmod(duration.nanoseconds or Infinite.nanoseconds, _NS_PER_S))
