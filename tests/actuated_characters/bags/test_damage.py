"""Whatever the bytes of a bag are: messages or one clear error, from reading and recovering."""

import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType
from rclpy.qos import QoSProfile

from actuated_characters.bags.reader import read_messages
from actuated_characters.bags.writer import BagWriter
from actuated_characters.recorder.recovery import recover
from msgs_config.errors import RecordingError
from tests.support.foreign_bags import SENT, to_sqlite, write_humble_db3, write_mcap

pytestmark = pytest.mark.slow

READ, RECOVERED = 45, 12  # damaged copies of each kind of bag


def own(compression: str) -> Callable[[Path], None]:
    def make(bag: Path) -> None:
        with BagWriter(bag, compression=compression) as writer:
            for topic in ("/a", "/b"):
                writer.add_topic(topic, "std_msgs/msg/String", QoSProfile(depth=10))
            for number, sent in enumerate(SENT):
                writer.write(sent.topic, sent.cdr, sent.log_time_ns)
                if number % 10 == 9:
                    writer.flush()

    return make


def sqlite(bag: Path, *, compressed: bool) -> None:
    own("none")(bag.with_name("own"))
    to_sqlite(bag.with_name("own"), bag, compressed=compressed)
    shutil.rmtree(bag.with_name("own"))


def foreign(compression: CompressionType, **options: object) -> Callable[[Path], None]:
    def make(bag: Path) -> None:
        bag.mkdir()
        file = write_mcap(bag / "bag.mcap", SENT, compression=compression, **options)  # type: ignore[arg-type]
        shutil.move(file, bag / "bag_0.mcap")

    return make


def humble(bag: Path) -> None:
    bag.mkdir()
    write_humble_db3(bag / "bag_0.db3", SENT)


KINDS = {
    "mcap": own("none"),
    "mcap zstd": own("zstd"),
    "sqlite3": partial(sqlite, compressed=False),
    "sqlite3 zstd": partial(sqlite, compressed=True),
    "foreign lz4": foreign(CompressionType.LZ4),
    "foreign unindexed": foreign(CompressionType.NONE, index_types=IndexType.NONE),
    "foreign unchunked": foreign(CompressionType.NONE, use_chunking=False),
    "humble": humble,
}


def mutants(sound: bytes, count: int, rng: np.random.Generator) -> Iterator[bytes]:
    """Cut off, flipped in a few bits, with a part overwritten; and then no bag at all."""
    yield b""
    yield rng.bytes(1000)
    for number in range(count):
        damaged = bytearray(sound)
        if number % 3 == 0:
            del damaged[int(rng.integers(len(sound))) :]
        elif number % 3 == 1:
            for _ in range(int(rng.integers(1, 5))):
                damaged[int(rng.integers(len(sound)))] ^= 1 << int(rng.integers(8))
        else:
            start = int(rng.integers(len(sound)))
            damaged[start : start + 20] = rng.bytes(20) if number % 2 else bytes(20)
        yield bytes(damaged)


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def storage_file(bag: Path) -> Path:
    (file,) = (file for file in bag.iterdir() if file.suffix in (".mcap", ".db3"))
    return file


@pytest.mark.parametrize("name", ["storage", "metadata"])
def test_a_damaged_file_is_read_or_is_one_clear_error(tmp_path: Path, kind: str, name: str) -> None:
    bag = tmp_path / "bag"
    KINDS[kind](bag)
    has_metadata = (bag / "metadata.yaml").exists()
    if name == "metadata" and not has_metadata:
        return
    file = storage_file(bag) if name == "storage" else bag / "metadata.yaml"
    sound, path = file.read_bytes(), bag if has_metadata else file
    assert len(list(read_messages(path))) == len(SENT)
    refused = 0
    for damaged in mutants(sound, READ, np.random.default_rng(1)):
        file.write_bytes(damaged)
        try:
            messages = list(read_messages(path))
        except RecordingError as error:
            refused += 1
            assert "\n" not in str(error)
            assert "bag" in str(error)
        else:
            times = [message.log_time_ns for message in messages]
            assert times == sorted(times)
    assert refused > READ // 4


@pytest.mark.parametrize("kind", [each for each in KINDS if each.startswith(("mcap", "foreign"))])
def test_a_damaged_file_is_recovered_or_is_one_clear_error(tmp_path: Path, kind: str) -> None:
    KINDS[kind](tmp_path / "sound")
    sound = storage_file(tmp_path / "sound")
    damaged_copies = mutants(sound.read_bytes(), RECOVERED, np.random.default_rng(3))
    recovered = 0
    for number, damaged in enumerate(damaged_copies):
        bag = tmp_path / f"run_{number}" / "bag"
        bag.mkdir(parents=True)
        (bag / sound.name).write_bytes(damaged)
        try:
            found = recover(bag)
        except RecordingError as error:
            assert "\n" not in str(error)
            assert [file.name for file in bag.parent.iterdir()] == ["bag"]
        else:
            recovered += 1
            raw = {sent.cdr for sent in SENT}
            survivors = [message for message in read_messages(bag) if message.raw in raw]
            assert found.contents.counts.total() == len(list(read_messages(bag)))
            assert survivors or found.contents.unreadable
        damaged_bag = bag.with_name("bag.damaged")
        original = (damaged_bag if damaged_bag.exists() else bag) / sound.name
        assert original.read_bytes() == damaged
    assert recovered > RECOVERED // 4
