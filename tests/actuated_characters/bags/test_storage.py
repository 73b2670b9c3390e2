"""Both storages of a recording, compressed or not; and that what was flushed is on the disk."""

import os
import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from rclpy.qos import QoSProfile
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapWriter
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer
from std_msgs.msg import String

from actuated_characters.bags.definitions import read_definition
from actuated_characters.bags.reader import read_messages
from actuated_characters.bags.writer import BagWriter
from msgs_config.errors import ConfigurationError, RecordingError
from tests.support.limits import file_size_limit

QOS = QoSProfile(depth=5000)
KINDS = [(s, c) for s in ("mcap", "sqlite3") for c in ("none", "zstd")]
EACH_KIND = pytest.mark.parametrize(("storage", "compression"), KINDS)
EACH_STORAGE = pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
# CDR of std_msgs/String: little-endian, length with the zero at the end, text
HELLO = b"\x00\x01\x00\x00\x06\x00\x00\x00hello\x00"


def write(path: Path, count: int, **options: str) -> BagWriter:
    """A recording of `count` messages that is still open."""
    writer = BagWriter(path, **options)
    writer.add_topic("/text", String, QOS)
    for number in range(count):
        writer.write("/text", HELLO, number)
    return writer


def information(bag: Path) -> dict[str, Any]:
    text = (bag / "metadata.yaml").read_text()
    return dict(yaml.safe_load(text)["rosbag2_bagfile_information"])


# Storages and compressions


@EACH_KIND
def test_rosbags_reads_every_message_of_every_kind(
    tmp_path: Path, storage: str, compression: str
) -> None:
    write(tmp_path / "bag", 3, storage=storage, compression=compression).close()

    with AnyReader([tmp_path / "bag"]) as reader:
        read = [
            (time, reader.deserialize(raw, connection.msgtype).data)
            for connection, time, raw in reader.messages()
        ]

    assert read == [(0, "hello"), (1, "hello"), (2, "hello")]


@EACH_KIND
def test_the_own_reader_reads_every_message_of_every_kind(
    tmp_path: Path, storage: str, compression: str
) -> None:
    write(tmp_path / "bag", 3, storage=storage, compression=compression).close()

    messages = list(read_messages(tmp_path / "bag"))

    assert [message.log_time_ns for message in messages] == [0, 1, 2]
    assert {message.decode().data for message in messages} == {"hello"}


@EACH_KIND
def test_the_metadata_says_what_rosbag2_needs_to_choose_its_reader(
    tmp_path: Path, storage: str, compression: str
) -> None:
    write(tmp_path / "bag", 1, storage=storage, compression=compression).close()

    found = information(tmp_path / "bag")

    each_message = (storage, compression) == ("sqlite3", "zstd")
    assert found["version"] == 9
    assert found["storage_identifier"] == storage
    assert found["compression_mode"] == ("message" if each_message else "")
    assert found["compression_format"] == ("zstd" if each_message else "")
    assert found["relative_file_paths"] == ["bag.mcap" if storage == "mcap" else "bag.db3"]


def test_compressed_chunks_are_zstd_to_an_independent_reader(tmp_path: Path) -> None:
    write(tmp_path / "bag", 10, compression="zstd").close()

    with (tmp_path / "bag" / "bag.mcap").open("rb") as file:
        records = list(StreamReader(file, emit_chunks=True).records)
        file.seek(0)
        raw = [message.data for _, _, message in make_reader(file).iter_messages()]

    assert {r.compression for r in records if isinstance(r, Chunk)} == {"zstd"}
    assert raw == [HELLO] * 10


def test_an_sqlite_recording_has_the_tables_of_rosbag2(tmp_path: Path) -> None:
    write(tmp_path / "bag", 2, storage="sqlite3").close()

    with closing(sqlite3.connect(tmp_path / "bag" / "bag.db3")) as database:
        (schema,) = database.execute("SELECT schema_version FROM schema")
        (topic,) = database.execute(
            "SELECT name, type, serialization_format, type_description_hash FROM topics"
        )
        (definition,) = database.execute("SELECT encoding, topic_type FROM message_definitions")
        rows = database.execute("SELECT topic_id, timestamp, data FROM messages").fetchall()

    assert schema == (4,)
    text_hash = read_definition(String).type_hash
    assert topic == ("/text", "std_msgs/msg/String", "cdr", text_hash)
    assert definition == ("ros2msg", "std_msgs/msg/String")
    assert rows == [(1, 0, HELLO), (1, 1, HELLO)]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"storage": "db3"}, "unknown storage 'db3'; there are: mcap, sqlite3"),
        ({"compression": "lz4"}, "unknown compression 'lz4'; there are: none, zstd"),
    ],
)
def test_a_wrong_choice_names_the_right_ones_and_leaves_nothing(
    tmp_path: Path, options: dict[str, str], sentence: str
) -> None:
    with pytest.raises(ConfigurationError, match=sentence):
        BagWriter(tmp_path / "bag", **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["what?", "number#1", "100%"])
def test_sqlite_refuses_a_path_that_it_would_misread(tmp_path: Path, name: str) -> None:
    with pytest.raises(RecordingError, match=r"sqlite3 allows no '[?#%]' in its path"):
        BagWriter(tmp_path / name, storage="sqlite3")
    assert not list(tmp_path.iterdir())

    write(tmp_path / name, 1, storage="mcap").close()
    assert len(list(read_messages(tmp_path / name))) == 1


# Flushing


def chunks_of(file: Path) -> list[Chunk]:
    """The chunks of a file that nobody has closed yet."""
    chunks = []
    with file.open("rb") as stream, suppress(Exception):  # it has many names for the file's end
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, Chunk):
                chunks.append(record)
    return chunks


def test_what_was_flushed_is_in_the_mcap_file_and_nothing_was_before(tmp_path: Path) -> None:
    writer = write(tmp_path / "bag", 3)
    file = tmp_path / "bag" / "bag.mcap"
    assert not chunks_of(file)

    writer.flush()

    (chunk,) = chunks_of(file)
    assert chunk.data.count(HELLO) == 3
    writer.close()


def test_what_was_flushed_is_seen_by_another_connection_to_the_database(tmp_path: Path) -> None:
    writer = write(tmp_path / "bag", 3, storage="sqlite3")
    count = "SELECT count(*) FROM messages"
    with closing(sqlite3.connect(tmp_path / "bag" / "bag.db3")) as database:
        assert database.execute(count).fetchone() == (0,)

        writer.flush()

        assert database.execute(count).fetchone() == (3,)
    writer.close()


def test_flushing_again_without_a_new_message_makes_no_chunk(tmp_path: Path) -> None:
    writer = write(tmp_path / "bag", 1)
    for _ in range(5):
        writer.flush()

    assert len(chunks_of(tmp_path / "bag" / "bag.mcap")) == 1
    writer.close()


@EACH_KIND
def test_messages_after_a_flush_are_in_the_recording_as_well(
    tmp_path: Path, storage: str, compression: str
) -> None:
    writer = BagWriter(tmp_path / "bag", storage=storage, compression=compression)
    writer.flush()
    for number, topic in enumerate(("/a", "/b")):
        writer.add_topic(topic, String, QOS)
        writer.flush()
        writer.write(topic, HELLO, number)
        writer.flush()
    writer.write("/a", HELLO, 2)
    writer.close()

    assert [message.topic for message in read_messages(tmp_path / "bag")] == ["/a", "/b", "/a"]
    with pytest.raises(RecordingError, match="bag is closed"):
        writer.flush()


def test_rosbags_still_has_the_insides_that_flushing_needs(tmp_path: Path) -> None:
    """It fails where a new rosbags has others: then nothing would be flushed, and nobody told."""
    for plugin, kind in ((StoragePlugin.MCAP, McapWriter), (StoragePlugin.SQLITE3, Sqlite3Writer)):
        writer = Writer(tmp_path / plugin.name, version=9, storage_plugin=plugin)
        writer.open()
        storage = writer.storage
        assert isinstance(storage, kind)
        if isinstance(storage, McapWriter):
            assert not storage.chunk.msgs
            assert callable(storage.close_chunk)
            assert callable(storage.bio.flush)
        else:
            assert isinstance(storage.conn, sqlite3.Connection)
        writer.abort()


# Full disks and wrong directories


@EACH_KIND
def test_a_full_disk_at_a_flush_is_one_clear_error_and_ends_the_recording(
    tmp_path: Path, storage: str, compression: str
) -> None:
    writer = write(tmp_path / "bag", 0, storage=storage, compression=compression)
    writer.flush()
    with file_size_limit(60_000):
        for number in range(100):
            writer.write("/text", os.urandom(2000), number)
        with pytest.raises(RecordingError, match=r"^recording .* is incomplete, cannot write: \w"):
            writer.flush()
        with pytest.raises(RecordingError, match="bag is closed"):
            writer.write("/text", HELLO, 2)
        writer.close()


@EACH_STORAGE
def test_a_disk_that_is_full_at_the_end_is_one_clear_error(tmp_path: Path, storage: str) -> None:
    writer = write(tmp_path / "bag", 0, storage=storage)
    writer.flush()
    writer.write("/text", bytes(100_000), 1)
    with file_size_limit(60_000), pytest.raises(RecordingError, match="incomplete, cannot write"):
        writer.close()


def test_a_disk_that_is_full_at_the_start_leaves_nothing_behind(tmp_path: Path) -> None:
    with (
        file_size_limit(1000),
        pytest.raises(RecordingError, match=r"^cannot create recording .*bag: \w"),
    ):
        BagWriter(tmp_path / "bag", storage="sqlite3")
    assert not (tmp_path / "bag").exists()


@EACH_STORAGE
def test_an_existing_directory_and_a_path_below_a_file_are_refused(
    tmp_path: Path, storage: str
) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match="bag exists already; remove it or choose another"):
        BagWriter(tmp_path / "bag", storage=storage)
    with pytest.raises(RecordingError, match=r"cannot create recording .*: Not a directory"):
        BagWriter(tmp_path / "file" / "bag", storage=storage)
