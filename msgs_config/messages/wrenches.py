"""Forces on links as `sensor_msgs/MultiDOFJointState`: pushes, what was applied, and contacts.

`joint_names` are links. `wrench` is in world axes. The translations of `transforms`, where there
are any, are points of application in the link frames; everything else in the message is unused.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from sensor_msgs.msg import MultiDOFJointState

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.joint_state import (
    CDR_LITTLE_ENDIAN,
    cdr_names,
    decode,
    padding,
    split_stamp,
    with_stamp,
)

WORLD = "world"
"""The frame of everything that is given in the world."""

Rows: TypeAlias = FloatArray | Sequence[FloatArray] | Sequence[tuple[float, ...]]

_MOST_KEPT_HEADS = 256
_HEADER_END = 16  # of the encapsulation header, the stamp and the length of the frame's name
_NO_ROWS = {columns: np.zeros((0, columns)) for columns in (6, 7)}
_NO_POINTS = np.zeros((0, 3))
_NO_TURN_XYZW = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class WrenchArrays:
    """Wrenches on m links, in the sender's order."""

    stamp_ns: int
    links: tuple[str, ...]  # (m,)
    wrenches: FloatArray  # (m, 6): force N, torque N m; world axes
    points: FloatArray  # (m, 3) in m, link frames; or (0, 3)
    frame_id: str = WORLD  # or the session that it is of

    @classmethod
    def of_rows(
        cls,
        stamp_ns: int,
        links: Sequence[str],
        wrenches: Rows,
        points: Rows,
        frame_id: str = WORLD,
    ) -> "WrenchArrays":
        """From one wrench (6,) and one point (3,) a link."""
        return cls(
            stamp_ns,
            tuple(links),
            np.array(wrenches, dtype=float).reshape(-1, 6),
            np.array(points, dtype=float).reshape(-1, 3),
            frame_id,
        )


def encode_wrenches(wrenches: WrenchArrays) -> bytes:
    """The serialised message."""
    transforms: Rows = ()  # mostly: then as little work as can be
    if len(wrenches.points):
        turns = np.tile(_NO_TURN_XYZW, (len(wrenches.points), 1))
        transforms = np.hstack((wrenches.points, turns))
    rows = (transforms, (), wrenches.wrenches)
    return encode_multi_dof(wrenches.stamp_ns, wrenches.links, *rows, frame_id=wrenches.frame_id)


def encode_multi_dof(
    stamp_ns: int,
    names: Sequence[str],
    transforms: Rows,
    twists: Rows,
    wrenches: Rows,
    *,
    frame_id: str = WORLD,
) -> bytes:
    """A serialised MultiDOFJointState.

    Rows are of 7 (translation, rotation xyzw), 6 (linear, angular) and 6 numbers (force, torque).
    """
    content = bytearray(CDR_LITTLE_ENDIAN)
    content += struct.pack("<iI", *split_stamp(stamp_ns))
    content += cdr_names(names, frame_id)
    for rows in (transforms, twists, wrenches):
        content += struct.pack("<I", len(rows))
        if len(rows):
            content += bytes(padding(len(content) - 4, 8)) + np.asarray(rows, float).tobytes()
    return bytes(content)


def decode_wrenches(raw: bytes) -> WrenchArrays:
    """The content of a serialised message; lengths and numbers are as they came.

    Raises:
        MessageError: the bytes are no such message.
    """
    try:
        plain = _decode_plainly(raw)
    except (struct.error, ValueError):  # what is wrong with it, the middleware may know
        plain = None
    return _decode_slowly(raw) if plain is None else plain


def _decode_plainly(raw: bytes) -> WrenchArrays | None:
    """The content of a little-endian message; None if the message is of another kind.

    Each of a recording's ticks has such messages, and the middleware takes 50 us for one.
    """
    if not raw.startswith(CDR_LITTLE_ENDIAN):
        return None
    seconds, nanoseconds, length = struct.unpack_from("<iII", raw, 4)
    if raw.find(b"\0", _HEADER_END, _HEADER_END + length) != _HEADER_END + length - 1:
        return None
    frame_id = str(raw[_HEADER_END : _HEADER_END + length - 1], "utf-8")
    count, offset = _count_at(raw, _HEADER_END + length)
    names = []
    for _ in range(count):
        length, offset = _count_at(raw, offset)
        if raw.find(b"\0", offset, offset + length) != offset + length - 1:
            return None  # not ended as it should be, or before; or longer than the message
        names.append(str(raw[offset : offset + length - 1], "utf-8"))
        offset += length
    transforms, offset = _doubles_at(raw, offset, 7)
    _, offset = _doubles_at(raw, offset, 6)
    wrenches, offset = _doubles_at(raw, offset, 6)
    stamp_ns = seconds * NANOSECONDS_PER_SECOND + nanoseconds
    points = transforms[:, :3].copy() if len(transforms) else _NO_POINTS  # mostly
    return WrenchArrays(stamp_ns, tuple(names), wrenches, points, frame_id)


def _count_at(raw: bytes, offset: int) -> tuple[int, int]:
    """A length, and the offset behind it."""
    offset += padding(offset, 4)  # the encapsulation header has four bytes as well
    (count,) = struct.unpack_from("<I", raw, offset)
    return count, offset + 4


def _doubles_at(raw: bytes, offset: int, columns: int) -> tuple[FloatArray, int]:
    """A list of structures of doubles as rows, and the offset behind it."""
    count, offset = _count_at(raw, offset)
    if not count:
        return _NO_ROWS[columns], offset
    offset += padding(offset - 4, 8)
    rows = np.frombuffer(raw, "<f8", count * columns, offset).reshape(count, columns)
    return rows.copy(), offset + rows.nbytes


def _decode_slowly(raw: bytes) -> WrenchArrays:
    message = decode(raw, MultiDOFJointState)
    stamp = message.header.stamp
    wrenches = [
        (w.force.x, w.force.y, w.force.z, w.torque.x, w.torque.y, w.torque.z)
        for w in message.wrench
    ]
    points = [(t.translation.x, t.translation.y, t.translation.z) for t in message.transforms]
    stamp_ns = stamp.sec * NANOSECONDS_PER_SECOND + stamp.nanosec
    frame_id = str(message.header.frame_id)
    return WrenchArrays.of_rows(stamp_ns, message.joint_names, wrenches, points, frame_id)


class ContactEncoder:
    """Serialises what touches a character's links; fast for links that have touched together."""

    def __init__(self, links: Sequence[str], frame_id: str = WORLD) -> None:
        """Names of all links, in the order of the arrays."""
        self._links = links
        self._frame_id = frame_id
        self._heads: dict[bytes, bytes] = {}  # by which links touch: all before the numbers

    def encode(self, stamp_ns: int, wrenches: FloatArray, touching: BoolArray) -> bytes:
        """The serialised message with those of the wrenches (links, 6), N and N m, that touch.

        It is `encode_wrenches` of `select`, with the frame's name, to the byte.
        """
        key = touching.tobytes()
        head = self._heads.get(key)
        if head is None:
            if len(self._heads) == _MOST_KEPT_HEADS:
                self._heads.clear()
            selected = select(0, self._links, wrenches, touching)
            chosen = encode_wrenches(replace(selected, frame_id=self._frame_id))
            head = self._heads[key] = chosen[: len(chosen) - 8 * 6 * np.count_nonzero(touching)]
        return with_stamp(head, stamp_ns) + wrenches[touching].tobytes()


def select(
    stamp_ns: int, names: Sequence[str], wrenches: FloatArray, touched: BoolArray
) -> WrenchArrays:
    """Those of the wrenches (links, 6), N and N m, of which `touched` (links,) is true."""
    chosen = np.flatnonzero(touched).tolist()
    return WrenchArrays.of_rows(stamp_ns, [names[row] for row in chosen], wrenches[chosen], [])
