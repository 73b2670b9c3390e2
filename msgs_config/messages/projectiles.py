"""Balls as messages: how one is thrown, as `sensor_msgs/JointState`, and where those thrown are.

In a throw `name` has `mass`, `radius`, `x`, `y`, `z`, `vx`, `vy`, `vz`, and `position` their values
in kg, m and m/s, world axes; everything else in the message is unused. Where the balls are says
`sensor_msgs/MultiDOFJointState`: their poses in `transforms`, their velocities in `twist`.
"""

from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import Quaternion, Vector3
from sensor_msgs.msg import MultiDOFJointState

from msgs_config.arrays import FloatArray
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.joint_state import JointStateDecoder, JointStateEncoder, decode
from msgs_config.messages.throw import NUMBERS, ProjectileThrow, throw_of
from msgs_config.messages.wrenches import WORLD, encode_multi_dof

_POSE, _TWIST = slice(0, 7), slice(7, 13)


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
        self._encoder = JointStateEncoder(NUMBERS, frame_id)
        self._decoder = JointStateDecoder()

    def encode(self, stamp_ns: int, throw: ProjectileThrow) -> bytes:
        """The serialised message."""
        return self._encoder.encode(stamp_ns, throw.numbers())

    def decode(self, raw: bytes) -> tuple[int, ProjectileThrow]:
        """Stamp in ns and throw of a serialised message.

        Raises:
            MessageError: the bytes are no such message.
            CommandError: it is no throw that can be; see `throw_of`.
        """
        arrays = self._decoder.decode(raw)
        return arrays.stamp_ns, throw_of(arrays.names, arrays.position.tolist())


def ball_names(count: int) -> tuple[str, ...]:
    """The names of an episode's balls, in the order in which they were thrown."""
    return tuple(f"ball_{number}" for number in range(1, count + 1))


def encode_balls(balls: BallStates, frame_id: str = WORLD) -> bytes:
    """The serialised message."""
    rows = (balls.motion[:, _POSE], balls.motion[:, _TWIST], ())
    return encode_multi_dof(balls.stamp_ns, balls.names, *rows, frame_id=frame_id)


def decode_balls(raw: bytes) -> BallStates:
    """The content of a serialised message.

    Raises:
        MessageError: the bytes are no such message.
    """
    message = decode(raw, MultiDOFJointState)
    stamp = message.header.stamp
    rows = []
    for pose, twist in zip(message.transforms, message.twist, strict=False):
        at, turn, w = _xyz(pose.translation), _xyz(pose.rotation), pose.rotation.w
        rows.append((*at, *turn, w, *_xyz(twist.linear), *_xyz(twist.angular)))
    stamp_ns = stamp.sec * NANOSECONDS_PER_SECOND + stamp.nanosec
    motion = np.array(rows, dtype=float).reshape(-1, 13)
    return BallStates(stamp_ns, tuple(message.joint_names)[: len(rows)], motion)


def _xyz(vector: Vector3 | Quaternion) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z
