"""Bags as other programs write them: by `mcap`, by rosbags and by SQL, never by our own writer."""

import sqlite3
from collections.abc import Iterable, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from mcap.writer import CompressionType, Writer
from rosbags.interfaces import ConnectionExtRosbag2
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin
from rosbags.rosbag2 import Writer as Writer9

from actuated_characters.bags.reader import read_messages

TEXT = "std_msgs/msg/String"
HUMBLE_QOS = """- history: 3
  depth: 0
  reliability: 1
  durability: 2
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: 1
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false"""


class TextMessage(NamedTuple):
    """A text on a topic."""

    topic: str
    log_time_ns: int
    text: str

    @property
    def cdr(self) -> bytes:
        data = self.text.encode() + b"\0"
        return b"\x00\x01\x00\x00" + len(data).to_bytes(4, "little") + data


SENT = [TextMessage("/a" if number % 3 else "/b", number, f"text {number}") for number in range(30)]


def texts(bag: Path) -> list[TextMessage]:
    """What a bag of texts says, by the project's own reader."""
    return [TextMessage(m.topic, m.log_time_ns, m.decode().data) for m in read_messages(bag)]


def write_mcap(
    file: Path,
    messages: Iterable[TextMessage],
    *,
    chunk_size: int = 200,
    compression: CompressionType = CompressionType.ZSTD,
    close: bool = True,
    serialization: str = "cdr",
    profile: str = "ros2",
    **options: Any,
) -> Path:
    """An MCAP file as rosbag2 and Foxglove write it; not closed, it ends with its last chunk."""
    with file.open("wb") as stream:
        writer = Writer(stream, chunk_size=chunk_size, compression=compression, **options)
        writer.start(profile=profile, library="test")
        schema = writer.register_schema(TEXT, "ros2msg", b"string data\n")
        channels: dict[str, int] = {}
        for topic, log_time_ns, text in messages:
            if topic not in channels:
                metadata = {"offered_qos_profiles": HUMBLE_QOS, "topic_type_hash": "RIHS01_ab"}
                channels[topic] = writer.register_channel(topic, serialization, schema, metadata)
            raw = TextMessage(topic, log_time_ns, text).cdr
            writer.add_message(channels[topic], log_time_ns, raw, log_time_ns)
        if close:
            writer.finish()
    return file


def write_humble_db3(file: Path, messages: Iterable[TextMessage], journal: str = "DELETE") -> Path:
    """An SQLite file with the tables of ROS 2 Humble."""
    return _write_db3(file, messages, journal, "", ())


def write_jazzy_db3(file: Path, messages: Iterable[TextMessage]) -> Path:
    """An SQLite file with the tables of ROS 2 Jazzy."""
    _write_db3(file, messages, "DELETE", ", type_description_hash TEXT NOT NULL", ("RIHS01_ab",))
    with closing(sqlite3.connect(file)) as database:
        database.executescript(
            f"""
            CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
            CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL,
                metadata TEXT NOT NULL);
            CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL,
                encoding TEXT NOT NULL, encoded_message_definition TEXT NOT NULL,
                type_description_hash TEXT NOT NULL);
            INSERT INTO schema VALUES (4, 'jazzy');
            INSERT INTO message_definitions VALUES
                (1, '{TEXT}', 'ros2msg', 'string data', 'RIHS01_ab');
            """
        )
    return file


def _write_db3(
    file: Path, messages: Iterable[TextMessage], journal: str, column: str, value: tuple[str, ...]
) -> Path:
    with closing(sqlite3.connect(file)) as database:
        database.execute(f"PRAGMA journal_mode={journal}")
        database.executescript(
            f"""
            CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
                serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL{column});
            CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,
                timestamp INTEGER NOT NULL, data BLOB NOT NULL);
            CREATE INDEX timestamp_idx ON messages (timestamp ASC);
            """
        )
        numbers: dict[str, int] = {}
        for each in messages:
            if each.topic not in numbers:
                numbers[each.topic] = len(numbers) + 1
                row = (numbers[each.topic], each.topic, TEXT, "cdr", HUMBLE_QOS, *value)
                places = ", ".join("?" * len(row))
                database.execute(f"INSERT INTO topics VALUES ({places})", row)
            database.execute(
                "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)",
                (numbers[each.topic], each.log_time_ns, each.cdr),
            )
        database.commit()
    return file


def write_metadata(
    bag: Path,
    version: int,
    /,
    storage: str,
    files: Iterable[str],
    topics: Iterable[str],
    **changes: object,
) -> None:
    """`metadata.yaml` with the fields that a version of rosbag2 has."""
    entries = []
    for topic in topics:
        entry: dict[str, object] = {"name": topic, "type": TEXT, "serialization_format": "cdr"}
        if version >= 4:
            entry["offered_qos_profiles"] = [] if version >= 9 else HUMBLE_QOS
        if version >= 7:
            entry["type_description_hash"] = "RIHS01_ab"
        entries.append({"topic_metadata": entry, "message_count": 1})
    files = list(files)
    span: Mapping[str, object] = {
        "duration": {"nanoseconds": 1},
        "starting_time": {"nanoseconds_since_epoch": 0},
        "message_count": 1,
    }
    content: dict[str, object] = {
        "version": version,
        "storage_identifier": storage,
        **span,
        "topics_with_message_count": entries,
        "relative_file_paths": files,
    }
    since = {
        3: {"compression_format": "", "compression_mode": ""},
        5: {"files": [{"path": name, **span} for name in files]},
        6: {"custom_data": None},
        8: {"ros_distro": "jazzy"},
    }
    for first, fields in since.items():
        if version >= first:
            content |= fields
    content |= changes
    text = yaml.safe_dump({"rosbag2_bagfile_information": content}, sort_keys=False)
    (bag / "metadata.yaml").write_text(text)


def to_sqlite(bag: Path, target: Path, *, compressed: bool = False) -> Path:
    """A bag's messages in an SQLite bag by rosbags; each of them compressed, if so said."""
    information = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    writer = Writer9(target, version=9, storage_plugin=StoragePlugin.SQLITE3)
    if compressed:
        writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    for name, text in (information["custom_data"] or {}).items():
        writer.set_custom_data(name, text)
    with Reader(bag) as reader, writer:
        topics = {}
        for each in reader.connections:
            assert isinstance(each.ext, ConnectionExtRosbag2)
            topics[each.id] = writer.add_connection(
                each.topic,
                each.msgtype,
                msgdef=each.msgdef.data,
                rihs01=each.digest,
                offered_qos_profiles=each.ext.offered_qos_profiles,
            )
        for connection, log_time_ns, raw in reader.messages():
            writer.write(topics[connection.id], log_time_ns, raw)
    return target
