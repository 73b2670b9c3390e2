"""Files that were cut off, damaged, split or compressed: what of them `recover` finds, and says."""

import os
from pathlib import Path

import pytest
from backports import zstd
from mcap.writer import CompressionType
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from std_msgs.msg import String

from experiment.bags.definitions import read_definition
from experiment.bags.recover import recover
from tests.foreign_bags import (
    SAID,
    Said,
    texts,
    write_humble_db3,
    write_jazzy_db3,
    write_mcap,
)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    (tmp_path / "bag").mkdir()
    return tmp_path / "bag"


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_truncated_file_of_ros2_bag_record_is_recovered_up_to_the_cut(
    bag: Path, compression: CompressionType
) -> None:
    file = write_mcap(bag / "bag_0.mcap", SAID, compression=compression, chunk_size=150)
    size = file.stat().st_size
    os.truncate(file, size // 2)

    recovered = recover(bag)

    read = texts(bag)
    assert read == SAID[: len(read)]
    assert 5 < len(read) < len(SAID)
    (lost,) = recovered.contents.lost
    assert lost.startswith("bag_0.mcap: ")
    with Reader(bag) as reader:
        assert {connection.digest for connection in reader.connections} == {"RIHS01_ab"}


def test_messages_in_a_plain_chunk_that_was_cut_off_are_kept(bag: Path) -> None:
    file = write_mcap(
        bag / "bag_0.mcap", SAID, compression=CompressionType.NONE, chunk_size=1 << 20
    )
    last = file.read_bytes().index(SAID[20].cdr)
    os.truncate(file, last + 3)  # in the middle of number 20

    recover(bag)

    assert texts(bag) == SAID[:20]


def test_a_damaged_chunk_in_the_middle_is_left_out_and_said(bag: Path) -> None:
    file = write_mcap(
        bag / "bag_0.mcap", SAID, compression=CompressionType.NONE, chunk_size=150, close=False
    )
    data = bytearray(file.read_bytes())
    data[data.index(SAID[15].cdr) + 10] ^= 1
    file.write_bytes(data)

    recovered = recover(bag)

    read = texts(bag)
    assert SAID[15] not in read
    assert {SAID[0], SAID[-5]} <= set(read)
    assert read == [said for said in SAID if said in read]
    assert "bytes" in recovered.contents.lost[0]


def test_topics_whose_first_chunk_is_damaged_are_taken_from_the_files_end(bag: Path) -> None:
    file = write_mcap(bag / "bag_0.mcap", SAID, compression=CompressionType.NONE, chunk_size=150)
    data = bytearray(file.read_bytes())
    data[data.index(SAID[0].cdr) + 10] ^= 1
    file.write_bytes(data)
    (bag / "metadata.yaml").write_text("cut off")

    recover(bag)

    assert SAID[-1] in texts(bag)


def test_a_cut_sqlite_file_gives_what_lies_before_the_cut(bag: Path) -> None:
    many = [Said("/a", number, f"text {number}" * 50) for number in range(500)]
    file = write_humble_db3(bag / "bag_0.db3", many)
    os.truncate(file, file.stat().st_size // 2 // 4096 * 4096)

    recovered = recover(bag)

    read = texts(bag)
    assert read == many[: len(read)]
    assert 100 < len(read) < 400
    assert recovered.contents.lost[0].startswith("bag_0.db3: what comes after")


def test_an_sqlite_file_of_jazzy_keeps_its_definitions_and_hashes(bag: Path) -> None:
    write_jazzy_db3(bag / "bag_0.db3", SAID)

    recover(bag)

    assert texts(bag) == SAID
    with Reader(bag) as reader:
        assert {connection.digest for connection in reader.connections} == {"RIHS01_ab"}
        assert {connection.msgdef.data for connection in reader.connections} == {"string data"}


def test_split_files_come_together_in_the_order_of_their_numbers(bag: Path) -> None:
    for number in range(12):
        part = SAID[number * 2 : number * 2 + 2]
        write_mcap(bag / f"bag_{number}.mcap", part, chunk_size=1, close=number < 11)

    recover(bag)

    assert texts(bag) == SAID[:24]
    assert [file.name for file in bag.glob("*.mcap")] == ["bag.mcap"]


def test_files_and_messages_that_rosbag2_compressed_are_recovered(
    bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = Said.cdr
    monkeypatch.setattr(Said, "cdr", property(lambda said: zstd.compress(plain.fget(said))))
    file = write_humble_db3(bag / "bag_0.db3", SAID[:20])
    (bag / "bag_0.db3.zstd").write_bytes(zstd.compress(file.read_bytes()))
    file.unlink()
    write_humble_db3(bag / "bag_1.db3", SAID[20:])

    recover(bag)

    assert texts(bag) == SAID


def test_a_type_that_is_not_installed_is_recovered_with_the_hash_of_its_text(bag: Path) -> None:
    file = write_mcap(bag / "bag_0.mcap", SAID, close=False, compression=CompressionType.NONE)
    data = file.read_bytes().replace(b"std_msgs/msg/String", b"own_msgs/msg/Sample")
    data = data.replace(b"topic_type_hash", b"topic_type_hasx")
    (bag / "bag_0.mcap").write_bytes(_without_checksums(data))

    recover(bag)

    with AnyReader([bag]) as reader:
        (digest,) = {connection.digest for connection in reader.connections}
        assert {c.msgtype for c in reader.connections} == {"own_msgs/msg/Sample"}
    assert digest.startswith("RIHS01_")
    assert digest != read_definition(String).type_hash


def _without_checksums(data: bytes) -> bytes:
    """An MCAP file whose chunks' checksums are unset, which the format allows."""
    out, position = bytearray(data), 8
    while position < len(data):
        length = int.from_bytes(data[position + 1 : position + 9], "little")
        if data[position] == 6:
            out[position + 9 + 24 : position + 9 + 28] = bytes(4)
        position += 9 + length
    return bytes(out)
