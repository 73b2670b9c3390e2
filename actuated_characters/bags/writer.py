"""Writes recordings: rosbag2 directories of serialised messages, without ROS' rosbag2.

They are of version 9, as ROS 2 Jazzy's `ros2 bag record` writes them; rosbags writes the files.
"""

import shutil
import sqlite3
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Self, TypeVar

from rclpy.duration import Duration, Infinite
from rclpy.qos import LivelinessPolicy, QoSProfile
from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, WriterError

from actuated_characters.bags.directory_lock import DirectoryLock
from actuated_characters.bags.format.definitions import MessageDefinition, read_definition
from actuated_characters.bags.format.rosbags_storage import McapStorage, RosbagWriter, SqliteStorage
from actuated_characters.bags.format.storage import (
    COMPRESSIONS,
    LATEST_NS,
    LOG_TIME,
    LOG_TIMES,
    MCAP,
    NONE,
    SIMULATED,
    SQLITE3,
    STORAGES,
    WALL,
    ZSTD,
    reason,
)
from msgs_config.errors import ConfigurationError, RecordingError, one_of

_PLUGINS = {MCAP: StoragePlugin.MCAP, SQLITE3: StoragePlugin.SQLITE3}
_MODES = {MCAP: CompressionMode.STORAGE, SQLITE3: CompressionMode.MESSAGE}
_DISK_ERRORS = (OSError, sqlite3.Error)  # raised by a write to a disk that is full or gone
_NS_PER_S = 10**9
_T = TypeVar("_T")


class BagWriter:
    """Writes serialised messages into a new rosbag2 directory.

    `close` makes the recording complete. Leaving the `with` block closes it after an error too:
    the messages before an error are those that explain it. For one thread only. A signal handler
    must not raise into `write` or `close`, which would leave half a record: let it set a flag.
    """

    def __init__(
        self, path: Path, *, storage: str = MCAP, compression: str = NONE, log_time: str = WALL
    ) -> None:
        """Create the directory `path`, and its parents; nothing stays of it where that fails.

        Args:
            path: Where the recording goes.
            storage: `mcap`, or `sqlite3` as ROS 2 Humble has it by default.
            compression: `none` or `zstd`, of MCAP's chunks or of each message: half the size.
            log_time: `wall` or `simulated`, the clock of the log times; the bag names the latter.

        Raises:
            ConfigurationError: There is no such storage, compression or log time.
            RecordingError: `path` exists already or cannot be created.
        """
        _check_choice("storage", storage, STORAGES)
        _check_choice("compression", compression, COMPRESSIONS)
        _check_choice("log time", log_time, LOG_TIMES)
        wrong = next((character for character in "?#%" if character in str(path)), None)
        if storage == SQLITE3 and wrong is not None:  # SQLite takes it for a part of a URI
            raise RecordingError(
                f"recording {path}: storage sqlite3 allows no '{wrong}' in its path"
            )
        self.path = path
        self._connections: dict[str, Connection] = {}
        try:
            self._writer = RosbagWriter(path, version=9, storage_plugin=_PLUGINS[storage])
            if log_time == SIMULATED:
                self._writer.set_custom_data(LOG_TIME, SIMULATED)
            if compression == ZSTD:
                self._writer.set_compression(_MODES[storage], CompressionFormat.ZSTD)
            self._open()
        except WriterError as error:
            raise RecordingError(
                f"recording {path} exists already; remove it or choose another directory"
            ) from error
        except _DISK_ERRORS as error:
            raise RecordingError(f"cannot create recording {path}: {reason(error)}") from error
        self._is_open = True

    def _open(self) -> None:
        try:
            self._writer.open()
            self._lock = DirectoryLock(self.path)  # against a recovery meanwhile
        except _DISK_ERRORS:
            with suppress(*_DISK_ERRORS):
                self._writer.abort()
            shutil.rmtree(self.path, ignore_errors=True)  # it was not there before
            raise
        self._storage = self._writer.storage
        self._mcap = self._storage if isinstance(self._storage, McapStorage) else None
        if self._mcap is not None:
            self._mcap.has_simulated_log_time = LOG_TIME in self._writer.custom_data

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def set_custom_data(self, name: str, text: str) -> None:
        """Keep a text in the metadata, which `close` writes, as rosbag2's custom data.

        Raises:
            RecordingError: The recording is closed.
        """
        self._check_open()
        self._writer.set_custom_data(name, text)

    def add_topic(self, topic: str, message_type: type, qos: QoSProfile) -> None:
        """Announce a topic, with the quality of service that its publisher offers.

        Raises:
            RecordingError: The recording is closed or has the topic already, the definition of
                the message type is not installed, or the disk refuses the data.
        """
        self._check_new(topic)
        self.announce(topic, read_definition(message_type), [_offered(qos)])

    def announce(self, topic: str, definition: MessageDefinition, offered: Sequence[Qos]) -> None:
        """Announce a topic of a type that need not be installed. Raises as `add_topic`."""
        self._check_new(topic)
        self._connections[topic] = self._attempt(
            self._writer.add_connection,
            topic,
            definition.type_name,
            msgdef=definition.text,
            rihs01=definition.type_hash,
            offered_qos_profiles=offered,
        )

    def write(
        self,
        topic: str,
        raw: bytes,
        log_time_ns: int,
        published_ns: int | None = None,
        number: int | None = None,
    ) -> None:
        """Append a message, serialised as CDR.

        Args:
            topic: Its topic, which was added.
            raw: The message.
            log_time_ns: When it was published, by the clock of the bag's log times, ns.
            published_ns: Wall time of that, ns; None: the log time. SQLite has no place for it.
            number: Of the messages of its topic, in MCAP; None: counted from 1 on.

        Raises:
            RecordingError: The recording is closed, the topic was never added, the time is out of
                range, or the disk refuses the data, which closes the recording.
        """
        self._check_open()
        if topic not in self._connections:
            raise RecordingError(one_of("topic", topic, list(self._connections)))
        if not 0 <= log_time_ns <= LATEST_NS:
            raise RecordingError(f"log time {log_time_ns} ns is not within 0 to {LATEST_NS} ns")
        if self._mcap is not None:
            if published_ns is None:
                published_ns = log_time_ns
            elif not 0 <= published_ns <= LATEST_NS:
                raise RecordingError(
                    f"time of publishing {published_ns} ns is not within 0 to {LATEST_NS} ns"
                )
            self._mcap.describe_next(published_ns, number)
        self._attempt(self._writer.write, self._connections[topic], log_time_ns, raw)

    def flush(self) -> None:
        """Hand all that was written to the operating system.

        Flushed data outlives this process, however that ends: `actuated_characters recover` makes
        a recording of MCAP's, and SQLite's file can be read alone. Without it a killed recorder
        loses up to the last MiB of MCAP, and all of SQLite.

        Raises:
            RecordingError: The recording is closed, or the disk refuses the data, which closes it.
        """
        self._check_open()
        assert isinstance(self._storage, McapStorage | SqliteStorage)
        self._attempt(self._storage.flush)

    def close(self) -> None:
        """Complete the recording: the rest of the messages, the index and the metadata.

        Closing again does nothing.

        Raises:
            RecordingError: The disk refuses the data.
        """
        if self._is_open:
            self._is_open = False
            try:
                self._attempt(self._writer.close)
            finally:
                self._lock.release()

    def _check_open(self) -> None:
        if not self._is_open:
            raise RecordingError(f"recording {self.path} is closed")

    def _check_new(self, topic: str) -> None:
        self._check_open()
        if topic in self._connections:
            raise RecordingError(f"recording {self.path} has topic '{topic}' already")

    def _attempt(self, act: Callable[..., _T], *arguments: Any, **options: Any) -> _T:
        """Write, or give up the file, whose end is undefined then: without index and metadata."""
        try:
            return act(*arguments, **options)
        except _DISK_ERRORS as error:
            self._is_open = False
            with suppress(*_DISK_ERRORS):  # it flushes once more, to the same full disk
                self._writer.abort()
            self._lock.release()
            raise RecordingError(
                f"recording {self.path} is incomplete, cannot write: {reason(error)}"
            ) from error


def _check_choice(what: str, value: str, choices: Iterable[str]) -> None:
    if value not in choices:
        raise ConfigurationError(one_of(what, value, list(choices)))


def _offered(qos: QoSProfile) -> Qos:
    """The profile for rosbags; open values are those that a publisher announces, as in rosbag2."""
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
