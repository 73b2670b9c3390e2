"""Forces on links as `sensor_msgs/MultiDOFJointState`: pushes, what was applied, and contacts.

`joint_names` are links. `wrench` is in world axes. The translations of `transforms`, where there
are any, are points of application in the link frames; everything else in the message is unused.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.frame_names import WORLD
from msgs_config.geometry.rotations import IDENTITY_XYZW
from msgs_config.messages.cdr import (
    MULTI_DOF_JOINT_STATE,
    encode_arrays,
    encode_head,
    read_message,
    with_stamp,
)

NO_ROWS = np.zeros((0, 6))
_MAX_KEPT_HEADS = 256

Rows: TypeAlias = FloatArray | Sequence[FloatArray] | Sequence[tuple[float, ...]]


@dataclass(frozen=True)
class WrenchArrays:
    """Wrenches on m links, in the sender's order."""

    stamp_ns: int
    links: tuple[str, ...]  # (m,)
    wrenches: FloatArray  # (m, 6): force N, torque N m; world axes
    points: FloatArray  # (m, 3) in m, link frames; or (0, 3)
    frame_id: str = WORLD  # the frame, or the session that sent them

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
    transforms = NO_ROWS
    if len(wrenches.points):
        turns = np.tile(IDENTITY_XYZW, (len(wrenches.points), 1))
        transforms = np.hstack((wrenches.points, turns))
    head = encode_head(wrenches.links, wrenches.frame_id)
    lists = (transforms, NO_ROWS, wrenches.wrenches)
    return encode_arrays(with_stamp(head, wrenches.stamp_ns), lists)


class SelectionEncoder:
    """Serialises wrenches on some of a character's links, as `select` chooses them.

    Which links are touched changes seldom, so all bytes but stamp and wrenches are kept.
    """

    def __init__(self, names: Sequence[str], frame_id: str = WORLD) -> None:
        """The names of all links, in the order of the arrays' rows."""
        self._names = names
        self._frame_id = frame_id
        self._heads: dict[bytes, bytes] = {}  # heads by the bytes that choose links

    def encode(self, stamp_ns: int, wrenches: FloatArray, chosen: BoolArray) -> bytes:
        """The serialised message of those wrenches (links, 6) of which `chosen` (links,) is true.

        In N and N m, world axes.
        """
        key = chosen.tobytes()
        head = self._heads.get(key)
        if head is None:
            if len(self._heads) == _MAX_KEPT_HEADS:
                del self._heads[next(iter(self._heads))]
            head = self._heads[key] = self._make_head(chosen)
        return with_stamp(head, stamp_ns) + wrenches[chosen].tobytes()

    def _make_head(self, chosen: BoolArray) -> bytes:
        """The message but its wrenches, which are at its end."""
        rows = np.flatnonzero(chosen).tolist()
        blank = WrenchArrays.of_rows(
            0, [self._names[row] for row in rows], np.zeros((len(rows), 6)), [], self._frame_id
        )
        whole = encode_wrenches(blank)
        return whole[: len(whole) - blank.wrenches.nbytes]


def decode_wrenches(raw: bytes) -> WrenchArrays:
    """The content of a serialised message; lengths and numbers are as the sender gave them.

    Raises:
        MessageError: the bytes are no such message.
    """
    stamp_ns, frame_id, links, lists = read_message(raw, MULTI_DOF_JOINT_STATE)
    transforms, _, wrenches = lists
    points = transforms.reshape(-1, 7)[:, :3].copy()
    return WrenchArrays(stamp_ns, links, wrenches.reshape(-1, 6), points, frame_id)


def select(
    stamp_ns: int,
    names: Sequence[str],
    wrenches: FloatArray,
    touched: BoolArray,
    frame_id: str = WORLD,
) -> WrenchArrays:
    """Those of the wrenches (links, 6), N and N m, of which `touched` (links,) is true."""
    chosen = np.flatnonzero(touched).tolist()
    links = [names[row] for row in chosen]
    return WrenchArrays.of_rows(stamp_ns, links, wrenches[chosen], [], frame_id)
