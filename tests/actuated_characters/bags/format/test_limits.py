"""Bags of some kilobytes that would unpack to gigabytes: refused in one line, in little memory."""

import json
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import mcap.writer
import pytest
from lz4.frame import LZ4FrameCompressor
from mcap.writer import CompressionType, IndexType

from actuated_characters.bags.format import limits
from actuated_characters.bags.format.limits import MIB
from actuated_characters.bags.reader import read_messages
from msgs_config.errors import RecordingError
from tests.support.foreign_bags import (
    TextMessage,
    texts,
    write_jazzy_db3,
    write_mcap,
    write_metadata,
)

pytestmark = pytest.mark.slow

GIB = 1024 * MIB
TOPIC = "/sim_node/configuration"  # what every command reads first
BLOCK = 128 * 1024  # bytes that a block of zstd may stand for
MOST_MEBIBYTES = 600
SOUND = [TextMessage(TOPIC, number, f"text {number}") for number in range(1, 6)]


class Stored(NamedTuple):
    """A message as it is written into a file."""

    topic: str
    log_time_ns: int
    cdr: bytes


def zstd_bomb(size: int, *, declared: bool) -> bytes:
    """A frame of zstd that stands for zeros, in blocks that repeat one byte (RFC 8878)."""
    head = b"\x28\xb5\x2f\xfd" + (
        b"\xc0\x40" + size.to_bytes(8, "little") if declared else b"\x00\x40"
    )
    blocks, rest = divmod(size, BLOCK)
    block = (1 << 1 | BLOCK << 3).to_bytes(3, "little") + b"\0"
    last = (1 | 1 << 1 | rest << 3).to_bytes(3, "little") + b"\0"
    return head + block * blocks + last


def lz4_bomb(size: int) -> bytes:
    compressor = LZ4FrameCompressor()
    pieces = [compressor.begin()]
    pieces += [compressor.compress(bytes(64 * MIB)) for _ in range(size // (64 * MIB))]
    return b"".join([*pieces, compressor.flush()])


def messages(bag: Path, *, declared: bool) -> None:
    bomb = zstd_bomb(6 * GIB, declared=declared)
    sound = [Stored(TOPIC, each.log_time_ns, compressed(each.cdr)) for each in SOUND]
    write_jazzy_db3(bag / "bag_0.db3", [Stored(TOPIC, 0, bomb), *sound])  # type: ignore[list-item]
    how = {"compression_format": "zstd", "compression_mode": "MESSAGE"}
    write_metadata(bag, 9, "sqlite3", ["bag_0.db3"], [TOPIC], **how)


def compressed(raw: bytes) -> bytes:
    return bytes(mcap.writer.zstandard.compress(raw))


def chunks(
    bag: Path,
    *,
    bomb: bytes,
    compression: CompressionType = CompressionType.ZSTD,
    size: int | None = None,
    **options: Any,
) -> None:
    """The first chunk is the bomb, and declares `size`, or the size that it had before."""
    sound, made = mcap.writer.Chunk, list[object]()

    def chunk(**fields: Any) -> mcap.writer.Chunk:
        made.append(fields)
        if len(made) == 1:
            fields |= {"data": bomb, "uncompressed_size": size or fields["uncompressed_size"]}
        return sound(**fields)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mcap.writer, "Chunk", chunk)
        write_mcap(bag / "bag_0.mcap", SOUND, chunk_size=1, compression=compression, **options)
    write_metadata(bag, 9, "mcap", ["bag_0.mcap"], [TOPIC])


def overlapping(bag: Path) -> None:
    """Chunks whose messages are the first and the last in time: all would be open at once."""
    large = "0" * (60 * MIB)
    messages = [
        TextMessage(TOPIC, time, text)
        for _ in range(12)
        for time, text in ((100, "last"), (1, large))
    ]
    write_mcap(bag / "bag_0.mcap", messages, chunk_size=MIB)
    write_metadata(bag, 9, "mcap", ["bag_0.mcap"], [TOPIC])


def whole_file(bag: Path, *, declared: bool, size: int) -> None:
    (bag / "bag_0.db3.zstd").write_bytes(zstd_bomb(size, declared=declared))
    how = {"compression_format": "zstd", "compression_mode": "FILE"}
    write_metadata(bag, 9, "sqlite3", ["bag_0.db3.zstd"], [TOPIC], **how)


def computed_column(bag: Path) -> None:
    """An SQLite file whose messages are made when they are read."""
    with closing(sqlite3.connect(write_jazzy_db3(bag / "bag_0.db3", SOUND))) as database:
        database.executescript(
            "ALTER TABLE messages RENAME COLUMN data TO was;"
            "ALTER TABLE messages ADD COLUMN data BLOB AS (zeroblob(900000000)) VIRTUAL;"
        )
    write_metadata(bag, 9, "sqlite3", ["bag_0.db3"], [TOPIC])


OF_MESSAGE = "a message: larger than the limit of 64 MiB"
OF_CHUNK = "a chunk: larger than the limit of 128 MiB"
ZSTD_CHUNK = partial(chunks, bomb=zstd_bomb(6 * GIB, declared=False))
KINDS: dict[str, tuple[Callable[[Path], None], str]] = {
    "message": (partial(messages, declared=True), OF_MESSAGE),
    "message undeclared": (partial(messages, declared=False), OF_MESSAGE),
    "chunk": (
        partial(chunks, bomb=zstd_bomb(6 * GIB, declared=True), size=6 * GIB),
        ": larger than the limit of 128 MiB",
    ),
    "chunk that lies": (ZSTD_CHUNK, OF_CHUNK),
    "chunk of lz4": (
        lambda bag: chunks(bag, bomb=lz4_bomb(GIB), compression=CompressionType.LZ4),
        OF_CHUNK,
    ),
    "chunk without an index": (partial(ZSTD_CHUNK, index_types=IndexType.NONE), OF_CHUNK),
    "chunks of one time": (overlapping, "chunks: larger than the limit of 128 MiB"),
    "file": (
        partial(whole_file, declared=True, size=64 * GIB),
        "bag_0.db3.zstd: it: larger than the limit of 8192 MiB",
    ),
    "computed column": (computed_column, f"bag_0.db3: {OF_MESSAGE}"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_bomb_is_refused_in_one_line(tmp_path: Path, kind: str) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    KINDS[kind][0](bag)
    assert sum(file.stat().st_size for file in bag.iterdir()) < 5 * MIB

    with pytest.raises(RecordingError) as caught:
        list(read_messages(bag))

    line = str(caught.value)
    assert line.startswith(f"cannot read recording {bag}: ")
    assert KINDS[kind][1] in line
    assert ("recover" in line) == bool(list(bag.glob("*.mcap")))
    assert "\n" not in line and len(line) < 500


COMMANDS = """
import contextlib, io, json, re, sys
from actuated_characters.cli import main
outcomes = []
for arguments in json.loads(sys.argv[1]):
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        code = main(arguments)
    outcomes.append((code, " ".join(printed.getvalue().split())))
peak = re.search(r"VmHWM:\\s*(\\d+)", open("/proc/self/status").read())[1]
print(json.dumps([outcomes, int(peak) / 1024]))
"""
REFUSED = [
    *((kind, "info --ticks") for kind in ("message undeclared", "chunk", "chunk that lies")),
    *(("chunks of one time", "info --ticks"), ("message", "replay")),
    ("message undeclared", "report"),
    ("chunk that lies", "export --output to.csv"),
]
RECOVERED = ["chunk", "chunk that lies", "chunk of lz4"]


def test_commands_refuse_them_and_recover_the_rest_in_little_memory(tmp_path: Path) -> None:
    asked = [*REFUSED, *((kind, "info --recover") for kind in RECOVERED)]
    bags = [tmp_path / str(number) for number in range(len(asked))]
    for bag, (kind, _) in zip(bags, asked, strict=True):
        bag.mkdir()
        KINDS[kind][0](bag)
    merges = [f"l{n}: &l{n} {{<<: [{', '.join([f'*l{n - 1}'] * 10)}]}}" for n in range(1, 9)]
    content = "\n".join(["l0: &l0 {a: 0}", *merges, "rosbag2_bagfile_information: *l8"])
    (merged := tmp_path / "merged").mkdir()
    write_jazzy_db3(merged / "bag_0.db3", SOUND)
    (merged / "metadata.yaml").write_text(content)
    words = [[*line.split(), str(bag)] for bag, (_, line) in zip(bags, asked, strict=True)]

    command = [sys.executable, "-c", COMMANDS, json.dumps([*words, ["info", str(merged)]])]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)

    (*outcomes, of_merged), mebibytes = json.loads(done.stdout)
    for (kind, line), (code, printed) in zip(asked, outcomes, strict=True):
        assert code == int("--recover" not in line), (kind, line, printed)
        assert KINDS[kind][1] in printed, (kind, line, printed)
    assert all(texts(bag) == SOUND[1:] for bag in bags[len(REFUSED) :])
    assert of_merged[0] == 1 and "metadata.yaml" in of_merged[1]
    assert mebibytes < MOST_MEBIBYTES


def test_a_file_that_declares_nothing_is_unpacked_up_to_the_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "MOST_OF_FILE", 20 * MIB)
    whole_file(tmp_path, declared=False, size=8 * GIB)

    with pytest.raises(RecordingError, match=r"zstd: it: larger than the limit of 20 MiB"):
        list(read_messages(tmp_path))


def test_a_file_without_an_index_is_sorted_up_to_a_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_mcap(tmp_path / "bag_0.mcap", SOUND * 100, index_types=IndexType.NONE)
    assert len(texts(tmp_path / "bag_0.mcap")) == 500
    monkeypatch.setattr(limits, "MOST_SORTED", 10_000)

    with pytest.raises(RecordingError, match="a file without an index: larger"):
        list(read_messages(tmp_path / "bag_0.mcap"))


@pytest.mark.parametrize("size", [64 * MIB, 64 * MIB + 1])
def test_a_message_may_be_as_large_as_the_limit(tmp_path: Path, size: int) -> None:
    raw = b"\x00\x01\x00\x00" + bytes(size - 4)
    for bag, stored in ((tmp_path / "plain", raw), (tmp_path / "packed", compressed(raw))):
        bag.mkdir()
        write_jazzy_db3(bag / "bag_0.db3", [Stored(TOPIC, 1, stored)])  # type: ignore[list-item]
        mode = "MESSAGE" if bag.name == "packed" else ""
        how = {"compression_format": "zstd" if mode else "", "compression_mode": mode}
        write_metadata(bag, 9, "sqlite3", ["bag_0.db3"], [TOPIC], **how)
        if size > 64 * MIB:
            with pytest.raises(RecordingError, match=f"on '{TOPIC}' {OF_MESSAGE}"):
                list(read_messages(bag))
        else:
            assert [message.raw for message in read_messages(bag)] == [raw]


def test_metadata_that_is_too_large_is_refused(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text("# " + "x" * (8 * MIB))

    with pytest.raises(RecordingError, match=r"metadata.yaml is damaged: larger than 4096 KiB"):
        list(read_messages(tmp_path))
