"""Serialised messages of a stamp, names and lists of doubles, read and written directly.

Filling and reading dozens of name strings is most of the cost of such a message, of which
`sensor_msgs/JointState` and `sensor_msgs/MultiDOFJointState` are two.

The form is plain CDR, little endian (OMG DDSI-RTPS 2.3, section 10): every item is aligned to
its size, counted from the end of the four bytes of encapsulation header.
"""

import struct
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.errors import MessageError
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND

CDR_LITTLE_ENDIAN = b"\x00\x01\x00\x00"
STAMP_START = 4  # after the encapsulation header
NAMES_START = 12  # after the encapsulation header and the stamp
_FRAME_START = 16  # after the length of the frame's name
JOINT_STATE = "sensor_msgs/msg/JointState"
MULTI_DOF_JOINT_STATE = "sensor_msgs/msg/MultiDOFJointState"
_WIDTHS = {  # doubles in an entry of each list
    JOINT_STATE: (1, 1, 1),  # position, velocity, effort
    # transforms (translation, rotation xyzw), twist (linear, angular), wrench (force, torque)
    MULTI_DOF_JOINT_STATE: (7, 6, 6),
}
_EMPTY = np.zeros(0)


class _ByteOrder(NamedTuple):
    """How a sender writes numbers."""

    stamp: struct.Struct
    length: struct.Struct
    double: np.dtype[np.float64]


_BIG, LITTLE_ENDIAN = (
    _ByteOrder(struct.Struct(f"{sign}iI"), struct.Struct(f"{sign}I"), np.dtype(f"{sign}f8"))
    for sign in "><"
)
# By the encapsulation header's first two bytes.
_BYTE_ORDERS = {b"\0\0": _BIG, b"\0\1": LITTLE_ENDIAN}


def split_stamp(stamp_ns: int) -> tuple[int, int]:
    """Seconds and nanoseconds of a stamp."""
    return divmod(stamp_ns, NANOSECONDS_PER_SECOND)


def with_stamp(raw: bytes, stamp_ns: int) -> bytes:
    """A serialised little-endian message that begins with a stamp, with another one instead."""
    return raw[:STAMP_START] + LITTLE_ENDIAN.stamp.pack(*split_stamp(stamp_ns)) + raw[NAMES_START:]


def read_frame_id(raw: bytes) -> str:
    """The `frame_id` of a serialised message that begins with a header, or is one.

    Raises:
        MessageError: the message is too short for that.
    """
    try:
        (length,) = struct.unpack_from("<I" if raw[1] & 1 else ">I", raw, NAMES_START)
    except (struct.error, IndexError) as error:
        raise MessageError(f"{len(raw)} bytes that have no header") from error
    if _FRAME_START + length > len(raw):
        raise MessageError(f"a header cut off after {len(raw)} bytes")
    return raw[_FRAME_START : _FRAME_START + length].rstrip(b"\0").decode(errors="replace")


def padding(length: int, alignment: int) -> int:
    """How many bytes a serialised item of this alignment is preceded by, after `length` bytes."""
    return -length % alignment


def encode_names(names: Sequence[str], frame_id: str) -> bytes:
    """The bytes from after the stamp to the end of the names."""
    count = struct.pack("<I", len(names))
    return encode_text(frame_id) + count + b"".join(map(encode_text, names))


def encode_text(text: str) -> bytes:
    """A text with its length, padded for the next item, which is never a double."""
    content = text.encode() + b"\0"
    return struct.pack("<I", len(content)) + content + bytes(padding(len(content), 4))


def encode_string(text: str) -> bytes:
    """A serialised std_msgs/String."""
    return CDR_LITTLE_ENDIAN + encode_text(text)


def decode_string(raw: bytes) -> str:
    """The text of a serialised std_msgs/String.

    Raises:
        MessageError: the bytes are no such message.
    """
    try:
        return _read_text(raw, STAMP_START, _BYTE_ORDERS[raw[:2]])[0]
    except (KeyError, struct.error, ValueError) as error:
        raise MessageError(f"{len(raw)} bytes that are no String") from error


def encode_header(stamp_ns: int, frame_id: str) -> bytes:
    """A serialised std_msgs/Header."""
    return with_stamp(CDR_LITTLE_ENDIAN + bytes(8), stamp_ns) + encode_text(frame_id)


def decode_header(raw: bytes) -> tuple[int, str]:
    """The stamp, ns, and the `frame_id` of a serialised std_msgs/Header.

    Raises:
        MessageError: the bytes are no such message.
    """
    try:
        order = _BYTE_ORDERS[raw[:2]]
        return _read_stamp(raw, order), _read_text(raw, NAMES_START, order)[0]
    except (KeyError, struct.error, ValueError) as error:
        raise MessageError(f"{len(raw)} bytes that are no Header") from error


class NamedLists(NamedTuple):
    """A message of a header, names, and lists of structures of doubles."""

    stamp_ns: int
    frame_id: str
    names: tuple[str, ...]
    lists: list[FloatArray]  # (m * width,) each


def read_message(raw: bytes, type_name: str) -> NamedLists:
    """The content of a serialised JointState or MultiDOFJointState.

    Raises:
        MessageError: the bytes are no such message.
    """
    try:
        order = _BYTE_ORDERS[raw[:2]]
        stamp_ns = _read_stamp(raw, order)
        frame_id, offset = _read_text(raw, NAMES_START, order)
        count, offset = _read_count(raw, offset, order)
        names = []
        for _ in range(count):
            name, offset = _read_text(raw, offset, order)
            names.append(name)
        lists = _read_lists(raw, offset, order, _WIDTHS[type_name])
    except (KeyError, struct.error, ValueError) as error:
        name = type_name.rpartition("/")[2]
        raise MessageError(f"{len(raw)} bytes that are no {name}") from error
    return NamedLists(stamp_ns, frame_id, tuple(names), lists)


def _read_stamp(raw: bytes, order: _ByteOrder) -> int:
    """The stamp of a message that begins with one, in ns."""
    seconds, nanoseconds = order.stamp.unpack_from(raw, STAMP_START)
    return int(seconds) * NANOSECONDS_PER_SECOND + int(nanoseconds)


def _read_count(raw: bytes, offset: int, order: _ByteOrder) -> tuple[int, int]:
    """A length, and the offset behind it."""
    offset += padding(offset, 4)  # the encapsulation header has four bytes as well
    (count,) = order.length.unpack_from(raw, offset)
    return count, offset + 4


def _read_text(raw: bytes, offset: int, order: _ByteOrder) -> tuple[str, int]:
    """A text, and the offset behind it; as ROS reads it, it ends before the first NUL."""
    length, offset = _read_count(raw, offset, order)
    end = offset + length
    if end > len(raw):
        raise ValueError("a text that is longer than the message")
    return raw[offset:end].partition(b"\0")[0].decode(errors="replace"), end


def _read_lists(
    raw: bytes, offset: int, order: _ByteOrder, widths: Sequence[int]
) -> list[FloatArray]:
    """Lists of structures of so many doubles each, every list flat: (m * width,)."""
    lists = []
    for width in widths:
        count, offset = _read_count(raw, offset, order)
        values = _EMPTY
        if count:
            offset += padding(offset - 4, 8)
            values = np.frombuffer(raw, order.double, count * width, offset).astype(np.float64)
        lists.append(values)
        offset += values.nbytes
    return lists


def encode_head(names: Sequence[str], frame_id: str = "") -> bytes:
    """A serialised message up to the end of its names, with a stamp of zero."""
    return CDR_LITTLE_ENDIAN + bytes(8) + encode_names(names, frame_id)


def gaps_before(length: int, lists: Iterable[FloatArray]) -> list[bytes]:
    """What stands before each list, in a message whose head has this length: count and padding."""
    gaps = []
    for values in lists:
        gap = LITTLE_ENDIAN.length.pack(len(values))
        if len(values):
            gap += bytes(padding(length + len(gap) - 4, 8))
        gaps.append(gap)
        length += len(gap) + values.nbytes
    return gaps


def encode_arrays(head: bytes, lists: Sequence[FloatArray]) -> bytes:
    """A serialised message of a head and of lists of doubles (m,) or of rows of them (m, k).

    Not by rclpy, whose writer leaves in the gaps before the doubles what the memory held before:
    the same message would not be the same bytes twice.
    """
    parts = zip(gaps_before(len(head), lists), lists, strict=True)
    return head + b"".join(gap + values.tobytes() for gap, values in parts)


class DoublesEncoder:
    """Serialises messages of a stamp, texts that never change and, after all else, doubles.

    So are `nav_msgs/Odometry` and `geometry_msgs/WrenchStamped`.
    """

    def __init__(self, *texts: str) -> None:
        """The texts in the message's order, its `frame_id` first."""
        head = CDR_LITTLE_ENDIAN + bytes(8) + b"".join(encode_text(text) for text in texts)
        self._head = head + bytes(padding(len(head) - 4, 8))

    def encode(self, stamp_ns: int, values: FloatArray) -> bytes:
        """The serialised message with all its doubles (m,), in the message's order."""
        return with_stamp(self._head, stamp_ns) + values.tobytes()


def encode_clock(stamp_ns: int) -> bytes:
    """A serialised rosgraph_msgs/Clock."""
    return CDR_LITTLE_ENDIAN + struct.pack("<iI", *split_stamp(stamp_ns))
