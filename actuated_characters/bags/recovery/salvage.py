"""Reads MCAP files in their order, also those that nobody closed: every record that is whole."""

import struct
from collections import Counter
from collections.abc import Collection, Iterator
from io import BytesIO
from os import SEEK_CUR
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema
from rosbags.rosbag2.storage_mcap import decompress

from actuated_characters.bags.limits import MOST_OF_CHUNK, LimitError
from actuated_characters.bags.metadata import CDR
from msgs_config.errors import RecordingError

_MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")  # of a record: its kind, and the length of what follows
_TAIL = struct.Struct("<BQQQI8s")  # footer record and magic
_ANNOUNCEMENTS = (Opcode.SCHEMA, Opcode.CHANNEL)
_ENDS = ((Opcode.DATA_END, 4), (Opcode.FOOTER, 20))  # with their lengths
_PRIVATE = 0x80  # kinds of others begin here
_CUT_OFF = "bytes cut off"
_MOST_NAMED = 5  # kinds of damage


class StoredTopic(NamedTuple):
    """A topic of a file."""

    name: str
    type_name: str  # as "sensor_msgs/msg/JointState"
    definition: str
    type_hash: str  # empty before Jazzy
    offered_qos: str  # YAML, as rosbag2 writes it


class StoredMessage(NamedTuple):
    """A message of a file."""

    topic: StoredTopic
    log_time_ns: int
    raw: bytes  # as it is stored: rosbag2 may have compressed each


class Salvage:
    """Reads one MCAP file once, and counts what of it cannot be read.

    A chunk whose checksum or compression is wrong is left out whole; after a record that is cut
    off nothing more is found.
    """

    def __init__(self, file: Path) -> None:
        self.lost: Counter[str] = Counter()
        """How often something could not be read, so far, by what it was."""
        self.fraction = 0.0
        """Of the file that has been read."""
        self.is_compressed = False
        """Whether there was something compressed, so far."""
        self.path = file
        self._schemas: dict[int, Schema] = {}
        self._topics: dict[int, StoredTopic] = {}

    @property
    def topics(self) -> list[StoredTopic]:
        """What the file announces, as far as it was read: with messages or without."""
        return list(self._topics.values())

    @property
    def damage(self) -> str:
        """What could not be read, in a few words; empty if there was nothing of it so far."""
        kinds = sorted(self.lost, key=lambda what: what != _CUT_OFF)
        named = [f"{what} ({self.lost[what]})" for what in kinds[:_MOST_NAMED]]
        return ", ".join([*named, *["..."] * (len(kinds) > _MOST_NAMED)])

    def messages(self) -> Iterator[StoredMessage]:
        """Yield the messages in the file's order.

        Raises:
            RecordingError: it is no MCAP file.
        """
        size = self.path.stat().st_size
        with self.path.open("rb") as file:
            if file.read(len(_MAGIC)) != _MAGIC:
                raise RecordingError(f"{self.path} is no MCAP file")
            self._read_summary(file, size)
            file.seek(len(_MAGIC))
            for message in self._records(
                file, size, (*_ANNOUNCEMENTS, Opcode.MESSAGE, Opcode.CHUNK)
            ):
                self.fraction = file.tell() / size
                yield message
        self.fraction = 1.0

    def _read_summary(self, file: BinaryIO, size: int) -> None:
        """Take topics from a closed file's end, where they are told again."""
        file.seek(max(size - _TAIL.size, 0))
        tail = file.read()
        kind, length, start, *_, magic = _TAIL.unpack(tail.rjust(_TAIL.size, b"\0"))
        whole = (kind, length, magic) == (Opcode.FOOTER, 20, _MAGIC) and 0 < start < size
        if whole and size - start <= MOST_OF_CHUNK:
            file.seek(start)
            for _ in self._records(file, size, _ANNOUNCEMENTS):
                pass
            self.lost.clear()  # it is not what messages are in

    def _records(
        self, file: BinaryIO, size: int, wanted: Collection[int]
    ) -> Iterator[StoredMessage]:
        """What records from the file's position on hold, up to one that is cut off."""
        while (begin := file.tell()) < size:
            head = file.read(_HEAD.size)
            if size - begin <= _HEAD.size:  # what a kill before a record's content leaves
                return
            kind, length = _HEAD.unpack(head)
            if (kind, length) in _ENDS:
                return
            if not kind or file.tell() + length > size:  # the format has no kind 0
                self.lost[_CUT_OFF] += size - begin
                return
            if max(Opcode) < kind < _PRIVATE:
                self.lost["unknown record"] += 1
            if kind in wanted and length <= MOST_OF_CHUNK:
                yield from self._messages_of(kind, file.read(length))
                continue
            if kind in wanted:
                self.lost[f"record of more than {MOST_OF_CHUNK} bytes"] += 1
            file.seek(length, SEEK_CUR)

    def _messages_of(self, kind: int, body: bytes) -> list[StoredMessage]:
        """The messages of one record that is whole."""
        stream = ReadDataStream(BytesIO(body))
        try:
            if kind == Opcode.SCHEMA:
                schema = Schema.read(stream)
                self._schemas[schema.id] = schema
            elif kind == Opcode.CHANNEL:
                self._add(Channel.read(stream))
            elif kind == Opcode.MESSAGE:
                message = Message.read(stream, len(body))
                if (topic := self._topics.get(message.channel_id)) is not None:
                    return [StoredMessage(topic, message.log_time, message.data)]
                self.lost["message of a topic that is not announced"] += 1
            elif kind == Opcode.CHUNK:
                chunk = Chunk.read(stream)
                self.is_compressed |= bool(chunk.compression)
                size, checksum = chunk.uncompressed_size, chunk.uncompressed_crc
                data = decompress(chunk.data, chunk.compression, size, checksum)
                inside = (*_ANNOUNCEMENTS, Opcode.MESSAGE)
                return list(self._records(BytesIO(data), len(data), inside))
        except LimitError as error:
            self.lost[str(error)] += 1
        except Exception:  # whatever their libraries raise for damaged bytes
            self.lost[f"damaged {Opcode(kind).name.lower()}"] += 1
        return []

    def _add(self, channel: Channel) -> None:
        if channel.message_encoding != CDR:
            self.lost[f"topic '{channel.topic}' as {channel.message_encoding}, not as {CDR}"] += 1
            return
        schema = self._schemas[channel.schema_id]
        self._topics[channel.id] = StoredTopic(
            channel.topic,
            schema.name,
            schema.data.decode(errors="replace"),
            channel.metadata.get("topic_type_hash", ""),  # as rosbag2 writes it from Jazzy on
            channel.metadata.get("offered_qos_profiles", ""),
        )
