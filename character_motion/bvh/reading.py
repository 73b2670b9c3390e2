"""Reader of BVH files (Meredith and Maddock 2001, "Motion Capture File Formats Explained")."""

import codecs
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from character_motion.bvh.hierarchy import (
    LARGEST,
    HierarchyParser,
    parse_number,
    wrong_line,
)
from character_motion.bvh.skeleton import BvhMotion
from msgs_config.arrays import FloatArray
from msgs_config.errors import ClipError
from msgs_config.file_kinds import refuse_other_kind
from msgs_config.files import read_text

MAX_BYTES = 64 * 1024 * 1024
"""Of a file: ten minutes of a body with fingers at 120 Hz."""
_FRAMES = "Frames:"
_FRAME_TIME = "Frame Time:"
_LONGEST_FRAME_TIME = 10.0  # s; a longer one is in other units


def read_bvh(path: Path) -> BvhMotion:
    """The skeleton and the motion of a BVH file.

    Names that are not in UTF-8 are taken byte by byte (Latin-1).

    Raises:
        ClipError: the file is missing, too large or no BVH; says the line, what is there, and what
            must be.
    """
    lines = _text(path).splitlines()
    parser = HierarchyParser(path)
    for number, line in enumerate(lines, start=1):
        if not parser.take(number, line):
            break
    else:
        raise wrong_line(path, len(lines), "", "a hierarchy, and the line MOTION after it")
    skeleton = parser.skeleton()
    rows = [(at, line) for at, line in enumerate(lines[number:], start=number + 1) if line.strip()]
    count = _header(path, rows, 0, _FRAMES)
    if not (count >= 1.0 and count.is_integer()):
        raise wrong_line(path, *rows[0], "a number of frames of at least 1")
    frame_time = _header(path, rows, 1, _FRAME_TIME)
    if not 0.0 < frame_time <= _LONGEST_FRAME_TIME:
        right = f"the time of a frame in s, over 0 and at most {_LONGEST_FRAME_TIME:g}"
        raise wrong_line(path, *rows[1], right)
    frames = rows[2:]
    if len(frames) != count:
        raise ClipError(f"{path}: {len(frames)} lines of frames; 'Frames:' says {int(count)}")
    return BvhMotion(skeleton, frame_time, _values(path, frames, skeleton.channel_count))


def _text(path: Path) -> str:
    """The text of a file, in UTF-8 or in UTF-16 with its mark, or else byte by byte."""
    refuse_other_kind(path, "a BVH file", (".bvh",), ClipError)
    try:
        return read_text(path, ClipError, MAX_BYTES).removeprefix("\ufeff")
    except ClipError as error:
        if not isinstance(error.__cause__, UnicodeDecodeError):
            raise
        content = path.read_bytes()
        is_wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        with suppress(UnicodeDecodeError):
            text = content.decode("utf-16" if is_wide else "latin-1")
            if "\0" not in text:
                return text.removeprefix("\ufeff")
        raise


def _header(path: Path, rows: Sequence[tuple[int, str]], index: int, keyword: str) -> float:
    """The number behind a keyword on one of the lines after MOTION; NaN if it is none."""
    number, line = rows[index] if index < len(rows) else (rows[-1][0] if rows else 0, "")
    words, value = line.lower().replace(":", " ").split(), keyword.lower().rstrip(":").split()
    if len(words) != len(value) + 1 or words[:-1] != value:
        raise wrong_line(path, number, line, f"'{keyword}' with a number")
    return parse_number(words[-1])


def _values(path: Path, rows: Sequence[tuple[int, str]], width: int) -> FloatArray:
    """The numbers (f, width) of the lines of the frames."""
    values = np.empty((len(rows), width))
    for frame, (number, line) in enumerate(rows):
        words = line.split()
        if len(words) != width:
            there = f"{len(words)} numbers in frame {frame}"
            raise ClipError(f"{path}, line {number}: {there}; the channels are {width}")
        try:
            values[frame] = words
        except ValueError:
            values[frame] = [parse_number(word) for word in words]
        if not (np.abs(values[frame]) <= LARGEST).all():  # this refuses NaN as well
            bad = words[int(np.argmin(np.abs(values[frame]) <= LARGEST))]
            raise wrong_line(path, number, bad, f"finite numbers up to {LARGEST:g}, as all are")
    return values
