"""Files that were cut off, damaged, split or compressed: the parts that a recovery finds."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from backports import zstd
from mcap.writer import CompressionType
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

from actuated_characters.bags.format.definitions import read_definition
from actuated_characters.bags.reader import read_messages
from actuated_characters.recorder.recovery import recover
from msgs_config.errors import RecordingError
from tests.support.foreign_bags import (
    SENT,
    TextMessage,
    texts,
    write_humble_db3,
    write_mcap,
    write_metadata,
)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    (tmp_path / "bag").mkdir()
    return tmp_path / "bag"


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_truncated_file_of_ros2_bag_record_is_recovered_up_to_the_cut(
    bag: Path, compression: CompressionType
) -> None:
    file = write_mcap(bag / "bag_0.mcap", SENT, compression=compression, chunk_size=150)
    chunks = [each for each in records(file.read_bytes()) if each[0] == CHUNK]
    _, begin, end = chunks[len(chunks) // 2]
    os.truncate(file, (begin + end) // 2)

    recovered = recover(bag)

    read = texts(bag)
    assert read == SENT[: len(read)]
    assert 5 < len(read) < len(SENT)
    (part,) = recovered.contents.unreadable
    assert part.startswith("bag_0.mcap: ")
    with Reader(bag) as reader:
        assert {connection.digest for connection in reader.connections} == {"RIHS01_ab"}


def test_a_damaged_chunk_in_the_middle_is_left_out_and_said(bag: Path) -> None:
    file = write_mcap(
        bag / "bag_0.mcap", SENT, compression=CompressionType.NONE, chunk_size=150, close=False
    )
    data = bytearray(file.read_bytes())
    data[data.index(SENT[15].cdr) + 10] ^= 1
    file.write_bytes(data)

    recovered = recover(bag)

    read = texts(bag)
    assert SENT[15] not in read
    assert {SENT[0], SENT[-5]} <= set(read)
    assert read == [sent for sent in SENT if sent in read]
    assert recovered.contents.unreadable == ["bag_0.mcap: damaged chunk (1)"]


def test_topics_whose_first_chunk_is_damaged_are_taken_from_the_files_end(bag: Path) -> None:
    file = write_mcap(bag / "bag_0.mcap", SENT, compression=CompressionType.NONE, chunk_size=150)
    data = bytearray(file.read_bytes())
    data[data.index(SENT[0].cdr) + 10] ^= 1
    file.write_bytes(data)
    (bag / "metadata.yaml").write_text("cut off")

    recover(bag)

    assert SENT[-1] in texts(bag)


def test_split_files_come_together_in_the_order_of_their_numbers(bag: Path) -> None:
    for number in range(12):
        part = SENT[number * 2 : number * 2 + 2]
        write_mcap(bag / f"bag_{number}.mcap", part, chunk_size=1, close=number < 11)

    recover(bag)

    assert texts(bag) == SENT[:24]
    assert [file.name for file in bag.glob("*.mcap")] == ["bag.mcap"]


def test_a_type_that_is_not_installed_is_recovered_with_the_hash_of_its_text(bag: Path) -> None:
    file = write_mcap(bag / "bag_0.mcap", SENT, close=False, compression=CompressionType.NONE)
    data = file.read_bytes().replace(b"std_msgs/msg/String", b"own_msgs/msg/Sample")
    data = data.replace(b"topic_type_hash", b"topic_type_hasx")
    (bag / "bag_0.mcap").write_bytes(_without_checksums(data))

    recover(bag)

    with AnyReader([bag]) as reader:
        (digest,) = {connection.digest for connection in reader.connections}
        assert {c.msgtype for c in reader.connections} == {"own_msgs/msg/Sample"}
    assert digest.startswith("RIHS01_")
    assert digest != read_definition("std_msgs/msg/String").type_hash


def _without_checksums(data: bytes) -> bytes:
    """An MCAP file whose chunks' checksums are unset, which the format allows."""
    out, position = bytearray(data), 8
    while position < len(data):
        length = int.from_bytes(data[position + 1 : position + 9], "little")
        if data[position] == 6:
            out[position + 9 + 24 : position + 9 + 28] = bytes(4)
        position += 9 + length
    return bytes(out)


# Lengths that lie


def records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Kind, begin and end of the records of an MCAP file."""
    position = 8
    while position + 9 <= len(data):
        length = int.from_bytes(data[position + 1 : position + 9], "little")
        yield data[position], position, position + 9 + length
        position += 9 + length


CHUNK, MESSAGE_INDEX, FOOTER = 6, 7, 2
DATA_LENGTH = 9 + 28 + 4  # bytes into a chunk that is not compressed
ENTRIES_LENGTH = 9 + 2  # bytes into a message's index


@pytest.mark.parametrize("bit", [3, 16, 47, 63])
def test_of_a_chunk_whose_inner_length_lies_nothing_else_is_lost(bag: Path, bit: int) -> None:
    file = uncompressed(bag)
    data = bytearray(file.read_bytes())
    _, begin, end = [each for each in records(bytes(data)) if each[0] == CHUNK][2]
    gone = {sent for sent in SENT if sent.cdr in data[begin:end]}
    data[begin + DATA_LENGTH + bit // 8] ^= 1 << bit % 8
    file.write_bytes(data)

    recovered = recover(bag)

    if bit in (16, 47):  # the record ends where it ends
        assert texts(bag) == SENT and recovered.contents.unreadable == []
    else:
        assert texts(bag) == [sent for sent in SENT if sent not in gone]
        assert recovered.contents.unreadable == ["bag_0.mcap: damaged chunk (1)"]


@pytest.mark.parametrize(("kind", "bit"), [(CHUNK, 2), (MESSAGE_INDEX, 3), (CHUNK, 0), (CHUNK, 4)])
def test_a_record_of_another_kind_ends_nothing(bag: Path, kind: int, bit: int) -> None:
    """By one bit a chunk is a footer, an index or unknown, and an index the end of the data."""
    file = uncompressed(bag)
    data = bytearray(file.read_bytes())
    _, begin, end = [each for each in records(bytes(data)) if each[0] == kind][2]
    gone = {sent for sent in SENT if kind == CHUNK and sent.cdr in data[begin:end]}
    data[begin] ^= 1 << bit
    file.write_bytes(data)

    recovered = recover(bag)

    assert texts(bag) == [sent for sent in SENT if sent not in gone]
    assert bool(recovered.contents.unreadable) == (bit == 4)


@pytest.mark.parametrize("kind", [MESSAGE_INDEX, FOOTER])
def test_a_record_that_no_message_needs_may_be_damaged(bag: Path, kind: int) -> None:
    """The lengths in the indices of chunks, and where the summary begins."""
    file = write_mcap(bag / "bag_0.mcap", SENT, chunk_size=150)
    data = bytearray(file.read_bytes())
    for found, begin, _ in list(records(bytes(data))):
        if found == kind == MESSAGE_INDEX:
            data[begin + ENTRIES_LENGTH + 3] ^= 0x40
        elif found == kind:
            data[begin + 9 : begin + 17] = (8).to_bytes(8, "little")  # among the messages
    file.write_bytes(data)
    (bag / "metadata.yaml").write_text("cut off")

    recovered = recover(bag)

    assert texts(bag) == SENT and recovered.contents.unreadable == []


@pytest.mark.parametrize("left", [1, 8, 9, 10])
def test_the_head_of_a_record_without_its_content_is_no_loss(bag: Path, left: int) -> None:
    """A killed recorder may have written the nine bytes alone: no message was behind them."""
    file = uncompressed(bag)
    begins = [begin for kind, begin, _ in records(file.read_bytes()) if kind == CHUNK]
    os.truncate(file, begins[-1] + left)

    recovered = recover(bag)

    read = texts(bag)
    assert read == SENT[: len(read)] and len(read) > len(SENT) // 2
    assert recovered.contents.unreadable == (
        [] if left < 10 else ["bag_0.mcap: bytes cut off (10)"]
    )


def test_a_tail_of_zeros_is_no_record(bag: Path) -> None:
    file = uncompressed(bag)
    with file.open("ab") as stream:
        stream.truncate(file.stat().st_size + (1 << 30))

    recovered = recover(bag)

    assert texts(bag) == SENT
    assert recovered.contents.unreadable == [f"bag_0.mcap: bytes cut off ({1 << 30})"]


def test_a_message_that_is_cut_off_swallows_none_behind_it(bag: Path) -> None:
    file = uncompressed(bag)
    data = bytearray(file.read_bytes())
    _, begin, end = next(each for each in records(bytes(data)) if each[0] == CHUNK)
    inside = DATA_LENGTH + 8
    message = next(
        each for each in records(bytes(8) + bytes(data[begin + inside : end])) if each[0] == 5
    )
    data[begin + inside + message[1] - 8 + 2] ^= 1  # 256 bytes more
    file.write_bytes(data)

    recovered = recover(bag)

    assert texts(bag) == [sent for sent in SENT if sent.cdr not in data[begin:end]]
    assert "bytes cut off" in recovered.contents.unreadable[0]


def test_many_losses_are_one_line(bag: Path) -> None:
    many = [TextMessage("/a", number, f"text {number}") for number in range(3000)]
    file = write_mcap(bag / "bag_0.mcap", many, compression=CompressionType.ZSTD, close=False)
    data = bytearray(file.read_bytes())
    _, begin, end = next(each for each in records(bytes(data)) if each[0] == CHUNK)
    data[(begin + end) // 2] ^= 0x55
    file.write_bytes(data)

    with pytest.raises(RecordingError) as caught:
        recover(bag)

    assert "damaged chunk (1)" in str(caught.value)
    assert "message of a topic that is not announced (29" in str(caught.value)
    assert len(str(caught.value)) < 500


def uncompressed(bag: Path) -> Path:
    """A file of several chunks, not compressed and without checksums."""
    file = write_mcap(
        bag / "bag_0.mcap", SENT, compression=CompressionType.NONE, chunk_size=150, close=False
    )
    file.write_bytes(_without_checksums(file.read_bytes()))
    return file


# What was compressed


@contextmanager
def compressing_each(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Have messages written as `ros2 bag record --compression-mode message` does."""
    uncompressed = TextMessage.cdr
    with monkeypatch.context() as patch:
        patch.setattr(
            TextMessage, "cdr", property(lambda sent: zstd.compress(uncompressed.fget(sent)))
        )
        yield


def test_messages_that_rosbag2_compressed_are_recovered(
    bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with compressing_each(monkeypatch):
        write_mcap(bag / "bag_0.mcap", SENT, compression=CompressionType.NONE, close=False)

    recovered = recover(bag)

    assert texts(bag) == SENT and recovered.contents.unreadable == []


def test_messages_that_rosbag2_compressed_in_a_file_without_an_index_are_read(
    bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with compressing_each(monkeypatch):
        write_mcap(bag / "bag_0.mcap", SENT, use_chunking=False)
    how = {"compression_format": "zstd", "compression_mode": "MESSAGE"}
    write_metadata(bag, 9, "mcap", ["bag_0.mcap"], ["/a", "/b"], **how)

    assert texts(bag) == SENT


def test_a_part_that_was_compressed_as_a_whole_is_not_left_out_in_silence(bag: Path) -> None:
    file = write_mcap(bag / "bag_0.mcap", SENT[:20])
    (bag / "bag_0.mcap.zstd").write_bytes(zstd.compress(file.read_bytes()))
    file.unlink()
    write_mcap(bag / "bag_1.mcap", SENT[20:], close=False)

    with pytest.raises(
        RecordingError, match=r"bag_0.mcap.zstd is compressed as a whole; 'zstd -d'"
    ):
        recover(bag)


def test_an_sqlite_file_needs_no_recovering(bag: Path) -> None:
    write_humble_db3(bag / "bag_0.db3", SENT)

    with pytest.raises(RecordingError, match=r"bag_0.db3 is SQLite's, .*; give the file itself"):
        recover(bag)

    assert [message.raw for message in read_messages(bag / "bag_0.db3")] == [s.cdr for s in SENT]


def test_messages_that_a_bag_cannot_hold_are_left_out_and_named(bag: Path) -> None:
    write_mcap(bag / "bag_0.mcap", SENT[:2])
    write_mcap(bag / "bag_1.mcap", SENT[2:4], serialization="json")
    other = write_mcap(bag / "bag_2.mcap", SENT[4:5], compression=CompressionType.NONE, close=False)
    data = other.read_bytes().replace(b"std_msgs/msg/String", b"own_msgs/msg/Sample")
    other.write_bytes(_without_checksums(data))

    recovered = recover(bag)

    assert texts(bag) == SENT[:2]
    assert recovered.contents.unreadable == [
        "bag_1.mcap: message on '/a' as json, not as cdr (1), "
        "message on '/b' as json, not as cdr (1)",
        "bag_2.mcap: message on '/a' of another type, own_msgs/msg/Sample (1)",
    ]
