"""The files of recordings against the format's specification and independent readers.

`records` parses by the text of the MCAP specification alone.
"""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from mcap.stream_reader import CRCValidationError
from rclpy.qos import QoSProfile
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

from actuated_characters.bags.format.definitions import read_definition
from actuated_characters.bags.reader import RecordedMessage, read_messages
from actuated_characters.bags.writer import BagWriter
from actuated_characters.recorder.recovery import recover
from msgs_config.errors import RecordingError
from tests.support.foreign_bags import TextMessage

MAGIC = b"\x89MCAP0\r\n"
MESSAGE, CHUNK, METADATA, FOOTER = 0x05, 0x06, 0x0C, 0x02
SENT = [("/a", 5), ("/b", 5), ("/a", 5), ("/a", 3), ("/b", 4), ("/a", 9)]  # topic, log time in ns
NUMBERS = [1, 1, 2, 3, 2, 4]


def write(path: Path, **options: str) -> Path:
    """A bag of two chunks."""
    with BagWriter(path, **options) as bag:
        for topic in ("/a", "/b"):
            bag.add_topic(topic, "std_msgs/msg/String", QoSProfile(depth=10))
        for place, (topic, log_time_ns) in enumerate(SENT):
            raw = TextMessage(topic, place, f"text {place}").cdr
            bag.write(topic, raw, log_time_ns, 1_000_000 + place)
            if place == 2:
                bag.flush()
    return path


def file_of(bag: Path) -> Path:
    return bag / f"{bag.name}.mcap"


def records(raw: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Kind, place and content of the records that follow each other in some bytes."""
    at = 0
    while at < len(raw):
        kind, length = struct.unpack_from("<BQ", raw, at)
        yield kind, at, raw[at + 9 : at + 9 + length]
        at += 9 + length


def chunks(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Checksum and records of each chunk of a file without compression."""
    for kind, _, body in records(content[8:-8]):
        if kind == CHUNK:
            (checksum,) = struct.unpack_from("<I", body, 24)
            (name,) = struct.unpack_from("<I", body, 28)
            yield checksum, body[32 + name + 8 :]


def unclosed(bag: Path) -> Path:
    """What is left of a bag whose recorder was killed."""
    file = file_of(bag)
    content = file.read_bytes()
    (end,) = [8 + at for kind, at, _ in records(content[8:-8]) if kind == METADATA]
    file.write_bytes(content[:end])
    (bag / "metadata.yaml").unlink()
    return bag


def test_messages_have_number_log_time_and_time_of_publishing_where_the_format_has_them(
    tmp_path: Path,
) -> None:
    content = file_of(write(tmp_path / "bag")).read_bytes()

    assert content[:8] == content[-8:] == MAGIC
    found = [
        struct.unpack_from("<HIQQ", body)
        for _, chunk in chunks(content)
        for kind, _, body in records(chunk)
        if kind == MESSAGE
    ]
    channels = {"/a": 1, "/b": 2}
    assert found == [
        (channels[topic], number, log_time_ns, 1_000_000 + place)
        for place, ((topic, log_time_ns), number) in enumerate(zip(SENT, NUMBERS, strict=True))
    ]


def test_checksums_are_those_of_chunks_and_summary(tmp_path: Path) -> None:
    content = file_of(write(tmp_path / "bag")).read_bytes()

    known = list(chunks(content))
    assert len(known) == 2
    assert [checksum for checksum, _ in known] == [zlib.crc32(raw) for _, raw in known]
    *_, (kind, at, body) = records(content[8:-8])
    start, _, checksum = struct.unpack("<QQI", body)
    assert (kind, checksum) == (FOOTER, zlib.crc32(content[start : 8 + at + 9 + 16]))


@pytest.mark.parametrize("compression", ["none", "zstd"])
def test_an_independent_reader_confirms_checksums_numbers_and_times(
    tmp_path: Path, compression: str
) -> None:
    with file_of(write(tmp_path / "bag", compression=compression)).open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = [
            (channel.topic, message.log_time, message.sequence, message.publish_time - 1_000_000)
            for _, channel, message in reader.iter_messages(log_time_order=False)
        ]
        summary = reader.get_summary()

    expected = [(*sent, n, k) for k, (sent, n) in enumerate(zip(SENT, NUMBERS, strict=True))]
    assert found == expected
    assert summary is not None
    for channel in summary.channels.values():
        assert (
            channel.metadata["topic_type_hash"] == read_definition("std_msgs/msg/String").type_hash
        )
        assert yaml.safe_load(channel.metadata["offered_qos_profiles"])[0]["depth"] == 10


def test_a_flipped_byte_in_a_message_is_one_clear_line(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag")
    content = bytearray(file_of(bag).read_bytes())
    content[content.index(b"text 4") + 5] ^= 1
    file_of(bag).write_bytes(content)

    with file_of(bag).open("rb") as file, pytest.raises(CRCValidationError):
        list(make_reader(file, validate_crcs=True).iter_messages())
    with pytest.raises(RecordingError) as raised:
        list(read_messages(bag))

    assert str(raised.value) == (
        f"cannot read recording {bag}: bag.mcap: it cannot be read whole: damaged chunk (1); "
        f"'actuated_characters info {bag.parent} --recover' keeps what is whole of it"
    )


@pytest.mark.slow
@pytest.mark.parametrize("apart", [7, pytest.param(1, marks=pytest.mark.nightly)])
def test_a_flipped_byte_anywhere_is_found_or_harmless(tmp_path: Path, apart: int) -> None:
    bag = write(tmp_path / "bag")
    sound, content = list(read_messages(bag)), file_of(bag).read_bytes()
    checked = [
        range(content.index(raw), content.index(raw) + len(raw)) for _, raw in chunks(content)
    ]
    footer = len(content) - 8 - 29
    (summary,) = struct.unpack_from("<Q", content, footer + 9)
    checked.append(range(summary, footer))

    for at in range(0, len(content), apart):
        damaged = bytearray(content)
        damaged[at] ^= 0x10
        file_of(bag).write_bytes(damaged)
        try:
            read: list[RecordedMessage] | None = list(read_messages(bag))
        except RecordingError as error:
            assert "\n" not in str(error)
            read = None
        assert read in (None, sound), f"byte {at}"
        assert read is None or not any(at in part for part in checked), f"byte {at}"


@pytest.mark.parametrize(
    ("variable", "distro"), [(None, "jazzy"), ("", "jazzy"), ("kilted", "kilted"), ("a: b", "a: b")]
)
def test_metadata_and_files_name_the_distribution(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    variable: str | None,
    distro: str,
) -> None:
    monkeypatch.delenv("ROS_DISTRO", raising=False)
    if variable is not None:
        monkeypatch.setenv("ROS_DISTRO", variable)

    bag = write(tmp_path / "bag")

    information = yaml.safe_load((bag / "metadata.yaml").read_text())
    assert information["rosbag2_bagfile_information"]["ros_distro"] == distro
    inside = yaml.safe_load(serialized_metadata(bag))
    assert inside == information["rosbag2_bagfile_information"]
    suffixes = sorted(path.suffix for path in bag.iterdir() if "lock" not in path.name)
    assert suffixes == [".mcap", ".yaml"]
    with Reader(bag) as reader:
        assert reader.ros_distro == distro


def serialized_metadata(bag: Path) -> Any:
    """The metadata that the file itself has, by rosbag2's names."""
    with file_of(bag).open("rb") as file:
        (record,) = make_reader(file).iter_metadata()
    assert record.name == "rosbag2"
    return record.metadata["serialized_metadata"]


@pytest.mark.parametrize("log_time", ["wall", "simulated"])
@pytest.mark.parametrize("alone", [False, True], ids=["bag", "file"])
def test_the_clock_of_the_log_times_is_known_of_a_bag_and_of_its_file_alone(
    tmp_path: Path, log_time: str, alone: bool
) -> None:
    bag = write(tmp_path / "bag", log_time=log_time)

    information = yaml.safe_load((bag / "metadata.yaml").read_text())
    custom = information["rosbag2_bagfile_information"]["custom_data"]
    assert custom == ({"log_time": "simulated"} if log_time == "simulated" else None)
    read_from = file_of(bag) if alone else bag
    found = [(m.topic, m.log_time_ns, m.published_ns) for m in read_messages(read_from)]
    published: list[int | None] = [t for _, t in SENT]
    if log_time == "simulated":
        published = [1_000_000 + place for place in range(len(SENT))]
    every = [(*sent, time) for sent, time in zip(SENT, published, strict=True)]
    assert found == sorted(every, key=lambda each: each[1])
    with AnyReader([bag]) as reader:
        assert [(c.topic, t) for c, t, _ in reader.messages()] == [each[:2] for each in found]


@pytest.mark.parametrize("log_time", ["wall", "simulated"])
def test_a_recovered_bag_keeps_numbers_and_both_times(tmp_path: Path, log_time: str) -> None:
    bag = write(tmp_path / "bag", log_time=log_time)
    sound = list(read_messages(bag))

    recover(unclosed(bag))

    assert list(read_messages(bag)) == sound
    with file_of(bag).open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = [message.sequence for _, _, message in reader.iter_messages(log_time_order=False)]
    assert found == NUMBERS


def test_a_chunk_that_recovery_leaves_out_is_a_gap_in_the_numbers(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag")
    content = bytearray(file_of(bag).read_bytes())
    content[content.index(b"text 1") + 5] ^= 1  # in the first of the two chunks
    file_of(bag).write_bytes(content)

    recover(bag)

    with file_of(bag).open("rb") as file:
        found = [m.sequence for _, _, m in make_reader(file).iter_messages(log_time_order=False)]
    assert found == NUMBERS[3:]


@pytest.mark.parametrize("published_ns", [-1, 2**63])
def test_a_time_of_publishing_out_of_range_is_refused(tmp_path: Path, published_ns: int) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/a", "std_msgs/msg/String", QoSProfile(depth=10))
        with pytest.raises(RecordingError, match=f"time of publishing {published_ns} ns is not"):
            bag.write("/a", b"", 1, published_ns)
        bag.write("/a", b"", 1)

    assert len(list(read_messages(tmp_path / "bag"))) == 1
