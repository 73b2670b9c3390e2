"""How much a bag may unpack to. A small file can stand for any number of bytes.

What a file declares is taken as a reason to refuse it, never as a reason to believe it: unpacking
itself ends at the limit.
"""

import sqlite3
from pathlib import Path

from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]
from rosbags.rosbag2 import storage_mcap
from rosbags.rosbag2.reader import zstd  # type: ignore[attr-defined]  # the one that it found

MIB = 1 << 20
MOST_OF_MESSAGE = 64 * MIB  # bytes; a large image has 50 million
MOST_OF_CHUNK = 128 * MIB  # bytes, together with those of overlapping times; mostly it is 1 MiB
MOST_SORTED = 1024 * MIB  # bytes of a file without an index, which is sorted in memory
MOST_OF_FILES = 8192 * MIB  # bytes on the disk, of all files of a bag that are compressed whole
ZstdError = zstd.ZstdError
_PIECE = MIB
_LONGEST_HEAD = 18  # bytes of a zstd frame


class LimitError(ValueError):
    """Something would unpack to more than it may."""

    def __init__(self, what: str, size: int | None, limit: int) -> None:
        """`size` is what is known of it, bytes; None if that is no more than the limit."""
        more = "more" if size is None else f"at least {_shown(size)}, more"
        super().__init__(f"{what} would unpack to {more} than the limit of {_shown(limit)}")


class Allowance:
    """A number of bytes that may be held at the same time."""

    def __init__(self, what: str, limit: int) -> None:
        self._what = what
        self._limit = limit
        self._held = 0

    def take(self, size: int) -> None:
        """Hold so many bytes more. Raises LimitError if that is more than is allowed."""
        self._held += size
        if self._held > self._limit:
            raise LimitError(self._what, self._held, self._limit)

    def give_back(self, size: int) -> None:
        """Hold so many bytes less."""
        self._held -= size


def unpack_message(packed: bytes) -> bytes:
    """A message that was compressed by zstd.

    Raises:
        LimitError: it is larger than a message may be.
        zstd.ZstdError, EOFError: it is damaged.
    """
    return _unpack_zstd("a message", packed, MOST_OF_MESSAGE)


def check_message(raw: bytes) -> bytes:
    """The message itself. Raises LimitError if it is larger than a message may be."""
    if len(raw) > MOST_OF_MESSAGE:
        raise LimitError("a message", len(raw), MOST_OF_MESSAGE)
    return raw


def unpack_file(packed: Path, copy: Path, allowance: Allowance) -> None:
    """Write the content of a file that was compressed by zstd as a whole, as far as it goes.

    Raises:
        LimitError: it is more than is left of the allowance.
        OSError: the copy cannot be written.
        zstd.ZstdError, EOFError: the file is damaged.
    """
    with copy.open("wb") as sink, packed.open("rb") as file:
        declared = zstd.get_frame_info(file.read(_LONGEST_HEAD)).decompressed_size or 0
        allowance.take(declared)
        allowance.give_back(declared)
        file.seek(0)
        source = zstd.open(file, "rb")
        while piece := source.read1(_PIECE):
            allowance.take(len(piece))
            sink.write(piece)


def check_tables(connection: sqlite3.Connection) -> None:
    """Refuse an SQLite file of a recording whose rows are computed, not stored: they have no limit.

    Raises:
        ValueError: it has such tables.
    """
    for table in ("messages", "topics", "message_definitions"):
        computed = connection.execute(
            "SELECT 1 FROM sqlite_master WHERE name = :table "
            "AND (type <> 'table' OR sql LIKE 'CREATE VIRTUAL%') "
            "UNION SELECT 1 FROM pragma_table_xinfo(:table) WHERE hidden",
            {"table": table},
        )
        if computed.fetchone() is not None:
            raise ValueError(f"its table '{table}' is computed, not stored")


def _unpack_zstd(what: str, packed: bytes, limit: int) -> bytes:
    declared = zstd.get_frame_info(packed).decompressed_size
    if declared is not None and declared > limit:
        raise LimitError(what, declared, limit)
    return _unpack(zstd.ZstdDecompressor(), what, packed, limit)


def _unpack(decompressor: "zstd.ZstdDecompressor", what: str, packed: bytes, limit: int) -> bytes:
    """One frame, which is what rosbag2 and MCAP's writers make of a message or a chunk."""
    raw: bytes = decompressor.decompress(packed, max_length=limit + 1)
    if len(raw) > limit:
        raise LimitError(what, None, limit)
    if not decompressor.eof:
        raise EOFError(f"{what} is cut off")
    if decompressor.unused_data:
        raise EOFError(f"{what} has {len(decompressor.unused_data)} bytes behind its end")
    return raw


def _check_chunk(size: int) -> None:
    if size > MOST_OF_CHUNK:
        raise LimitError("a chunk", size, MOST_OF_CHUNK)


def _plain_chunk(packed: bytes, size: int) -> bytes:
    _check_chunk(size)
    return packed


def _zstd_chunk(packed: bytes, size: int) -> bytes:
    _check_chunk(size)
    return _unpack_zstd("a chunk", packed, MOST_OF_CHUNK)


def _lz4_chunk(packed: bytes, size: int) -> bytes:
    _check_chunk(size)
    return _unpack(LZ4FrameDecompressor(), "a chunk", packed, MOST_OF_CHUNK)


def _shown(size: int) -> str:
    return f"{size / MIB:.0f} MiB"


# rosbags unpacks chunks by this table, also while it opens a file; by itself it knows no limit.
storage_mcap.DECOMPRESSORS |= {"": _plain_chunk, "zstd": _zstd_chunk, "lz4": _lz4_chunk}
