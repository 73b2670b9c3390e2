"""Reads storage files that nobody closed: every message that is whole, in the file's order."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple, Protocol

from experiment.bags.limits import (
    UNPACKING_FAILED,
    LimitError,
    check_message,
    check_tables,
    unpack_message,
)
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
        self._lost = _Lost()

    def messages(self) -> Iterator[StoredMessage]:
        """What can be read, in the file's order.

        Raises:
            RecordingError: it is no MCAP file, or none of ROS 2.
        """
        topics: dict[Channel, StoredTopic] = {}
        for channel, log_time_ns, packed in self._records.messages():
            if channel not in topics:
                topics[channel] = _topic_of(channel)
            raw = self._lost.unpacked(packed)
            if raw is None:
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
        count, why = self._records.unreadable_bytes, self._records.refusal
        unread = f"{count} bytes{f' ({why})' if why else ''}" if count else ""
        return ", ".join(filter(None, (unread, str(self._lost))))

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
        self._lost = _Lost()
        self._end = ""  # why it was reached too early
        self.topics: list[StoredTopic] = []
        self.fraction = 0.0

    @property
    def damage(self) -> str:
        """What could not be read."""
        return "; ".join(filter(None, (str(self._lost), self._end)))

    def messages(self) -> Iterator[StoredMessage]:
        """What can be read, in the file's order.

        Raises:
            RecordingError: it is no SQLite file, or none of a recording.
        """
        try:
            with closing(sqlite3.connect(self._file)) as connection:
                connection.text_factory = lambda text: text.decode(errors="replace")
                connection.execute("PRAGMA writable_schema=ON")  # else a cut file is refused whole
                check_tables(connection)
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
                raw = self._lost.unpacked(packed if is_sound and number in topics else None)
                if raw is None:
                    continue
                done += len(packed)
                self.fraction = min(done / size, 1.0)
                yield StoredMessage(topics[number], log_time_ns, raw, raw is not packed)
        except sqlite3.Error as error:
            self._end = f"what comes after its {done} first bytes of messages ({reason(error)})"


class _Lost:
    """Counts the messages that are there and cannot be kept."""

    def __init__(self) -> None:
        self._damaged = 0
        self._refused = 0
        self._refusal = ""

    def unpacked(self, packed: bytes | None) -> bytes | None:
        """A message as it was serialised, also where rosbag2 compressed each; None if it is lost.

        `packed` is None for what is no message.
        """
        try:
            if packed is not None:
                is_packed = packed.startswith(ZSTD_MAGIC)
                return unpack_message(packed) if is_packed else check_message(packed)
        except LimitError as error:
            self._refused += 1
            self._refusal = str(error)
            return None
        except UNPACKING_FAILED:
            pass
        self._damaged += 1
        return None

    def __str__(self) -> str:
        """How many, and why; empty if there are none."""
        damaged = f"{self._damaged} messages" if self._damaged else ""
        refused = f"{self._refused} messages ({self._refusal})" if self._refused else ""
        return ", ".join(filter(None, (damaged, refused)))


def _columns(connection: sqlite3.Connection, table: str) -> list[str]:
    return [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]
