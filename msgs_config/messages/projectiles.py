"""Balls as messages: how one is thrown, as `sensor_msgs/JointState`, and where those thrown are.

In a throw `name` has `mass`, `radius`, `x`, `y`, `z`, `vx`, `vy`, `vz`, and `position` their values
in kg, m and m/s, world axes; everything else in the message is unused. A box, which is a ball of
another shape to all who handle them, has `size_x`, `size_y`, `size_z` in m in place of the radius,
and may have `yaw` in rad. Where the balls are says `sensor_msgs/MultiDOFJointState`: their poses in
`transforms`, their velocities in `twist`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.frame_names import WORLD
from msgs_config.messages.cdr import (
    MULTI_DOF_JOINT_STATE,
    encode_arrays,
    encode_head,
    read_message,
    with_stamp,
)
from msgs_config.messages.joint_state import JointStateDecoder, JointStateEncoder
from msgs_config.messages.throw import BOX_NUMBERS, NUMBERS, ProjectileThrow, parse_throw
from msgs_config.messages.wrenches import NO_ROWS


@dataclass(frozen=True)
class BallStates:
    """Where m balls are, and how they move."""

    stamp_ns: int
    names: tuple[str, ...]  # (m,)
    # (m, 13): centre m, orientation xyzw, velocity m/s, angular velocity rad/s; world axes
    motion: FloatArray


class ThrowCodec:
    """Throws to and from serialised messages."""

    def __init__(self, frame_id: str = "") -> None:
        """`frame_id` is that of what it encodes."""
        self._encoders: dict[tuple[str, ...], JointStateEncoder] = {
            names: JointStateEncoder(names, frame_id) for names in (NUMBERS, BOX_NUMBERS)
        }
        self._decoder = JointStateDecoder()

    def encode(self, stamp_ns: int, throw: ProjectileThrow) -> bytes:
        """The serialised message."""
        return self._encoders[throw.names].encode(stamp_ns, throw.numbers())

    def decode(self, raw: bytes) -> tuple[int, ProjectileThrow]:
        """Stamp in ns and throw of a serialised message.

        Raises:
            MessageError: the bytes are no such message.
            CommandError: it is no throw that can be; see `parse_throw`.
        """
        arrays = self._decoder.decode(raw)
        return arrays.stamp_ns, parse_throw(arrays.names, arrays.position.tolist())


def ball_names(throws: Sequence[ProjectileThrow], first: int = 1) -> tuple[str, ...]:
    """The names of an episode's balls and boxes, in the order in which they were thrown.

    They are numbered together, from `first` on.
    """
    return tuple(
        f"{'ball' if throw.size is None else 'box'}_{number}"
        for number, throw in enumerate(throws, start=first)
    )


def encode_balls(balls: BallStates, frame_id: str = WORLD) -> bytes:
    """The serialised message."""
    head = with_stamp(encode_head(balls.names, frame_id), balls.stamp_ns)
    return encode_arrays(head, (balls.motion[:, :7], balls.motion[:, 7:], NO_ROWS))


def decode_balls(raw: bytes) -> BallStates:
    """The content of a serialised message.

    Raises:
        MessageError: the bytes are no such message.
    """
    stamp_ns, _, names, lists = read_message(raw, MULTI_DOF_JOINT_STATE)
    poses, twists = lists[0].reshape(-1, 7), lists[1].reshape(-1, 6)
    count = min(len(names), len(poses), len(twists))
    motion = np.hstack((poses[:count], twists[:count]))
    return BallStates(stamp_ns, names[:count], motion)
