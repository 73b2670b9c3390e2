"""Writes recordings: rosbag2 directories of serialised messages, without ROS' rosbag2.

They are of version 9 with one MCAP file, as ROS 2 Jazzy's `ros2 bag record` writes them.
"""

import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Self, TypeVar

from mcap.writer import CompressionType, Writer
from rosbags.interfaces import Qos
from rosbags.rosbag2.metadata import dump_qos_v9

from actuated_characters.bags.directory_lock import DirectoryLock
from actuated_characters.bags.format.definitions import MessageDefinition, read_definition
from actuated_characters.bags.format.metadata import write_metadata
from actuated_characters.bags.format.offered_qos import offered_qos
from actuated_characters.bags.format.storage import (
    CDR,
    COMPRESSIONS,
    LATEST_NS,
    LOG_TIME,
    LOG_TIMES,
    MCAP,
    NONE,
    OFFERED_QOS,
    ROS_DISTRO,
    SIMULATED,
    SUFFIXES,
    TYPE_HASH,
    WALL,
    ZSTD,
    reason,
)
from msgs_config.errors import ConfigurationError, RecordingError, one_of
from msgs_config.files import dump_yaml
from msgs_config.messages.topic import Quality

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

_COMPRESSIONS = {NONE: CompressionType.NONE, ZSTD: CompressionType.ZSTD}
_VERSION = 9  # version of rosbag2's metadata
_NUMBERS = 1 << 32  # how many numbers MCAP has for a topic's messages
_T = TypeVar("_T")


class BagWriter:
    """Writes serialised messages into a new rosbag2 directory.

    `close` makes the recording complete. Leaving the `with` block closes it after an error too:
    the messages before an error are those that explain it. For one thread only. A signal handler
    must not raise into `write` or `close`, which would leave half a record: let it set a flag.
    """

    def __init__(self, path: Path, *, compression: str = NONE, log_time: str = WALL) -> None:
        """Create the directory `path`, and its parents; nothing stays of it where that fails.

        Args:
            path: Where the recording goes.
            compression: `none` or `zstd`, of the file's chunks: half the size.
            log_time: `wall` or `simulated`, the clock of the log times; the bag names the latter.

        Raises:
            ConfigurationError: There is no such compression or log time.
            RecordingError: `path` exists already or cannot be created.
        """
        _check_choice("compression", compression, COMPRESSIONS)
        _check_choice("log time", log_time, LOG_TIMES)
        self.path = path
        self._is_simulated = log_time == SIMULATED
        self._custom_data = {LOG_TIME: SIMULATED} if self._is_simulated else {}
        self._schemas: dict[str, int] = {}  # by the type's name
        self._channels: dict[str, int] = {}  # by topic
        self._topics: list[dict[str, object]] = []  # the metadata's entries
        self._counts = Counter[str]()
        self._span_ns = (LATEST_NS, 0)  # first and last log time
        try:
            self._open(_COMPRESSIONS[compression])
        except FileExistsError as error:
            raise RecordingError(
                f"recording {path} exists already; remove it or choose another directory"
            ) from error
        except OSError as error:
            raise RecordingError(f"cannot create recording {path}: {reason(error)}") from error
        self._is_open = True

    def _open(self, compression: CompressionType) -> None:
        self.path.mkdir(parents=True)
        with ExitStack() as failed:
            failed.callback(shutil.rmtree, self.path, ignore_errors=True)  # the directory is new
            self._file = (self.path / f"{self.path.name}{SUFFIXES[MCAP]}").open("wb")
            failed.callback(_close, self._file)
            self._writer = Writer(self._file, compression=compression)
            self._writer.start("ros2", "actuated_characters")
            self._file.flush()
            self._lock = DirectoryLock(self.path)  # keeps a recovery out meanwhile
            failed.pop_all()

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
        self._custom_data[name] = text

    def add_topic(self, topic: str, type_name: str, offered: "Quality | QoSProfile") -> None:
        """Announce a topic of a type such as `std_msgs/msg/String`, and how it is published.

        Raises:
            RecordingError: The recording is closed or has the topic already, the definition of
                the message type is not installed, or the disk refuses the data.
        """
        self._check_new(topic)
        self.announce(topic, read_definition(type_name), [offered_qos(offered)])

    def announce(self, topic: str, definition: MessageDefinition, offered: Sequence[Qos]) -> None:
        """Announce a topic of a type that need not be installed. Raises as `add_topic`."""
        self._check_new(topic)
        name, profiles = definition.type_name, dump_qos_v9(list(offered))
        if name not in self._schemas:
            text = definition.text.encode()
            self._schemas[name] = self._attempt(self._writer.register_schema, name, "ros2msg", text)
        metadata = {
            OFFERED_QOS: dump_yaml(profiles).strip(),
            TYPE_HASH: definition.type_hash,
        }
        if self._is_simulated:
            metadata[LOG_TIME] = SIMULATED
        self._channels[topic] = self._attempt(
            self._writer.register_channel, topic, CDR, self._schemas[name], metadata
        )
        self._topics.append(
            {
                "name": topic,
                "type": name,
                "serialization_format": CDR,
                "offered_qos_profiles": profiles,
                "type_description_hash": definition.type_hash,
            }
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
            published_ns: Wall time of that, ns; None: the log time.
            number: Of the messages of its topic; None: counted from 1 on.

        Raises:
            RecordingError: The recording is closed, the topic was never added, the time is out of
                range, or the disk refuses the data, which closes the recording.
        """
        self._check_open()
        if topic not in self._channels:
            raise RecordingError(one_of("topic", topic, list(self._channels)))
        published_ns = log_time_ns if published_ns is None else published_ns
        for what, time_ns in (("log time", log_time_ns), ("time of publishing", published_ns)):
            if not 0 <= time_ns <= LATEST_NS:
                raise RecordingError(f"{what} {time_ns} ns is not within 0 to {LATEST_NS} ns")
        count = self._counts[topic] = self._counts[topic] + 1
        first_ns, last_ns = self._span_ns
        self._span_ns = min(first_ns, log_time_ns), max(last_ns, log_time_ns)
        channel, sequence = self._channels[topic], (number or count) % _NUMBERS
        self._attempt(self._writer.add_message, channel, log_time_ns, raw, published_ns, sequence)

    def flush(self) -> None:
        """Hand all that was written to the operating system.

        Flushed data outlives this process, however that ends: `info BAG --recover` makes
        a recording of it. Without it a killed recorder loses up to the last MiB.

        Raises:
            RecordingError: The recording is closed, or the disk refuses the data, which closes it.
        """
        self._check_open()
        self._attempt(self._writer.flush)

    def close(self) -> None:
        """Complete the recording: the rest of the messages, the index and the metadata.

        Closing again does nothing.

        Raises:
            RecordingError: The disk refuses the data.
        """
        if self._is_open:
            self._is_open = False
            try:
                self._attempt(self._finish)
            finally:
                self._lock.release()

    def _finish(self) -> None:
        content = self._information()
        text = dump_yaml(content)
        self._writer.flush()  # the messages come before the metadata
        self._writer.add_metadata("rosbag2", {"serialized_metadata": text})
        self._writer.finish()
        self._file.close()
        write_metadata(self.path, content)

    def _information(self) -> dict[str, object]:
        """What rosbag2's metadata says, but for its outermost key."""
        (first_ns, last_ns), file = self._span_ns, Path(self._file.name).name
        span: dict[str, object] = {
            "starting_time": {"nanoseconds_since_epoch": first_ns},
            "duration": {"nanoseconds": max(last_ns - first_ns, 0)},
            "message_count": self._counts.total(),
        }
        return {
            "version": _VERSION,
            "storage_identifier": MCAP,
            **span,
            "topics_with_message_count": [
                {"topic_metadata": topic, "message_count": self._counts[str(topic["name"])]}
                for topic in self._topics
            ],
            "compression_format": "",  # neither the whole file nor each message is compressed
            "compression_mode": "",
            "relative_file_paths": [file],
            "files": [{"path": file, **span}],
            "custom_data": self._custom_data or None,
            "ros_distro": os.environ.get("ROS_DISTRO", "").strip() or ROS_DISTRO,
        }

    def _check_open(self) -> None:
        if not self._is_open:
            raise RecordingError(f"recording {self.path} is closed")

    def _check_new(self, topic: str) -> None:
        self._check_open()
        if topic in self._channels:
            raise RecordingError(f"recording {self.path} has topic '{topic}' already")

    def _attempt(self, act: Callable[..., _T], *arguments: Any) -> _T:
        """Write, or give up the file, whose end is undefined then: without index and metadata."""
        try:
            return act(*arguments)
        except OSError as error:
            self._is_open = False
            _close(self._file)
            self._lock.release()
            raise RecordingError(
                f"recording {self.path} is incomplete, cannot write: {reason(error)}"
            ) from error


def _close(file: BinaryIO) -> None:
    """Close a file that is given up: it flushes once more, maybe to the same full disk."""
    with suppress(OSError):
        file.close()


def _check_choice(what: str, value: str, choices: Iterable[str]) -> None:
    if value not in choices:
        raise ConfigurationError(one_of(what, value, list(choices)))
