"""Messages of types that have no encoder of ours, by rosbags' definitions of them: no ROS in here.

Unlike rclpy's writer it fills the gaps before numbers with zeros: the same message is the same
bytes.
"""

from functools import cache
from operator import attrgetter
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from msgs_config.errors import MessageError
from msgs_config.messages.cdr import JOINT_STATE, padding, read_message, split_stamp
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.topic import find_message_class

JOINT_TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
_HEAD = 4  # bytes of the encapsulation header, which says the order of bytes
_READERS = {
    b"\0\0": attrgetter("deserialize_cdr_be"),
    b"\0\1": attrgetter("deserialize_cdr_le"),
}
_QUATERNION = "geometry_msgs/msg/Quaternion"  # its default is not zero
TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"


@cache
def types() -> Typestore:
    """The definitions of all message types of ROS 2 Jazzy's own packages."""
    return get_typestore(Stores.ROS2_JAZZY)


def constants(type_name: str) -> Any:
    """The class of a type, which has its constants."""
    return types().types[type_name]


def new(type_name: str, /, **fields: Any) -> Any:
    """A message with these fields; all others are as ROS has them by default."""
    _, definitions = types().fielddefs[type_name]
    values = {name: _default(kind) for name, kind in definitions if name not in fields}
    if type_name == _QUATERNION:
        values["w"] = 1.0
    return constants(type_name)(**{**values, **fields})


def _default(kind: Any) -> Any:
    node, detail = kind
    if node is Nodetype.BASE:
        return "" if detail[0] == "string" else _number(detail[0])(0)
    if node is Nodetype.NAME:
        return new(detail)
    (inner, inner_detail), count = detail
    count = count if node is Nodetype.ARRAY else 0
    if inner is Nodetype.BASE and inner_detail[0] != "string":
        return np.zeros(count, _number(inner_detail[0]))
    return [_default((inner, inner_detail)) for _ in range(count)]


def _number(name: str) -> Any:
    return np.dtype({"octet": "uint8", "byte": "uint8", "char": "uint8"}.get(name, name)).type


def stamped(type_name: str, stamp_ns: int, frame_id: str = "", **fields: Any) -> Any:
    """A message with a header of a stamp."""
    message = new(type_name, **fields)
    set_stamp(message, stamp_ns)
    message.header.frame_id = frame_id
    return message


def set_stamp(message: Any, stamp_ns: int) -> None:
    """Set the stamp of a message's header."""
    message.header.stamp.sec, message.header.stamp.nanosec = split_stamp(stamp_ns)


def stamp_of(message: Any) -> int:
    """The stamp of a message's header, ns."""
    return nanoseconds(message.header.stamp)


def nanoseconds(time: Any) -> int:
    """A time or duration of a message, ns."""
    return int(time.sec) * NANOSECONDS_PER_SECOND + int(time.nanosec)


def encode(message: Any) -> bytes:
    """A message, serialised, to whole words of four bytes, as DDS hands it on."""
    raw = bytes(types().serialize_cdr(message, message.__msgtype__))
    return raw + bytes(padding(len(raw), 4))


def decode(raw: bytes, type_name: str) -> Any:
    """A message from its serialised form.

    Raises:
        MessageError: the bytes are no such message.
    """
    try:
        try:
            return _read(raw, type_name)
        except Exception:  # what is too short or malformed raises anything
            return _read(_as_ros_reads_it(raw, type_name), type_name)
    except Exception as error:
        name = type_name.rpartition("/")[2]
        raise MessageError(f"{len(raw)} bytes that are no {name}") from error


def _read(raw: bytes, type_name: str) -> Any:
    """A message, without what a middleware may have left behind it."""
    definition = types().get_msgdef(type_name)
    read = _READERS[raw[:2]](definition)
    message, end = read(raw[_HEAD:], 0, definition.cls, types())
    if end > len(raw) - _HEAD:
        raise ValueError("a text that is longer than the message")
    return message


def _as_ros_reads_it(raw: bytes, type_name: str) -> bytes:
    """The message written anew by rclpy, which reads texts that are not UTF-8, or end nowhere."""
    from rclpy.serialization import deserialize_message, serialize_message

    if type_name == JOINT_STATE:  # the middleware would print a line if a list is too long
        read_message(raw, JOINT_STATE)
    return bytes(serialize_message(deserialize_message(raw, find_message_class(type_name))))
