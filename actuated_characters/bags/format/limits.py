"""Limits on the sizes of what is in a bag, which hold for what is unpacked, too."""

from pathlib import Path

from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]
from rosbags.rosbag2.reader import zstd  # type: ignore[attr-defined]  # compression's or backports'

from actuated_characters.bags.format.storage import ZSTD

MIB = 1 << 20
MOST_OF_MESSAGE = 64 * MIB  # bytes; a large image has 50 million
MOST_OF_CHUNK = 128 * MIB  # bytes, together with chunks of overlapping times; mostly one has 1 MiB
MOST_SORTED = 1024 * MIB  # bytes of a file without an index, which is sorted in memory
MOST_OF_FILE = 8192 * MIB  # bytes on the disk, of a file that is compressed whole
DAMAGED = (ValueError, EOFError, zstd.ZstdError)  # raised for bytes that cannot be unpacked
_PIECE = MIB
_LONGEST_HEAD = 18  # bytes of the longest header of a zstd frame


class LimitError(ValueError):
    """Something is larger than it may be."""


def check_size(what: str, size: int, limit: int) -> None:
    """Raise LimitError if a size is over its limit, bytes."""
    if size > limit:
        raise LimitError(f"{what}: larger than the limit of {limit / MIB:g} MiB")


def unpack_message(stored: bytes, *, packed: bool) -> bytes:
    """Return a message as it was serialised; `packed` if zstd compressed it. Raises as `unpack`."""
    return unpack("a message", stored, ZSTD if packed else "", MOST_OF_MESSAGE)


def unpack(what: str, packed: bytes, compression: str, limit: int) -> bytes:
    """Unpack one frame of `zstd` or `lz4`, or nothing where `compression` is empty.

    Raises:
        LimitError: the content is larger than the limit, bytes.
        ValueError, ZstdError, EOFError: the compression is unknown, or the frame is damaged.
    """
    if not compression:
        check_size(what, len(packed), limit)
        return packed
    if compression == ZSTD:
        decompressor = zstd.ZstdDecompressor()
    elif compression == "lz4":
        decompressor = LZ4FrameDecompressor()
    else:
        raise ValueError(f"{what} has the unknown compression '{compression}'")
    raw: bytes = decompressor.decompress(packed, max_length=limit + 1)
    check_size(what, len(raw), limit)
    if not decompressor.eof or decompressor.unused_data:
        raise EOFError(f"{what} is cut off, or has bytes behind its end")
    return raw


def unpack_file(packed: Path, copy: Path) -> None:
    """Write the content of a file that zstd compressed as a whole.

    Raises:
        LimitError: it is more than a file may have.
        OSError: the copy cannot be written.
        ZstdError, EOFError: the file is damaged.
    """
    with packed.open("rb") as file:  # what it declares: the disk need not be filled up first
        declared = zstd.get_frame_info(file.read(_LONGEST_HEAD)).decompressed_size or 0
    check_size("it", declared, MOST_OF_FILE)
    with copy.open("wb") as sink, zstd.open(packed, "rb") as source:
        while piece := source.read1(_PIECE):
            check_size("it", sink.tell() + len(piece), MOST_OF_FILE)
            sink.write(piece)
