"""Reads recordings: rosbag2 directories of serialised messages, without ROS' rosbag2."""

import heapq
import shutil
import tempfile
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from rclpy.serialization import deserialize_message
from rosbags.interfaces import Connection, ConnectionExtRosbag2
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.reader import zstd  # type: ignore[attr-defined]  # the one that it found
from rosbags.rosbag2.storage_mcap import McapReader

from experiment.bags.mcap_records import McapRecords
from experiment.bags.metadata import CDR, FILE, MESSAGE, BagMetadata, read_metadata, recover_hint
from experiment.bags.storage import SQLITE3, SUFFIXES, ZSTD_MAGIC, check_sqlite_path, reason
from msgs_config.errors import RecordingError, one_of

_ZSTD_SUFFIX = ".zstd"


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
    """Yield the messages of a recording, or those of `topics` only.

    They come in the order of their log times, those of equal time as they were written.

    Args:
        path: A rosbag2 directory, or a single .mcap or .db3 file that is complete.
        topics: Names as they are in the recording.

    Raises:
        RecordingError: There is no complete recording at `path`, or it has none of a topic's name.
    """
    with ExitStack() as stack:
        try:
            yield from _messages(path, topics, stack)
        except RecordingError:
            raise
        except Exception as error:  # of a damaged file rosbags and its libraries raise anything
            raise RecordingError(
                f"cannot read recording {path}: {reason(error)}{_hint(path)}"
            ) from error


def _hint(path: Path) -> str:
    """What may help with a bag that cannot be read; of a file alone it would not."""
    return "" if path.is_file() else f"; {recover_hint(path, 'keeps what is whole of it')}"


def _messages(
    path: Path, topics: Collection[str] | None, stack: ExitStack
) -> Iterator[RecordedMessage]:
    metadata = BagMetadata((path,), (), "") if path.is_file() else read_metadata(path)
    readers = [_open(path, file, metadata, stack) for file in metadata.files]
    _check_topics(topics, readers, metadata)
    unpack: Callable[[bytes], bytes] = _unpacked if path.is_file() else bytes
    if metadata.compression_mode == MESSAGE:
        unpack = zstd.decompress
    streams = [_in_order(reader, topics) for reader in readers]
    if len(streams) == 1:
        merged = streams[0]
    else:
        merged = heapq.merge(*streams, key=lambda message: message.log_time_ns)
    for topic, log_time_ns, raw, type_name in merged:
        yield RecordedMessage(topic, log_time_ns, unpack(raw), type_name)


def _open(path: Path, file: Path, metadata: BagMetadata, stack: ExitStack) -> Reader:
    """A file of a recording, decompressed if need be."""
    if not file.is_file():
        raise RecordingError(f"cannot read recording {path}: its file {file.name} is missing")
    if metadata.compression_mode == FILE and file.suffix == _ZSTD_SUFFIX:
        file = _decompressed(file, Path(stack.enter_context(tempfile.TemporaryDirectory())))
    if file.suffix not in SUFFIXES.values():
        raise RecordingError(f"cannot read recording {path}: {file.name} is no .mcap or .db3 file")
    if file.suffix == SUFFIXES[SQLITE3]:
        check_sqlite_path(file, SQLITE3)
        for journal in (file.with_name(file.name + end) for end in ("-journal", "-wal")):
            if journal.is_file() and journal.stat().st_size > 0:  # what rosbags would not look at
                raise RecordingError(
                    f"cannot read recording {path}: {file.name} was never closed, a journal lies "
                    f"beside it; {recover_hint(path, 'makes it whole')}"
                )
    reader: Reader = stack.enter_context(Reader(file))
    for connection in reader.connections:
        extension = connection.ext
        assert isinstance(extension, ConnectionExtRosbag2)
        if extension.serialization_format != CDR:
            raise RecordingError(
                f"cannot read recording {path}: '{connection.topic}' is serialised as "
                f"{extension.serialization_format}, not as {CDR}"
            )
    return reader


def _unpacked(raw: bytes) -> bytes:
    """A message of a file without metadata, which would say whether each is compressed."""
    unpacked: bytes = zstd.decompress(raw) if raw.startswith(ZSTD_MAGIC) else raw
    return unpacked


def _decompressed(file: Path, directory: Path) -> Path:
    """A copy of a file that was compressed as a whole."""
    copy = directory / file.stem
    with zstd.open(file, "rb") as source, copy.open("wb") as sink:
        shutil.copyfileobj(source, sink)
    return copy


def _check_topics(
    topics: Collection[str] | None, readers: list[Reader], metadata: BagMetadata
) -> None:
    recorded = {connection.topic for reader in readers for connection in reader.connections}
    recorded |= set(metadata.topics)
    for topic in topics or ():
        if topic not in recorded:
            raise RecordingError(one_of("topic", topic, sorted(recorded)))


def _in_order(reader: Reader, topics: Collection[str] | None) -> Iterator[RecordedMessage]:
    """The messages of one file by log time."""
    chosen = [each for each in reader.connections if topics is None or each.topic in topics]
    if not chosen:  # to rosbags an empty selection means everything
        return
    if _is_unindexed(reader):
        yield from _sorted(Path(str(reader.path)), chosen)
        return
    for connection, log_time_ns, raw in reader.messages(chosen):
        yield RecordedMessage(connection.topic, log_time_ns, raw, connection.msgtype)


def _is_unindexed(reader: Reader) -> bool:
    """Whether rosbags would give an MCAP file's messages in the file's order, or leave some out.

    It takes chunks without an index for empty ones; those that are end at time 0.
    """
    storage = reader.storage
    return isinstance(storage, McapReader) and not (
        storage.chunks
        and all(chunk.channel_count or not chunk.message_end_time for chunk in storage.chunks)
    )


def _sorted(file: Path, chosen: list[Connection]) -> list[RecordedMessage]:
    """The messages of an MCAP file that has no index; all of them are held in memory."""
    topics = {connection.topic for connection in chosen}
    records = McapRecords(file)
    messages = [
        RecordedMessage(channel.topic, log_time_ns, raw, channel.type_name)
        for channel, log_time_ns, raw in records.messages()
        if channel.topic in topics
    ]
    if records.unreadable_bytes:
        raise RecordingError(
            f"cannot read recording {file}: {records.unreadable_bytes} bytes of it are damaged"
        )
    return sorted(messages, key=lambda message: message.log_time_ns)


@cache
def _message_class(type_name: str) -> Any:
    *module, name = type_name.split("/")
    return getattr(import_module(".".join(module)), name)
