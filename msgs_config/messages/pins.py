"""Pins as `sensor_msgs/MultiDOFJointState`: those that are wanted, and those that are in force.

`joint_names` are links. The translations of `transforms` are where in the world the links' points
are held. The linear parts of `twist`, where there are any, are these points, m in the link frames,
and no velocities; without them the links' origins are held. `force.x` of `wrench` is the largest
force, N; 0 lets go. Everything else in the message is unused.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.frame_names import WORLD
from msgs_config.geometry.rotations import IDENTITY_XYZW
from msgs_config.messages.cdr import (
    MULTI_DOF_JOINT_STATE,
    encode_arrays,
    encode_head,
    read_message,
    with_stamp,
)

PinRow: TypeAlias = tuple[float, ...]
"""Place (3) m, world; point (3) m, link frame; largest force, N."""

LET_GO: PinRow = (0.0,) * 7


@dataclass(frozen=True)
class PinArrays:
    """Pins of m links, in the sender's order."""

    stamp_ns: int
    links: tuple[str, ...]  # (m,)
    places: FloatArray  # (m, 3) m, world; or (0, 3), where all let go
    points: FloatArray  # (m, 3) m, link frames; or (0, 3): the links' origins
    forces: FloatArray  # (m,) N, the largest; 0 lets go
    frame_id: str = WORLD  # the frame, or the session that sent them

    @classmethod
    def of_rows(
        cls, stamp_ns: int, rows: Mapping[str, PinRow], frame_id: str = WORLD
    ) -> "PinArrays":
        """From what is said of each link."""
        numbers = np.array(list(rows.values()), dtype=float).reshape(-1, len(LET_GO))
        places, points, forces = numbers[:, :3], numbers[:, 3:6], numbers[:, 6]
        return cls(stamp_ns, tuple(rows), places, points, forces, frame_id)

    @property
    def rows(self) -> dict[str, PinRow]:
        """What is said of each link, in the sender's order; there have to be places and points."""
        numbers = np.column_stack((self.places, self.points, self.forces)).tolist()
        return {link: tuple(row) for link, row in zip(self.links, numbers, strict=True)}


def encode_pins(pins: PinArrays) -> bytes:
    """The serialised message."""
    turns = np.tile(IDENTITY_XYZW, (len(pins.places), 1))
    still = np.zeros((len(pins.points), 3))
    wrenches = np.zeros((len(pins.forces), 6))
    wrenches[:, 0] = pins.forces
    lists = (np.hstack((pins.places, turns)), np.hstack((pins.points, still)), wrenches)
    head = encode_head(pins.links, pins.frame_id)
    return encode_arrays(with_stamp(head, pins.stamp_ns), lists)


def decode_pins(raw: bytes) -> PinArrays:
    """The content of a serialised message; lengths and numbers are as the sender gave them.

    Raises:
        MessageError: the bytes are no such message.
    """
    stamp_ns, frame_id, links, (transforms, twists, wrenches) = read_message(
        raw, MULTI_DOF_JOINT_STATE
    )
    places, points = transforms.reshape(-1, 7)[:, :3], twists.reshape(-1, 6)[:, :3]
    forces = wrenches.reshape(-1, 6)[:, 0]
    return PinArrays(stamp_ns, links, places.copy(), points.copy(), forces.copy(), frame_id)
