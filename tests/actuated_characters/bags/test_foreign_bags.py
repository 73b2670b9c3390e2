"""Bags that other programs wrote, of several versions of rosbag2, and files without a bag."""

from pathlib import Path

import pytest
from backports import zstd
from mcap.writer import CompressionType, IndexType

from actuated_characters.bags.format.storage import FileStatistics
from actuated_characters.bags.reader import open_bag, read_messages
from actuated_characters.report.contents import read_contents
from msgs_config.errors import RecordingError
from tests.support.foreign_bags import (
    SENT,
    TextMessage,
    texts,
    write_humble_db3,
    write_jazzy_db3,
    write_mcap,
    write_metadata,
)

UNORDERED = SENT[10:] + SENT[:10]
COUNTED = ({"/a": 20, "/b": 10}, 0, 29)


def counted(bag: Path) -> FileStatistics:
    """Messages by topic, and the first and the last log time."""
    with open_bag(bag) as file:
        return file.statistics()


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    (tmp_path / "bag").mkdir()
    return tmp_path / "bag"


# Versions


@pytest.mark.parametrize("version", [1, 2, 3, 4, 5, 6, 7, 8, 9])
def test_a_bag_of_humble_and_each_other_version_is_read_from_sqlite(
    bag: Path, version: int
) -> None:
    (write_jazzy_db3 if version == 9 else write_humble_db3)(bag / "bag_0.db3", SENT)
    prefix = "bag/" if version < 4 else ""  # then relative to the parent
    write_metadata(bag, version, "sqlite3", [f"{prefix}bag_0.db3"], ["/a", "/b"])

    assert texts(bag) == SENT


@pytest.mark.parametrize("version", [9, 10, 17])
@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_bag_of_jazzy_and_later_is_read_from_mcap(
    bag: Path, version: int, compression: CompressionType
) -> None:
    write_mcap(bag / "bag_0.mcap", SENT, compression=compression)
    write_metadata(bag, version, "mcap", ["bag_0.mcap"], ["/a", "/b"], new_field={"of": "later"})

    assert texts(bag) == SENT


def test_a_later_version_without_a_field_that_is_needed_is_named(bag: Path) -> None:
    write_mcap(bag / "bag_0.mcap", SENT)
    write_metadata(bag, 10, "mcap", [], ["/a"], relative_file_paths=None)

    with pytest.raises(RecordingError, match=r"version 10, later than 9\) lacks a field or has"):
        texts(bag)


@pytest.mark.parametrize("suffix", ["mcap", "db3"])
@pytest.mark.parametrize("storage", ["", None])
def test_a_bag_that_humble_has_reindexed_is_read_by_the_suffix_of_its_files(
    bag: Path, storage: str | None, suffix: str
) -> None:
    names = [f"bag_{number}.{suffix}" for number in range(2)]
    for name, part in zip(names, (SENT[:15], SENT[15:]), strict=True):
        (write_mcap if suffix == "mcap" else write_humble_db3)(bag / name, part)
    write_metadata(bag, 5, "", names, ["/a", "/b"], storage_identifier=storage)

    assert texts(bag) == SENT
    assert read_contents(bag).storage == ("mcap" if suffix == "mcap" else "sqlite3")


def test_a_reindexed_bag_of_compressed_files_is_read(bag: Path) -> None:
    file = write_humble_db3(bag / "bag_0.db3", SENT)
    (bag / "bag_0.db3.zstd").write_bytes(zstd.compress(file.read_bytes()))
    file.unlink()
    compression = {"compression_mode": "FILE", "compression_format": "zstd"}
    write_metadata(bag, 5, "", ["bag_0.db3.zstd"], ["/a", "/b"], **compression)

    assert texts(bag) == SENT


# Several files, compressed ones


@pytest.mark.parametrize("suffix", ["mcap", "db3"])
def test_the_files_of_a_split_bag_are_read_as_one_by_log_time(bag: Path, suffix: str) -> None:
    names = [f"bag_{number}.{suffix}" for number in range(3)]
    parts = [SENT[:10], [*SENT[10:20], SENT[25]], [*SENT[20:25], *SENT[26:]]]  # 25 came too early
    for name, part in zip(names, parts, strict=True):
        (write_mcap if suffix == "mcap" else write_humble_db3)(bag / name, part)
    storage = "mcap" if suffix == "mcap" else "sqlite3"
    write_metadata(bag, 9, storage, names, ["/a", "/b"])

    assert texts(bag) == SENT
    assert counted(bag) == COUNTED


@pytest.mark.parametrize("mode", ["FILE", "file"])
def test_files_that_are_compressed_as_a_whole_are_read(bag: Path, mode: str) -> None:
    names = ["bag_0.db3", "bag_1.db3"]
    for name, part in zip(names, (SENT[:15], SENT[15:]), strict=True):
        file = write_humble_db3(bag / name, part)
        (bag / f"{name}.zstd").write_bytes(zstd.compress(file.read_bytes()))
        file.unlink()
    write_metadata(
        bag,
        5,
        "sqlite3",
        [f"{name}.zstd" for name in names],
        ["/a", "/b"],
        compression_mode=mode,
        compression_format="zstd",
    )

    assert texts(bag) == SENT


def test_messages_that_are_compressed_one_by_one_are_read(
    bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    uncompressed = TextMessage.cdr
    monkeypatch.setattr(
        TextMessage, "cdr", property(lambda sent: zstd.compress(uncompressed.fget(sent)))
    )
    write_humble_db3(bag / "bag_0.db3", SENT)
    write_metadata(
        bag,
        6,
        "sqlite3",
        ["bag_0.db3"],
        ["/a", "/b"],
        compression_mode="MESSAGE",
        compression_format="zstd",
    )

    assert texts(bag) == SENT


# One file, in any order, with any index


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"compression": CompressionType.NONE},
        {"use_chunking": False},
        {"index_types": IndexType.NONE},
        {"index_types": IndexType.CHUNK},
        {"use_statistics": False, "use_summary_offsets": False},
        {"repeat_channels": False, "repeat_schemas": False},
        {"chunk_size": 1 << 20},
    ],
    ids=str,
)
@pytest.mark.parametrize("sent", [SENT, UNORDERED], ids=["ordered", "unordered"])
def test_a_single_mcap_file_is_read_by_log_time(
    tmp_path: Path, options: dict[str, object], sent: list[TextMessage]
) -> None:
    file = write_mcap(tmp_path / "from_foxglove.mcap", sent, **options)  # type: ignore[arg-type]

    assert texts(file) == SENT
    assert [each.topic for each in read_messages(file, ["/b"])] == ["/b"] * 10
    assert counted(file) == COUNTED


def test_a_single_sqlite_file_is_read(tmp_path: Path) -> None:
    file = write_humble_db3(tmp_path / "one.db3", UNORDERED)

    assert texts(file) == SENT
    assert counted(file) == COUNTED


def test_a_topic_without_messages_is_known_from_the_metadata(bag: Path) -> None:
    write_mcap(bag / "bag_0.mcap", SENT)
    write_metadata(bag, 9, "mcap", ["bag_0.mcap"], ["/a", "/b", "/silent"])

    assert list(read_messages(bag, ["/silent"])) == []
    with pytest.raises(RecordingError, match="unknown topic '/c'; there are: /a, /b, /silent"):
        list(read_messages(bag, ["/c"]))


# What cannot be read


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"storage_identifier": "rosbag_v2"}, "unknown storage 'rosbag_v2'; there are: mcap, sql"),
        ({"storage_identifier": ["mcap"]}, "lacks a field or has one of a wrong type"),
        ({"version": "nine"}, "metadata.yaml is damaged"),
        ({"relative_file_paths": 3}, "lacks a field or has one of a wrong type"),
        ({"relative_file_paths": ["elsewhere.mcap"]}, "its file elsewhere.mcap is missing"),
        (
            {"relative_file_paths": ["metadata.yaml"]},
            "metadata.yaml is a YAML file, not a file of a bag",
        ),
        ({"topics_with_message_count": {"a": 1}}, "lacks a field or has one of a wrong type"),
        ({"compression_mode": 5}, "lacks a field or has one of a wrong type"),
        ({"compression_mode": "half"}, "unknown compression mode 'half'"),
        (
            {"compression_mode": "FILE", "compression_format": "lz4"},
            "unknown compression 'lz4'; there are: zstd",
        ),
    ],
)
def test_metadata_that_cannot_be_used_is_one_clear_line(
    bag: Path, changes: dict[str, object], sentence: str
) -> None:
    write_mcap(bag / "bag_0.mcap", SENT)
    write_metadata(bag, 9, "mcap", ["bag_0.mcap"], ["/a", "/b"])
    text = (bag / "metadata.yaml").read_text()
    write_metadata(bag, 9, "mcap", ["bag_0.mcap"], ["/a", "/b"], **changes)
    assert (bag / "metadata.yaml").read_text() != text

    with pytest.raises(RecordingError, match=sentence) as caught:
        texts(bag)

    assert str(bag) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text", ["", "[]", "a: b", "{", "\0", "rosbag2_bagfile_information: 7", "!!python/object:x {}"]
)
def test_metadata_that_is_none_is_one_clear_line(bag: Path, text: str) -> None:
    (bag / "metadata.yaml").write_text(text)

    with pytest.raises(RecordingError, match=r"^cannot read recording .*: metadata.yaml is damag"):
        texts(bag)


def test_a_file_of_no_ros_or_of_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="'/b' is serialised as json, not as cdr"):
        texts(write_mcap(tmp_path / "json.mcap", SENT, serialization="json"))
    with pytest.raises(RecordingError, match="its profile is not 'ros2'"):
        texts(write_mcap(tmp_path / "other.mcap", SENT, profile="x"))
    (tmp_path / "notes.txt").write_text("hello")
    with pytest.raises(RecordingError, match=r"notes.txt is no .mcap or .db3 file"):
        texts(tmp_path / "notes.txt")


def test_an_sqlite_file_beside_its_journal_is_not_taken_for_complete(bag: Path) -> None:
    write_humble_db3(bag / "bag_0.db3", SENT)
    write_metadata(bag, 5, "sqlite3", ["bag_0.db3"], ["/a", "/b"])
    (bag / "bag_0.db3-journal").write_bytes(b"what was not committed")

    with pytest.raises(RecordingError, match=r"was never closed, .*; 'sqlite3 bag_0.db3 .tables'"):
        texts(bag)
