"""Reads storage files that nobody closed: every message that is whole, in the file's order."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple, Protocol

from rosbags.rosbag2.reader import zstd  # type: ignore[attr-defined]  # the one that it found

from experiment.bags.mcap_records import Channel, McapRecords
from experiment.bags.metadata import CDR
from experiment.bags.storage import ZSTD_MAGIC, reason
from msgs_config.errors import RecordingError


class StoredTopic(NamedTuple):
    """What a storage file says of a topic; a text is empty where the file says nothing."""

    name: str
    type_name: str  # as "sensor_msgs/msg/JointState"
    definition: str
    type_hash: str
    offered_qos: str  # YAML, as rosbag2 writes it


class StoredMessage(NamedTuple):
    """A message as it lies in a storage file."""

    topic: StoredTopic
    log_time_ns: int
    raw: bytes
    was_compressed: bool  # alone, or with others


class Salvage(Protocol):
    """A damaged file that is being read."""

    def messages(self) -> Iterator[StoredMessage]:
        """What can be read, in the file's order."""
        ...

    @property
    def topics(self) -> list[StoredTopic]:
        """What the file announces, as far as it was read: with messages or without."""
        ...

    @property
    def damage(self) -> str:
        """What could not be read, in a few words; empty if there was nothing of it so far."""
        ...

    @property
    def fraction(self) -> float:
        """How much of the file has been read, 0 to 1."""
        ...


class McapSalvage:
    """An MCAP file: as a stream of records, up to the first one that is not whole."""

    def __init__(self, file: Path) -> None:
        self._records = McapRecords(file)
        self._lost_messages = 0

    def messages(self) -> Iterator[StoredMessage]:
        """What can be read, in the file's order.

        Raises:
            RecordingError: it is no MCAP file, or none of ROS 2.
        """
        topics: dict[Channel, StoredTopic] = {}
        for channel, log_time_ns, packed in self._records.messages():
            if channel not in topics:
                topics[channel] = _topic_of(channel)
            raw = _unpacked(packed)
            if raw is None:
                self._lost_messages += 1
                continue
            was_compressed = self._records.is_compressed or raw is not packed
            yield StoredMessage(topics[channel], log_time_ns, raw, was_compressed)

    @property
    def topics(self) -> list[StoredTopic]:
        """What the file announces."""
        return [_topic_of(each) for each in self._records.channels() if each.serialization == CDR]

    @property
    def damage(self) -> str:
        """What could not be read."""
        return _damage((self._records.unreadable_bytes, "bytes"), (self._lost_messages, "messages"))

    @property
    def fraction(self) -> float:
        """How much of the file has been read."""
        return self._records.fraction


def _topic_of(channel: Channel) -> StoredTopic:
    if channel.serialization != CDR:
        raise RecordingError(
            f"'{channel.topic}' is serialised as {channel.serialization}, not as {CDR}"
        )
    metadata = dict(channel.metadata)
    return StoredTopic(
        channel.topic,
        channel.type_name,
        channel.definition,
        metadata.get("topic_type_hash", ""),  # as rosbag2 writes it from Jazzy on
        metadata.get("offered_qos_profiles", ""),
    )


class SqliteSalvage:
    """An SQLite file, which is written to: its journal, if one lies beside it, is played back."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._lost_rows = 0
        self._end = ""  # why it was reached too early
        self.topics: list[StoredTopic] = []
        self.fraction = 0.0

    @property
    def damage(self) -> str:
        """What could not be read."""
        return "; ".join(filter(None, (_damage((self._lost_rows, "messages")), self._end)))

    def messages(self) -> Iterator[StoredMessage]:
        """What can be read, in the file's order.

        Raises:
            RecordingError: it is no SQLite file, or none of a recording.
        """
        try:
            with closing(sqlite3.connect(self._file)) as connection:
                connection.text_factory = lambda text: text.decode(errors="replace")
                connection.execute("PRAGMA writable_schema=ON")  # else a cut file is refused whole
                topics = self._topics(connection)
                self.topics = list(topics.values())
                yield from self._rows(connection, topics)
        except (sqlite3.Error, ValueError) as error:
            raise RecordingError(f"{self._file.name} cannot be read: {reason(error)}") from error

    def _topics(self, connection: sqlite3.Connection) -> dict[int, StoredTopic]:
        definitions: dict[str, str] = {}
        if _columns(connection, "message_definitions"):
            query = "SELECT topic_type, encoded_message_definition FROM message_definitions"
            definitions = dict(connection.execute(query))
        known = _columns(connection, "topics")
        optional = [  # of later versions of rosbag2
            name if name in known else "''"
            for name in ("offered_qos_profiles", "type_description_hash")
        ]
        rows = connection.execute(f"SELECT id, name, type, {', '.join(optional)} FROM topics")
        return {
            number: StoredTopic(name, type_name, definitions.get(type_name, ""), type_hash, qos)
            for number, name, type_name, qos, type_hash in rows
        }

    def _rows(
        self, connection: sqlite3.Connection, topics: dict[int, StoredTopic]
    ) -> Iterator[StoredMessage]:
        size, done = max(self._file.stat().st_size, 1), 0
        rows = connection.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id")
        try:
            for number, log_time_ns, packed in rows:
                is_sound = isinstance(packed, bytes) and isinstance(log_time_ns, int)
                raw = _unpacked(packed) if is_sound and number in topics else None
                if raw is None:
                    self._lost_rows += 1
                    continue
                done += len(packed)
                self.fraction = min(done / size, 1.0)
                yield StoredMessage(topics[number], log_time_ns, raw, raw is not packed)
        except sqlite3.Error as error:
            self._end = f"what comes after its {done} first bytes of messages ({reason(error)})"


def _unpacked(packed: bytes) -> bytes | None:
    """A message as it was serialised, also where rosbag2 compressed each; None if it is damaged."""
    if not packed.startswith(ZSTD_MAGIC):
        return packed
    try:
        raw: bytes = zstd.decompress(packed)
    except Exception:  # zstd's own; no message is worth losing the others for
        return None
    return raw


def _damage(*counts: tuple[int, str]) -> str:
    return ", ".join(f"{count} {what}" for count, what in counts if count)


def _columns(connection: sqlite3.Connection, table: str) -> list[str]:
    return [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]
