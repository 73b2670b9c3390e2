"""The records of an MCAP file, read as a stream, whether or not the file was ever completed.

Format: the MCAP specification, version 0.
"""

import struct
from collections.abc import Iterator
from os import SEEK_CUR
from pathlib import Path
from typing import BinaryIO, NamedTuple

from rosbags.rosbag2.storage_mcap import decompress

from experiment.bags.limits import MOST_OF_CHUNK, LimitError
from msgs_config.errors import RecordingError

_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 0x02, 0x03, 0x04, 0x05, 0x06, 0x0F
_READ = (_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK)
_HEAD = struct.Struct("<BQ")  # of a record: its kind, and the length of what follows
_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence number, log time, publish time
_CHUNK_HEAD = struct.Struct("<QQQI")  # first and last log time, size of the records, checksum
_TAIL = struct.Struct("<BQQQI8s")  # footer record and magic


class _Schema(NamedTuple):
    type_name: str
    definition: str


class Channel(NamedTuple):
    """A topic of the file."""

    topic: str
    type_name: str  # as "sensor_msgs/msg/JointState"
    definition: str
    serialization: str
    metadata: tuple[tuple[str, str], ...]


class Message(NamedTuple):
    """A message, serialised."""

    channel: Channel
    log_time_ns: int
    raw: bytes


class McapRecords:
    """Reads one file once, and counts what of it cannot be read.

    A chunk whose checksum or compression is wrong is left out whole; after a record that is cut
    off nothing more can be found.
    """

    def __init__(self, file: Path) -> None:
        self.unreadable_bytes = 0
        self.refusal = ""  # why some of them are not read, though they may be sound
        self.fraction = 0.0  # of the file that has been read
        self.is_compressed = False  # as far as it was read
        self._path = file
        self._schemas: dict[int, _Schema] = {}
        self._channels: dict[int, Channel] = {}

    def messages(self) -> Iterator[Message]:
        """Yield the messages in the file's order.

        Raises:
            RecordingError: it is no MCAP file.
        """
        size = self._path.stat().st_size
        with self._path.open("rb") as file:
            if file.read(len(_MAGIC)) != _MAGIC:
                raise RecordingError(f"{self._path} is no MCAP file")
            self._read_summary(file, size)
            file.seek(len(_MAGIC))
            while head := file.read(_HEAD.size):
                if not _is_record(head):
                    self.unreadable_bytes += size - file.tell() + len(head)
                    break
                kind, length = _HEAD.unpack(head)
                if kind in (_DATA_END, _FOOTER):
                    break
                left = min(length, size - file.tell())
                if kind not in _READ or left > MOST_OF_CHUNK:
                    self._skip(kind, left)
                    file.seek(left, SEEK_CUR)
                    continue
                body = file.read(left)
                self.fraction = file.tell() / size
                yield from self._record(kind, body, whole=len(body) == length)
        self.fraction = 1.0

    def _skip(self, kind: int, length: int) -> None:
        if kind in _READ:
            self.refusal = str(LimitError("a record", length, MOST_OF_CHUNK))
            self.unreadable_bytes += length

    def channels(self) -> list[Channel]:
        """The topics that were announced, as far as the file was read."""
        return list(self._channels.values())

    def _read_summary(self, file: BinaryIO, size: int) -> None:
        """Take topics from a completed file's end, where they are told again."""
        if size < len(_MAGIC) + _TAIL.size:
            return
        file.seek(-_TAIL.size, 2)
        kind, length, start, _, _, magic = _TAIL.unpack(file.read())
        if (kind, length, magic) != (_FOOTER, 20, _MAGIC) or not 0 < start < size:
            return
        if size - start > MOST_OF_CHUNK:
            return
        file.seek(start)
        before = self.unreadable_bytes
        for _ in self._records(file.read()):
            pass
        self.unreadable_bytes = before  # it is not what messages are in

    def _record(self, kind: int, body: bytes, *, whole: bool) -> Iterator[Message]:
        try:
            if kind == _CHUNK:
                yield from self._chunk(body, whole=whole)
            elif not whole:
                self.unreadable_bytes += len(body)
            elif kind == _SCHEMA:
                self._add_schema(body)
            elif kind == _CHANNEL:
                self._add_channel(body)
            elif kind == _MESSAGE:
                yield self._message(body)
        except (struct.error, KeyError, UnicodeDecodeError):
            self.unreadable_bytes += len(body)

    def _chunk(self, body: bytes, *, whole: bool) -> Iterator[Message]:
        _, _, size, checksum = _CHUNK_HEAD.unpack_from(body)
        compression, offset = _text(body, _CHUNK_HEAD.size)
        (length,) = struct.unpack_from("<Q", body, offset)
        self.is_compressed = self.is_compressed or bool(compression)
        packed = body[offset + 8 : offset + 8 + length]
        if not whole and compression:
            self.unreadable_bytes += len(body)
            return
        if whole:
            try:
                packed = decompress(packed, compression, size, checksum)
            except Exception as error:  # whatever its libraries raise for damaged bytes
                self.refusal = str(error) if isinstance(error, LimitError) else self.refusal
                self.unreadable_bytes += len(body)
                return
        yield from self._records(packed)

    def _records(self, data: bytes) -> Iterator[Message]:
        """The records of a chunk, or of a part of one."""
        position = 0
        while position < len(data):
            head = data[position : position + _HEAD.size]
            if not _is_record(head):
                self.unreadable_bytes += len(data) - position
                return
            kind, length = _HEAD.unpack(head)
            position += _HEAD.size
            body = data[position : position + length]
            position += length
            if kind != _CHUNK:  # there is none inside of another
                yield from self._record(kind, body, whole=len(body) == length)

    def _add_schema(self, body: bytes) -> None:
        (number,) = struct.unpack_from("<H", body)
        name, offset = _text(body, 2)
        _, offset = _text(body, offset)
        definition, _ = _text(body, offset)
        self._schemas[number] = _Schema(name, definition)

    def _add_channel(self, body: bytes) -> None:
        number, schema = struct.unpack_from("<HH", body)
        topic, offset = _text(body, 4)
        serialization, offset = _text(body, offset)
        (length,) = struct.unpack_from("<I", body, offset)
        offset += 4
        end, metadata = offset + length, []
        while offset < end:
            key, offset = _text(body, offset)
            value, offset = _text(body, offset)
            metadata.append((key, value))
        self._channels[number] = Channel(
            topic, *self._schemas[schema], serialization, tuple(metadata)
        )

    def _message(self, body: bytes) -> Message:
        number, _, log_time_ns, _ = _MESSAGE_HEAD.unpack_from(body)
        return Message(self._channels[number], log_time_ns, body[_MESSAGE_HEAD.size :])


def _is_record(head: bytes) -> bool:
    """Whether a record may begin so: the format has no kind 0, as a file's unwritten end has."""
    return len(head) == _HEAD.size and head[0] != 0


def _text(data: bytes, offset: int) -> tuple[str, int]:
    """A string that begins at an offset, and the offset behind it.

    Raises:
        struct.error: the data end before it does.
    """
    (length,) = struct.unpack_from("<I", data, offset)
    end = offset + 4 + length
    if end > len(data):
        raise struct.error("the string is cut off")
    return data[offset + 4 : end].decode(), end
