"""`sensor_msgs/JointState` to and from its serialised form, fast where names do not change.

Filling and reading dozens of name strings is most of the cost of such a message. Names are
constant, so the bytes up to and with them are kept, and only the stamp and the doubles are
written or read. Whatever does not look like what was kept goes through rclpy's own decoder.

The form is plain CDR, little endian (OMG DDSI-RTPS 2.3, section 10): every item is aligned to
its size, counted from the end of the four bytes of encapsulation header.
"""

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState, MultiDOFJointState

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.errors import LayoutError, MessageError
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.state import StampedState

CDR_LITTLE_ENDIAN = b"\x00\x01\x00\x00"
_STAMP = 4  # after the encapsulation header
_NAMES_START = 12  # after the encapsulation header and the stamp
_FRAME_START = 16  # after the length of the frame's name
_MAX_KEPT_SENDERS = 16
_ENTRY_BYTES = {JointState: (8, 8, 8), MultiDOFJointState: (56, 48, 48)}
_EMPTY = np.zeros(0)


@dataclass(frozen=True)
class JointArrays:
    """A decoded JointState: names and arrays in the sender's order; absent arrays are empty."""

    stamp_ns: int
    names: tuple[str, ...]
    position: FloatArray
    velocity: FloatArray
    effort: FloatArray
    frame_id: str = ""


def split_stamp(stamp_ns: int) -> tuple[int, int]:
    """Seconds and nanoseconds of a stamp."""
    return divmod(stamp_ns, NANOSECONDS_PER_SECOND)


def read_stamp(stamp: Time) -> int:
    """A message's stamp in ns."""
    return int(stamp.sec) * NANOSECONDS_PER_SECOND + int(stamp.nanosec)


def with_stamp(raw: bytes, stamp_ns: int) -> bytes:
    """A serialised little-endian message that begins with a stamp, with another one instead."""
    return raw[:_STAMP] + struct.pack("<iI", *split_stamp(stamp_ns)) + raw[_NAMES_START:]


def frame_id_of(raw: bytes) -> str:
    """The `frame_id` of a serialised message that begins with a header, or is one.

    Raises:
        MessageError: the message is too short for that.
    """
    try:
        (length,) = struct.unpack_from("<I" if raw[1] & 1 else ">I", raw, _NAMES_START)
    except (struct.error, IndexError) as error:
        raise MessageError(f"{len(raw)} bytes that have no header") from error
    if _FRAME_START + length > len(raw):
        raise MessageError(f"a header cut off after {len(raw)} bytes")
    return raw[_FRAME_START : _FRAME_START + length].rstrip(b"\0").decode(errors="replace")


def _padding(length: int, alignment: int) -> int:
    """How many bytes a serialised item of this alignment is preceded by, after `length` bytes."""
    return -length % alignment


def _cdr_names(names: Sequence[str], frame_id: str) -> bytes:
    """The bytes from after the stamp to the end of the names."""
    count = struct.pack("<I", len(names))
    return _cdr_text(frame_id) + count + b"".join(map(_cdr_text, names))


def _cdr_text(text: str) -> bytes:
    """A text with its length, padded for the next item, which is never a double."""
    content = text.encode() + b"\0"
    return struct.pack("<I", len(content)) + content + bytes(_padding(len(content), 4))


def decode(raw: bytes, message_type: type) -> Any:
    """A message of any type from its serialised form.

    Raises:
        MessageError: the bytes are no such message.
    """
    try:
        if message_type in _ENTRY_BYTES:
            _check_lengths(raw, _ENTRY_BYTES[message_type])
        return deserialize_message(raw, message_type)
    except Exception as error:  # rclpy has no type of its own for what cannot be decoded
        raise MessageError(f"{len(raw)} bytes that are no {message_type.__name__}") from error


def _check_lengths(raw: bytes, entry_bytes: Sequence[int]) -> None:
    """Raise struct.error or ValueError if lists are longer than the message is.

    The middleware finds that, too, but prints a line at each such message. The lists are names,
    after the header, and then some of doubles, of so many bytes an entry.
    """
    order = "<" if raw[1] & 1 else ">"

    def count_at(offset: int) -> tuple[int, int]:
        offset += _padding(offset, 4)  # the encapsulation header has four bytes as well
        (count,) = struct.unpack_from(f"{order}I", raw, offset)
        return count, offset + 4

    length, offset = count_at(_NAMES_START)
    names, offset = count_at(offset + length)
    for _ in range(names):
        length, offset = count_at(offset)
        offset += length
    for size in entry_bytes:
        count, offset = count_at(offset)
        if count:
            offset += _padding(offset - 4, 8) + size * count
    if offset > len(raw):
        raise ValueError("a list is longer than the message")


def encode_head(names: Sequence[str], frame_id: str = "") -> bytes:
    """A serialised message up to the end of its names, with a stamp of zero."""
    return CDR_LITTLE_ENDIAN + bytes(8) + _cdr_names(names, frame_id)


def encode_arrays(head: bytes, lists: Iterable[FloatArray]) -> bytes:
    """A serialised message of a head and of lists of doubles (m,) or of rows of them (m, k).

    Not by rclpy, whose writer leaves in the gaps before the doubles what the memory held before:
    the same message would not be the same bytes twice.
    """
    content = bytearray(head)
    for values in lists:
        content += struct.pack("<I", len(values))
        if len(values):
            content += bytes(_padding(len(content) - 4, 8)) + values.tobytes()
    return bytes(content)


class JointStateEncoder:
    """Serialises JointState messages that all have the same names and `frame_id`."""

    def __init__(self, names: Sequence[str], frame_id: str = "") -> None:
        self._head = encode_head(names, frame_id)

    def encode(
        self,
        stamp_ns: int,
        position: FloatArray = _EMPTY,
        velocity: FloatArray = _EMPTY,
        effort: FloatArray = _EMPTY,
    ) -> bytes:
        """The serialised message; each array is (n,) or empty."""
        return encode_arrays(with_stamp(self._head, stamp_ns), (position, velocity, effort))


class DoublesEncoder:
    """Serialises messages of a stamp, texts that never change and, after all else, doubles.

    So are `nav_msgs/Odometry` and `geometry_msgs/WrenchStamped`.
    """

    def __init__(self, *texts: str) -> None:
        """The texts in the message's order, its `frame_id` first."""
        head = CDR_LITTLE_ENDIAN + bytes(8) + b"".join(_cdr_text(text) for text in texts)
        self._head = head + bytes(_padding(len(head) - 4, 8))

    def encode(self, stamp_ns: int, values: FloatArray) -> bytes:
        """The serialised message with all its doubles (m,), in the message's order."""
        return with_stamp(self._head, stamp_ns) + values.tobytes()


def encode_clock(stamp_ns: int) -> bytes:
    """A serialised rosgraph_msgs/Clock."""
    return CDR_LITTLE_ENDIAN + struct.pack("<iI", *split_stamp(stamp_ns))


class JointStateDecoder:
    """Reads serialised JointState messages; fast for senders whose names it has seen."""

    def __init__(self) -> None:
        self._kept: dict[bytes, tuple[tuple[str, ...], str]] = {}  # names and frame_id

    def decode(self, raw: bytes) -> JointArrays:
        """The message's content.

        Raises:
            MessageError: the bytes are no JointState.
        """
        for head, texts in self._kept.items():
            if raw.startswith(head, _NAMES_START) and raw.startswith(CDR_LITTLE_ENDIAN):
                return _read_doubles(raw, _NAMES_START + len(head), *texts)
        return self._decode_slowly(raw)

    def _decode_slowly(self, raw: bytes) -> JointArrays:
        message = decode(raw, JointState)
        names, frame_id = tuple(message.name), str(message.header.frame_id)
        head = _cdr_names(names, frame_id)
        if raw.startswith(head, _NAMES_START):
            if len(self._kept) == _MAX_KEPT_SENDERS:  # each start of a simulator is a new sender
                del self._kept[next(iter(self._kept))]
            self._kept[head] = names, frame_id
        return JointArrays(
            stamp_ns=read_stamp(message.header.stamp),
            names=names,
            position=np.array(message.position, dtype=float),
            velocity=np.array(message.velocity, dtype=float),
            effort=np.array(message.effort, dtype=float),
            frame_id=frame_id,
        )


def _read_doubles(raw: bytes, offset: int, names: tuple[str, ...], frame_id: str) -> JointArrays:
    """The rest of a message whose names end at `offset`."""
    seconds, nanoseconds = struct.unpack_from("<iI", raw, 4)
    arrays = []
    try:
        for _ in range(3):
            (count,) = struct.unpack_from("<I", raw, offset)
            offset += 4
            if count:
                offset += _padding(offset - 4, 8)
            arrays.append(np.frombuffer(raw, "<f8", count, offset).copy() if count else _EMPTY)
            offset += 8 * count
    except (struct.error, ValueError) as error:
        raise MessageError(f"a JointState cut off after {len(raw)} bytes") from error
    stamp_ns = seconds * NANOSECONDS_PER_SECOND + nanoseconds
    position, velocity, effort = arrays
    return JointArrays(stamp_ns, names, position, velocity, effort, frame_id)


def state_in_layout(layout: JointLayout, arrays: JointArrays) -> StampedState:
    """A received state in the layout's order, matched by name.

    Raises:
        LayoutError: a name is unknown, or a degree of freedom is missing.
        MessageError: an array's length is not that of the names.
    """
    indices = layout.indices(arrays.names)
    if len(indices) != layout.size:
        missing = next(name for name in layout.dof_names if name not in arrays.names)
        raise LayoutError(f"degree of freedom '{missing}' is missing")
    parts = [arrays.position, arrays.velocity, arrays.effort]
    lengths = {len(arrays.position), len(arrays.velocity), len(arrays.effort) or layout.size}
    if lengths != {layout.size}:
        raise MessageError(f"{layout.size} names but arrays of {sorted(lengths)} entries")
    if arrays.names != layout.dof_names:
        order = np.argsort(indices)
        parts = [part[order] if len(part) else part for part in parts]
    position, velocity, effort = parts
    return StampedState(arrays.stamp_ns, position, velocity, effort if len(effort) else None)
