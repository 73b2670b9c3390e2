"""Reads MCAP files: closed ones by log time, any others record by record as far as they go.

The `mcap` library parses the records. Source: the MCAP format specification.
"""

import struct
import zlib
from bisect import bisect_left
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack, suppress
from io import BytesIO
from os import SEEK_END
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import FOOTER_SIZE
from mcap.records import Channel, Chunk, ChunkIndex, Footer, Header, Schema, Statistics
from mcap.stream_reader import StreamReader

from actuated_characters.bags.format import limits
from actuated_characters.bags.format.storage import (
    LOG_TIME,
    OFFERED_QOS,
    SIMULATED,
    TYPE_HASH,
    Beginning,
    FileStatistics,
    StoredMessage,
    StoredTopic,
)
from msgs_config.errors import RecordingError

_ALL = Beginning()
_MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")  # a record's kind, and the length of its content
# Channel, number, log time and time of publishing, before the message itself.
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_MESSAGE, _CHUNK = int(Opcode.MESSAGE), int(Opcode.CHUNK)
_IN_CHUNK = {int(Opcode.SCHEMA), int(Opcode.CHANNEL), _MESSAGE}
_LAST_RECORDS = {(int(Opcode.DATA_END), 4), (int(Opcode.FOOTER), 20)}  # kinds and lengths
_UNKNOWN_OPCODES = range(max(Opcode) + 1, 0x80)  # at 0x80 those of other programs begin
_BEHIND_SUMMARY_CRC = 4 + len(_MAGIC)  # bytes from the checksum to the end
_CUT_OFF = "bytes cut off"
_MOST_NAMED = 5  # kinds of damage that a sentence names
_MESSAGE_OVERHEAD = 200  # bytes that a message takes in memory beside its own


class McapFile:
    """An MCAP file, and the damage that was found in it so far.

    A chunk whose checksum or compression is wrong is left out whole; nothing is found after a
    record that is cut off.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[int, StoredTopic] = {}
        """By channel, those that the file announces: with messages or without."""
        self.unreadable: Counter[str] = Counter()
        """How often something could not be read, by its description."""
        self.fraction = 0.0
        """Of the file that `messages` has read."""
        self.is_compressed = False
        """Whether there was something compressed."""
        self._schemas: dict[int, Schema] = {}
        self._chunks: list[ChunkIndex] = []
        self._statistics: Statistics | None = None  # the file's own
        self._names: Collection[str] | None = None  # topics that are read; None: all

    @property
    def damage(self) -> str:
        """The damage in a few words; empty if there was none."""
        kinds = sorted(self.unreadable, key=lambda kind: kind != _CUT_OFF)
        named = [f"{kind} ({self.unreadable[kind]})" for kind in kinds[:_MOST_NAMED]]
        return ", ".join([*named, *["..."] * (len(kinds) > _MOST_NAMED)])

    def messages(self) -> Iterator[StoredMessage]:
        """Yield the messages in the order of the file, closed or not.

        Raises:
            RecordingError: it is no MCAP file.
        """
        size = self.path.stat().st_size
        with self.path.open("rb") as file:
            if file.read(len(_MAGIC)) != _MAGIC:
                raise RecordingError(f"{self.path} is no MCAP file")
            with suppress(Exception):  # a closed file announces its topics at its end, too
                self._read_summary(file)
            self.unreadable.clear()
            file.seek(len(_MAGIC))
            for message in self._scan(file, size, {*_IN_CHUNK, _CHUNK}):
                self.fraction = file.tell() / size
                yield message
        self.fraction = 1.0

    def open_closed(self, stack: ExitStack) -> None:
        """Open a file that was closed, until `stack` is; then `messages_by_time` can be read.

        Raises:
            ValueError, McapError: it was not closed, is damaged, or is none of ROS 2.
        """
        self._file = stack.enter_context(self.path.open("rb"))
        header = next(StreamReader(self._file, record_size_limit=limits.MOST_OF_CHUNK).records)
        if not isinstance(header, Header) or header.profile != "ros2":
            raise ValueError("its profile is not 'ros2'")
        self._read_summary(self._file)
        if not self._is_indexed:  # without an index topics may be announced anywhere
            for _ in self.messages():
                pass

    @property
    def _is_indexed(self) -> bool:
        count = 0 if self._statistics is None else self._statistics.channel_count
        return bool(self._chunks) and len(self.topics) >= max(count, 1)

    def statistics(self) -> FileStatistics:
        """The file's own statistics; those of one that has none are counted message by message.

        Raises:
            ValueError, KeyError: the file is damaged.
        """
        counts, known = Counter[str](), self._statistics
        if known is not None:
            for channel, count in known.channel_message_counts.items():
                counts[self.topics[channel].name] += count
            return FileStatistics(counts, known.message_start_time, known.message_end_time)
        first_ns = last_ns = 0
        for message in self.messages():
            first_ns = min(first_ns, message.log_time_ns) if counts else message.log_time_ns
            last_ns = max(last_ns, message.log_time_ns)
            counts[message.topic.name] += 1
        self._check_whole()
        return FileStatistics(counts, first_ns, last_ns)

    def messages_by_time(
        self, names: Collection[str], beginning: Beginning = _ALL
    ) -> Iterator[StoredMessage]:
        """Yield the messages on some topics by log time; a chunk is unpacked when its time comes.

        Chunks that end before the beginning are left out, but for topics that are read whole.

        Raises:
            ValueError: the file is damaged, or more than a limit would have to be held.
        """
        self._names = names
        if not self._is_indexed:
            yield from sorted(self._all_messages())
            return
        chosen = {number for number, topic in self.topics.items() if topic.name in names}
        whole = {number for number in chosen if self.topics[number].name in beginning.whole}
        pending: list[StoredMessage] = []
        for index in sorted(self._chunks, key=lambda each: each.message_start_time):
            wanted = chosen if index.message_end_time >= beginning.log_time_ns else whole
            if index.message_index_offsets and not index.message_index_offsets.keys() & wanted:
                continue
            start_ns = index.message_start_time
            ready = bisect_left(pending, start_ns, key=lambda each: each.log_time_ns)
            yield from pending[:ready]
            del pending[:ready]
            size = sum(len(message.raw) for message in pending) + index.uncompressed_size
            limits.check_size(
                "overlapping chunks", max(size, index.chunk_length), limits.MOST_OF_CHUNK
            )
            pending += self._read_chunk(index)
            pending.sort()
        yield from pending

    def _read_chunk(self, index: ChunkIndex) -> list[StoredMessage]:
        self._file.seek(index.chunk_start_offset)
        end = index.chunk_start_offset + index.chunk_length
        messages = list(self._scan(self._file, end, {_CHUNK}))
        self._check_whole()
        first_ns, last_ns = index.message_start_time, index.message_end_time
        if not all(first_ns <= message.log_time_ns <= last_ns for message in messages):
            raise ValueError("its index is damaged")
        return messages

    def _all_messages(self) -> Iterator[StoredMessage]:
        """Yield the messages of a file without an index, in its order, up to a limit."""
        size = 0
        for message in self.messages():
            size += len(message.raw) + _MESSAGE_OVERHEAD
            limits.check_size("a file without an index", size, limits.MOST_SORTED)
            yield message
        self._check_whole()

    def _check_whole(self) -> None:
        if self.unreadable:
            raise ValueError(f"it cannot be read whole: {self.damage}")

    def _scan(
        self, stream: BinaryIO, size: int, wanted: Collection[int], place: int = 0
    ) -> Iterator[StoredMessage]:
        """Yield the messages of the records from the position on, up to one that is cut off."""
        try:
            for kind, begin, length in _records(stream, size):
                if kind in wanted and length > limits.MOST_OF_CHUNK:
                    self.unreadable[f"record of more than {limits.MOST_OF_CHUNK} bytes"] += 1
                elif kind in wanted and kind == _MESSAGE and length >= _MESSAGE_HEAD.size:
                    head = stream.read(_MESSAGE_HEAD.size)
                    channel, number, log_time_ns, published_ns = _MESSAGE_HEAD.unpack(head)
                    if (topic := self.topics.get(channel)) is None:
                        self.unreadable["message of a topic that is not announced"] += 1
                    elif self._names is None or topic.name in self._names:
                        raw = stream.read(length - _MESSAGE_HEAD.size)
                        if not topic.has_simulated_log_time:  # publishers' clocks may differ
                            published_ns = log_time_ns
                        at = (place, begin)
                        yield StoredMessage(log_time_ns, published_ns, at, topic, raw, number)
                elif kind in wanted:
                    yield from self._parse(kind, stream.read(length), begin)
                elif kind in _UNKNOWN_OPCODES:
                    self.unreadable["unknown record"] += 1
        except _CutOffError as error:
            self.unreadable[_CUT_OFF] += error.size

    def _parse(self, kind: int, body: bytes, begin: int) -> list[StoredMessage]:
        """Return the messages of a record that is whole; announcements have none."""
        stream = ReadDataStream(BytesIO(body))
        try:
            if kind == _CHUNK:
                chunk = Chunk.read(stream)
                self.is_compressed |= bool(chunk.compression)
                raw = _unpack_chunk(chunk)
                return list(self._scan(BytesIO(raw), len(raw), _IN_CHUNK, begin))
            if kind == Opcode.SCHEMA:
                schema = Schema.read(stream)
                self._schemas[schema.id] = schema
            elif kind == Opcode.CHANNEL:
                self._announce(Channel.read(stream))
            else:
                raise ValueError("a message without its head")
        except limits.LimitError as error:
            self.unreadable[str(error)] += 1
        except Exception:  # whatever the libraries raise for damaged bytes
            self.unreadable[f"damaged {Opcode(kind).name.lower()}"] += 1
        return []

    def _announce(self, channel: Channel) -> None:
        schema = self._schemas[channel.schema_id]
        self.topics[channel.id] = StoredTopic(
            channel.topic,
            schema.name,
            channel.message_encoding,
            schema.data.decode(errors="replace"),
            channel.metadata.get(TYPE_HASH, ""),  # rosbag2 writes it from Jazzy on
            channel.metadata.get(OFFERED_QOS, ""),
            channel.metadata.get(LOG_TIME) == SIMULATED,
        )

    def _read_summary(self, file: BinaryIO) -> None:
        """Read topics and index at the end of a closed file, without unpacking anything.

        Raises:
            ValueError, OSError, McapError: the file was not closed, or is damaged.
        """
        file.seek(-len(_MAGIC), SEEK_END)
        if file.read() != _MAGIC:
            raise ValueError("it is cut off, or was never closed")
        file.seek(-len(_MAGIC) - FOOTER_SIZE, SEEK_END)
        footer = next(StreamReader(file, True, record_size_limit=limits.MOST_OF_CHUNK).records)
        if not isinstance(footer, Footer):
            raise ValueError("it has no footer")
        if not footer.summary_start:
            return
        file.seek(footer.summary_start)
        if footer.summary_crc:  # checksum of all bytes before it, from the summary on
            size = file.seek(-_BEHIND_SUMMARY_CRC, SEEK_END) - footer.summary_start
            limits.check_size("a summary", size, limits.MOST_OF_CHUNK)
            file.seek(footer.summary_start)
            if zlib.crc32(file.read(size)) != footer.summary_crc:
                raise ValueError("the checksum of its summary is wrong")
            file.seek(footer.summary_start)
        # The library's own `get_summary` would unpack what a damaged footer points to.
        reader = StreamReader(file, True, emit_chunks=True, record_size_limit=limits.MOST_OF_CHUNK)
        self._chunks = []
        for record in reader.records:
            if isinstance(record, Schema):
                self._schemas[record.id] = record
            elif isinstance(record, Channel):
                self._announce(record)
            elif isinstance(record, ChunkIndex):
                self._chunks.append(record)
            elif isinstance(record, Statistics):
                self._statistics = record


class _CutOffError(ValueError):
    """A record ends behind the end of its file or chunk."""

    def __init__(self, size: int) -> None:
        """`size` is that of the part that is there, bytes."""
        super().__init__(f"{_CUT_OFF} ({size})")
        self.size = size


def _records(stream: BinaryIO, size: int) -> Iterator[tuple[int, int, int]]:
    """Yield kind, begin and length of each record from the position on, at its content.

    At the end up to nine bytes are no loss: a recorder that is killed between the two writes of a
    record leaves its head alone.

    Raises:
        _CutOffError: a record is not whole.
    """
    while size - (begin := stream.tell()) > _HEAD.size:
        kind, length = _HEAD.unpack(stream.read(_HEAD.size))
        if (kind, length) in _LAST_RECORDS:
            return
        end = begin + _HEAD.size + length
        if not kind or end > size:  # the format has no kind 0
            raise _CutOffError(size - begin)
        yield kind, begin, length
        stream.seek(end)


def _unpack_chunk(chunk: Chunk) -> bytes:
    """Return the records in a chunk. Raises an error of `limits.DAMAGED` if they cannot be."""
    raw = limits.unpack("a chunk", chunk.data, chunk.compression, limits.MOST_OF_CHUNK)
    is_sound = len(raw) == chunk.uncompressed_size
    if not is_sound or chunk.uncompressed_crc not in (0, zlib.crc32(raw)):
        raise ValueError("the size or the checksum of a chunk is wrong")
    return raw
