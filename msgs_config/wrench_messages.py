"""Forces on links as `sensor_msgs/MultiDOFJointState`: pushes, what was applied, and contacts.

`joint_names` are links. `wrench` is in world axes. The translations of `transforms`, where there
are any, are points of application in the link frames; everything else in the message is unused.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from sensor_msgs.msg import MultiDOFJointState

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.messages import CDR_LITTLE_ENDIAN, cdr_names, decode, padding, split_stamp
from msgs_config.tick_clock import NANOSECONDS_PER_SECOND

WORLD = "world"
"""The frame of everything that is given in the world."""

Rows: TypeAlias = FloatArray | Sequence[FloatArray] | Sequence[tuple[float, ...]]

_NO_TURN_XYZW = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class WrenchArrays:
    """Wrenches on m links, in the sender's order."""

    stamp_ns: int
    links: tuple[str, ...]  # (m,)
    wrenches: FloatArray  # (m, 6): force N, torque N m; world axes
    points: FloatArray  # (m, 3) in m, link frames; or (0, 3)

    @classmethod
    def of_rows(
        cls,
        stamp_ns: int,
        links: Sequence[str],
        wrenches: Rows,
        points: Rows,
    ) -> "WrenchArrays":
        """From one wrench (6,) and one point (3,) a link."""
        return cls(
            stamp_ns,
            tuple(links),
            np.array(wrenches, dtype=float).reshape(-1, 6),
            np.array(points, dtype=float).reshape(-1, 3),
        )


def encode_wrenches(wrenches: WrenchArrays) -> bytes:
    """The serialised message, its `frame_id` the world."""
    content = bytearray(CDR_LITTLE_ENDIAN)
    content += struct.pack("<iI", *split_stamp(wrenches.stamp_ns))
    content += cdr_names(wrenches.links, frame_id=WORLD)
    transforms: Rows = ()  # mostly: then as little work as can be
    if len(wrenches.points):
        turns = np.tile(_NO_TURN_XYZW, (len(wrenches.points), 1))
        transforms = np.hstack((wrenches.points, turns))
    for rows in (transforms, (), wrenches.wrenches):
        content += struct.pack("<I", len(rows))
        if len(rows):
            content += bytes(padding(len(content) - 4, 8)) + np.asarray(rows, float).tobytes()
    return bytes(content)


def decode_wrenches(raw: bytes) -> WrenchArrays:
    """The content of a serialised message; lengths and numbers are as they came.

    Raises:
        MessageError: the bytes are no such message.
    """
    message = decode(raw, MultiDOFJointState)
    stamp = message.header.stamp
    wrenches = [
        (w.force.x, w.force.y, w.force.z, w.torque.x, w.torque.y, w.torque.z)
        for w in message.wrench
    ]
    points = [(t.translation.x, t.translation.y, t.translation.z) for t in message.transforms]
    stamp_ns = stamp.sec * NANOSECONDS_PER_SECOND + stamp.nanosec
    return WrenchArrays.of_rows(stamp_ns, message.joint_names, wrenches, points)


def select(
    stamp_ns: int, names: Sequence[str], wrenches: FloatArray, touched: BoolArray
) -> WrenchArrays:
    """Those of the wrenches (links, 6), N and N m, of which `touched` (links,) is true."""
    chosen = np.flatnonzero(touched).tolist()
    return WrenchArrays.of_rows(stamp_ns, [names[row] for row in chosen], wrenches[chosen], [])
