"""The storages of rosbags with what rosbag2 and readers know beyond: the place of its insides.

MCAP's chunks and summary have checksums, its messages numbers and both times, its channels the
type's hash. The files name the ROS distribution. Source: the MCAP format specification, and the
writer of rosbag2_storage_mcap.
"""

import os
import re
import struct
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from zlib import crc32

import yaml
from rosbags.interfaces import Connection, ConnectionExtRosbag2
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import Channel, McapWriter, write_channel, write_string
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer

from actuated_characters.bags.format.storage import (
    LOG_TIME,
    OFFERED_QOS,
    ROS_DISTRO,
    SIMULATED,
    TYPE_HASH,
)

_DISTRO_OF_ROSBAGS = re.compile(r"(?m)^( {0,2})ros_distro: rosbags$")
_MESSAGE = struct.Struct("<BQHIQQ")  # kind, length; channel, number, log time, time of publishing
_IN_HEAD = 22  # bytes of the above that count as the record's
_NUMBERS = 1 << 32
_CHUNK_CRC = 1 + 8 + 3 * 8  # from a chunk's beginning: kind, length, two times, size
_FOOTER = struct.Struct("<BQQQ")  # kind, length, places of summary and offsets; then the checksum
_BEHIND_CRC = 8  # bytes of the magic at the end


class McapStorage(McapWriter):
    """Writes an MCAP file."""

    def __init__(self, path: Path, compression: CompressionMode) -> None:
        """Create the file in the directory `path`."""
        super().__init__(path, compression)
        self.has_simulated_log_time = False
        self._published_ns: int | None = None
        self._number: int | None = None

    def describe_next(self, published_ns: int, number: int | None) -> None:
        """Say when the next message was published, and its number; None: counted from 1 on."""
        self._published_ns, self._number = published_ns, number

    def add_connection(self, connection: Connection, offered_qos_profiles: str) -> None:
        """Announce a topic, in the words of rosbag2."""
        assert isinstance(connection.ext, ConnectionExtRosbag2)
        described = {OFFERED_QOS: offered_qos_profiles, TYPE_HASH: connection.digest}
        if self.has_simulated_log_time:
            described[LOG_TIME] = SIMULATED
        metadata = BytesIO()
        for item in described.items():
            for text in item:
                write_string(metadata, text)
        channel = Channel(
            connection.id,
            connection.msgtype,
            connection.topic,
            connection.ext.serialization_format,
            metadata.getvalue(),
        )
        self.channels.append(channel)
        self.channel_stats[connection.id] = 0
        write_channel(self.chunk.bio, channel, self.schemas)

    def write(self, connection: Connection, timestamp: int, data: bytes | memoryview) -> None:
        """Append a message; `timestamp` is its log time, ns."""
        number, chunk = connection.id, self.chunk
        count = self.channel_stats[number] = self.channel_stats[number] + 1
        sequence = count if self._number is None else self._number
        published_ns = timestamp if self._published_ns is None else self._published_ns
        self.message_start_time = min(timestamp, self.message_start_time)
        self.message_end_time = max(timestamp, self.message_end_time)
        chunk.message_start_time = min(timestamp, chunk.message_start_time)
        chunk.message_end_time = max(timestamp, chunk.message_end_time)
        chunk.msgs[number].append((timestamp, chunk.bio.tell()))
        length, sequence = _IN_HEAD + len(data), sequence % _NUMBERS
        chunk.bio.write(_MESSAGE.pack(5, length, number, sequence, timestamp, published_ns))
        chunk.bio.write(data)
        if chunk.bio.tell() > 2**20:
            self.close_chunk()

    def close_chunk(self) -> None:
        """Write the chunk; its checksum comes last, and is 0, which is none, until then."""
        checksum, begin = crc32(self.chunk.bio.getbuffer()), self.bio.tell()
        super().close_chunk()
        end = self.bio.tell()
        self.bio.seek(begin + _CHUNK_CRC)
        self.bio.write(checksum.to_bytes(4, "little"))
        self.bio.seek(end)

    def flush(self) -> None:
        """Hand all messages to the operating system."""
        if self.chunk.msgs:  # an empty chunk would be a record for nothing
            self.close_chunk()
        self.bio.flush()

    def close(self, version: int, metadata: str) -> None:
        """Write the rest, index, metadata and summary, whose checksum comes last."""
        super().close(version, with_distro(metadata))
        with self.path.open("r+b") as file:
            footer = file.seek(-_BEHIND_CRC - 4 - _FOOTER.size, os.SEEK_END)
            _, _, summary, _ = _FOOTER.unpack(file.read(_FOOTER.size))
            file.seek(summary)
            checksum = crc32(file.read(footer + _FOOTER.size - summary))
            file.write(checksum.to_bytes(4, "little"))


class SqliteStorage(Sqlite3Writer):
    """Writes an SQLite file."""

    def __init__(self, path: Path, compression: CompressionMode) -> None:
        """Create the file in the directory `path`."""
        super().__init__(path, compression)
        self.conn.execute("UPDATE schema SET ros_distro = ?", (ros_distro(),))
        self.conn.commit()
        # A process that is killed loses nothing by it, and a commit does not wait for the disk.
        self.conn.execute("PRAGMA synchronous=OFF")

    def flush(self) -> None:
        """Hand all messages to the operating system."""
        self.conn.commit()

    def close(self, version: int, metadata: str) -> None:
        """Write the rest and the metadata."""
        super().close(version, with_distro(metadata))


class RosbagWriter(Writer):
    """Writes a bag whose files and metadata name the ROS distribution."""

    STORAGE_PLUGINS: Mapping[StoragePlugin, type[McapStorage] | type[SqliteStorage]] = {
        StoragePlugin.SQLITE3: SqliteStorage,
        StoragePlugin.MCAP: McapStorage,
    }

    def close(self) -> None:
        """Close the file and write `metadata.yaml`."""
        super().close()
        text = with_distro(self.metapath.read_text(encoding="utf-8"))
        scratch = self.metapath.with_suffix(".yaml.tmp")
        scratch.write_text(text, encoding="utf-8")
        scratch.replace(self.metapath)


def ros_distro() -> str:
    """The ROS distribution: that of the environment, or else that of the wheels."""
    return os.environ.get("ROS_DISTRO", "").strip() or ROS_DISTRO


def with_distro(metadata: str) -> str:
    """A bag's metadata, YAML, with the ROS distribution in the place of the library's name."""
    line = yaml.safe_dump({"ros_distro": ros_distro()}, width=float("inf")).strip()
    return _DISTRO_OF_ROSBAGS.sub(lambda match: match[1] + line, metadata)
