"""`sensor_msgs/JointState` to and from its serialised form, fast where names do not change.

Filling and reading dozens of name strings is most of the cost of such a message. Names are
constant, so the bytes up to and with them are kept, and only the stamp and the doubles are
written or read. `sensor_msgs/MultiDOFJointState` has the same form: a header, names and lists of
doubles.

The form is plain CDR, little endian (OMG DDSI-RTPS 2.3, section 10): every item is aligned to
its size, counted from the end of the four bytes of encapsulation header.
"""

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
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
_WIDTHS = {  # doubles in an entry of each list
    JointState: (1, 1, 1),  # position, velocity, effort
    # transforms (translation, rotation xyzw), twist (linear, angular), wrench (force, torque)
    MultiDOFJointState: (7, 6, 6),
}
_BYTE_ORDERS = {b"\0\0": ">", b"\0\1": "<"}  # by the encapsulation header's first two bytes
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


def with_stamp(raw: bytes, stamp_ns: int) -> bytes:
    """A serialised little-endian message that begins with a stamp, with another one instead."""
    return raw[:_STAMP] + struct.pack("<iI", *split_stamp(stamp_ns)) + raw[_NAMES_START:]


def read_frame_id(raw: bytes) -> str:
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
    if message_type is JointState:  # the middleware would print a line if a list is too long
        read_message(raw, JointState)
    try:
        return deserialize_message(raw, message_type)
    except Exception as error:  # rclpy has no exception type for bytes that it cannot decode
        raise MessageError(f"{len(raw)} bytes that are no {message_type.__name__}") from error


class NamedLists(NamedTuple):
    """A message of a header, names, and lists of structures of doubles."""

    stamp_ns: int
    frame_id: str
    names: tuple[str, ...]
    lists: list[FloatArray]  # (m * width,) each


def read_message(raw: bytes, message_type: type) -> NamedLists:
    """The content of a serialised JointState or MultiDOFJointState.

    Raises:
        MessageError: the bytes are no such message.
    """
    try:
        order = _BYTE_ORDERS[raw[:2]]
        seconds, nanoseconds = struct.unpack_from(f"{order}iI", raw, _STAMP)
        frame_id, offset = _read_text(raw, _NAMES_START, order)
        count, offset = _read_count(raw, offset, order)
        names = []
        for _ in range(count):
            name, offset = _read_text(raw, offset, order)
            names.append(name)
        lists = _read_lists(raw, offset, order, _WIDTHS[message_type])
    except (KeyError, struct.error, ValueError) as error:
        raise MessageError(f"{len(raw)} bytes that are no {message_type.__name__}") from error
    stamp_ns = seconds * NANOSECONDS_PER_SECOND + nanoseconds
    return NamedLists(stamp_ns, frame_id, tuple(names), lists)


def _read_count(raw: bytes, offset: int, order: str) -> tuple[int, int]:
    """A length, and the offset behind it."""
    offset += _padding(offset, 4)  # the encapsulation header has four bytes as well
    (count,) = struct.unpack_from(f"{order}I", raw, offset)
    return count, offset + 4


def _read_text(raw: bytes, offset: int, order: str) -> tuple[str, int]:
    """A text, and the offset behind it; as ROS reads it, it ends before the first NUL."""
    length, offset = _read_count(raw, offset, order)
    end = offset + length
    if end > len(raw):
        raise ValueError("a text that is longer than the message")
    return raw[offset:end].partition(b"\0")[0].decode(errors="replace"), end


def _read_lists(raw: bytes, offset: int, order: str, widths: Sequence[int]) -> list[FloatArray]:
    """Lists of structures of so many doubles each, every list flat: (m * width,)."""
    lists = []
    for width in widths:
        count, offset = _read_count(raw, offset, order)
        values = _EMPTY
        if count:
            offset += _padding(offset - 4, 8)
            values = np.frombuffer(raw, f"{order}f8", count * width, offset).astype(float)
        lists.append(values)
        offset += values.nbytes
    return lists


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
        self._known_senders: dict[bytes, tuple[tuple[str, ...], str]] = {}  # names and frame_id

    def decode(self, raw: bytes) -> JointArrays:
        """The message's content.

        Raises:
            MessageError: the bytes are no JointState.
        """
        for head, texts in self._known_senders.items():
            if raw.startswith(head, _NAMES_START) and raw.startswith(CDR_LITTLE_ENDIAN):
                return _read_arrays(raw, _NAMES_START + len(head), *texts)
        stamp_ns, frame_id, names, lists = read_message(raw, JointState)
        head = _cdr_names(names, frame_id)
        if raw.startswith(head, _NAMES_START):
            # each start of a simulator is a new sender
            if len(self._known_senders) == _MAX_KEPT_SENDERS:
                del self._known_senders[next(iter(self._known_senders))]
            self._known_senders[head] = names, frame_id
        position, velocity, effort = lists
        return JointArrays(stamp_ns, names, position, velocity, effort, frame_id)


def _read_arrays(raw: bytes, offset: int, names: tuple[str, ...], frame_id: str) -> JointArrays:
    """The content of a little-endian message whose names are known and end at `offset`."""
    try:
        position, velocity, effort = _read_lists(raw, offset, "<", _WIDTHS[JointState])
    except (struct.error, ValueError) as error:
        raise MessageError(f"a JointState cut off after {len(raw)} bytes") from error
    seconds, nanoseconds = struct.unpack_from("<iI", raw, _STAMP)
    stamp_ns = seconds * NANOSECONDS_PER_SECOND + nanoseconds
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
