"""Reads recordings: rosbag2 directories of serialised messages, without ROS' rosbag2."""

import heapq
import sqlite3
import tempfile
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, closing
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from rclpy.serialization import deserialize_message
from rosbags.interfaces import Connection, ConnectionExtRosbag2
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.storage_mcap import ChunkInfo, McapReader, msgsrc

from actuated_characters.bags.limits import (
    MOST_OF_CHUNK,
    MOST_OF_FILES,
    MOST_SORTED,
    Allowance,
    LimitError,
    check_message,
    check_tables,
    unpack_file,
    unpack_message,
)
from actuated_characters.bags.metadata import (
    CDR,
    FILE,
    MESSAGE,
    BagMetadata,
    read_metadata,
    recover_hint,
)
from actuated_characters.bags.recovery.salvage import Salvage
from actuated_characters.bags.storage import (
    SQLITE3,
    SUFFIXES,
    ZSTD_MAGIC,
    check_sqlite_path,
    reason,
)
from msgs_config.errors import RecordingError, one_of

_ZSTD_SUFFIX = ".zstd"
_LEAST_HELD = 200  # bytes that a message takes in memory beside its own

Stored: TypeAlias = tuple[str, int, bytes, str]
"""Topic, log time in ns, the message as it is stored, and type; without a topic only a time from
which on there may be messages."""


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
    return "" if path.is_file() else recover_hint(path, "keeps what is whole of it")


def _messages(
    path: Path, topics: Collection[str] | None, stack: ExitStack
) -> Iterator[RecordedMessage]:
    metadata = BagMetadata((path,), (), "") if path.is_file() else read_metadata(path)
    disk, memory = Allowance("its files", MOST_OF_FILES), Allowance("chunks", MOST_OF_CHUNK)
    readers = [_open(path, file, metadata, stack, disk) for file in metadata.files]
    _check_topics(topics, readers, metadata)
    unpack: Callable[[bytes], bytes] = _unpacked if path.is_file() else check_message
    if metadata.compression_mode == MESSAGE:
        unpack = unpack_message
    streams = [
        _within_limits(path, Path(str(reader.path)), stream)
        for reader in readers
        for stream in _streams(reader, topics, memory)
    ]
    for topic, log_time_ns, stored, type_name in heapq.merge(*streams, key=lambda each: each[1]):
        if topic:
            try:
                raw = unpack(stored)
            except LimitError as error:
                raise _refusal(path, f"on '{topic}' {error}") from error
            yield RecordedMessage(topic, log_time_ns, raw, type_name)


def _within_limits(path: Path, file: Path, stream: Iterator[Stored]) -> Iterator[Stored]:
    """A stream of a file; what is too large in it, or damaged, is refused with the file's name."""
    try:
        yield from stream
    except ValueError as error:  # LimitError is one
        name = "" if path == file else f"{file.name}: "
        raise _refusal(path, f"{name}{reason(error)}") from error


def _refusal(path: Path, why: str) -> RecordingError:
    return RecordingError(f"cannot read recording {path}: {why}{_hint(path)}")


def _open(
    path: Path, file: Path, metadata: BagMetadata, stack: ExitStack, disk: Allowance
) -> Reader:
    """A file of a recording, decompressed if need be."""
    if not file.is_file():
        raise RecordingError(f"cannot read recording {path}: its file {file.name} is missing")
    if metadata.compression_mode == FILE and file.suffix == _ZSTD_SUFFIX:
        copy = Path(stack.enter_context(tempfile.TemporaryDirectory())) / file.stem
        unpack_file(file, copy, disk)
        file = copy
    if file.suffix not in SUFFIXES.values():
        raise RecordingError(f"cannot read recording {path}: {file.name} is no .mcap or .db3 file")
    if file.suffix == SUFFIXES[SQLITE3]:
        check_sqlite_path(file, SQLITE3)
        for journal in (file.with_name(file.name + end) for end in ("-journal", "-wal")):
            if journal.is_file() and journal.stat().st_size > 0:  # what rosbags would not look at
                raise RecordingError(
                    f"cannot read recording {path}: {file.name} was never closed, a journal lies "
                    f"beside it; 'sqlite3 {file.name} .tables' makes it whole"
                )
        with closing(sqlite3.connect(f"file:{file}?immutable=1", uri=True)) as tables:
            check_tables(tables)
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
    return unpack_message(raw) if raw.startswith(ZSTD_MAGIC) else check_message(raw)


def _check_topics(
    topics: Collection[str] | None, readers: list[Reader], metadata: BagMetadata
) -> None:
    recorded = {connection.topic for reader in readers for connection in reader.connections}
    recorded |= set(metadata.topics)
    for topic in topics or ():
        if topic not in recorded:
            raise RecordingError(one_of("topic", topic, sorted(recorded)))


def _streams(
    reader: Reader, topics: Collection[str] | None, memory: Allowance
) -> list[Iterator[Stored]]:
    """The messages of one file, each stream by log time; chunks share what memory is allowed."""
    chosen = [each for each in reader.connections if topics is None or each.topic in topics]
    if not chosen:  # to rosbags an empty selection means everything
        return []
    if _is_unindexed(reader):
        return [_sorted(Path(str(reader.path)), chosen)]
    storage = reader.storage
    if isinstance(storage, McapReader):
        return [
            _chunk(storage, chunk, chosen, memory)
            for chunk in storage.chunks
            if any(chunk.channel_count.get(connection.id) for connection in chosen)
        ]
    return [_rows(reader, chosen)]


def _rows(reader: Reader, chosen: Sequence[Connection]) -> Iterator[Stored]:
    for connection, log_time_ns, raw in reader.messages(chosen):
        yield connection.topic, log_time_ns, raw, connection.msgtype


def _chunk(
    storage: McapReader, chunk: ChunkInfo, chosen: Sequence[Connection], memory: Allowance
) -> Iterator[Stored]:
    """The time at which a chunk begins, and then, once that has come, its messages."""
    assert storage.bio is not None
    yield "", chunk.message_start_time, b"", ""
    size = max(chunk.compressed_size, chunk.uncompressed_size)
    memory.take(size)
    channels = {connection.id: connection for connection in chosen}
    end = chunk.message_end_time + 1
    messages = msgsrc(chunk, channels, chunk.message_start_time, end, storage.bio)
    for log_time_ns, _, connection, raw in messages:
        if connection is not None and raw is not None:
            yield connection.topic, log_time_ns, raw, connection.msgtype
    memory.give_back(size)


def _is_unindexed(reader: Reader) -> bool:
    """Whether rosbags would give an MCAP file's messages in the file's order, or leave some out.

    It takes chunks without an index for empty ones; those that are end at time 0.
    """
    storage = reader.storage
    return isinstance(storage, McapReader) and not (
        storage.chunks
        and all(chunk.channel_count or not chunk.message_end_time for chunk in storage.chunks)
    )


def _sorted(file: Path, chosen: list[Connection]) -> Iterator[Stored]:
    """The messages of an MCAP file that has no index; all of them are held in memory."""
    topics = {connection.topic for connection in chosen}
    salvage, memory = Salvage(file), Allowance("a file without an index", MOST_SORTED)
    messages: list[Stored] = []
    for topic, log_time_ns, raw in salvage.messages():
        if topic.name in topics:
            memory.take(len(raw) + _LEAST_HELD)
            messages.append((topic.name, log_time_ns, raw, topic.type_name))
    if salvage.damage:
        raise ValueError(f"it cannot be read whole: {salvage.damage}")
    yield from sorted(messages, key=lambda message: message[1])


@cache
def _message_class(type_name: str) -> Any:
    *module, name = type_name.split("/")
    return getattr(import_module(".".join(module)), name)
