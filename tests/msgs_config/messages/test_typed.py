"""Messages by rosbags' definitions, against rclpy's own classes."""

import struct

import pytest
from geometry_msgs.msg import TwistStamped
from rclpy.serialization import deserialize_message, serialize_message
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from msgs_config.errors import MessageError
from msgs_config.messages import typed
from msgs_config.messages.cdr import CDR_LITTLE_ENDIAN, padding, with_stamp
from msgs_config.messages.topic import find_message_class
from msgs_config.messages.topics import TABLE

TYPES = sorted({topic.type_name for topic in TABLE if topic.is_installed})


@pytest.mark.parametrize("name", TYPES)
def test_a_message_without_fields_is_what_ros_makes(name: str) -> None:
    message_type = find_message_class(name)

    assert deserialize_message(typed.encode(typed.new(name)), message_type) == message_type()


@pytest.mark.parametrize("name", TYPES)
def test_what_ros_writes_is_read(name: str) -> None:
    raw = bytes(serialize_message(find_message_class(name)()))

    assert typed.encode(typed.decode(raw, name)) == typed.encode(typed.new(name))


def test_what_a_middleware_leaves_behind_a_message_does_not_count() -> None:
    point = JointTrajectoryPoint(positions=[1.0])  # whose empty lists it took room for
    raw = bytes(serialize_message(JointTrajectory(joint_names=["knee"], points=[point])))

    message = typed.decode(raw, typed.JOINT_TRAJECTORY)

    assert message.joint_names == ["knee"]
    assert message.points[0].positions.tolist() == [1.0]
    assert len(typed.encode(message)) < len(raw)


@pytest.mark.parametrize("frame_id", [b"20 \xb0C", b"no end"])
def test_texts_are_read_as_ros_reads_them(frame_id: bytes) -> None:
    raw = with_stamp(CDR_LITTLE_ENDIAN + bytes(8), 10**9) + struct.pack("<I", len(frame_id))
    raw += frame_id + bytes(padding(len(raw + frame_id) - 4, 8)) + bytes(48)
    expected = deserialize_message(raw, TwistStamped).header

    header = typed.decode(raw, typed.TWIST_STAMPED).header

    assert (header.frame_id, header.stamp.sec) == (expected.frame_id, expected.stamp.sec)


def test_the_same_message_is_the_same_bytes_in_whole_words() -> None:
    messages = [typed.stamped(typed.TWIST_STAMPED, 1_500_000_000, frame_id="odd") for _ in range(2)]

    first, second = map(typed.encode, messages)

    assert first == second
    assert len(first) % 4 == 0
    assert typed.stamp_of(typed.decode(first, typed.TWIST_STAMPED)) == 1_500_000_000


@pytest.mark.parametrize("raw", [b"", b"\0\1\0\0", b"\0\1\0\0" + bytes(6)])
def test_other_bytes_are_refused(raw: bytes) -> None:
    with pytest.raises(MessageError, match=f"{len(raw)} bytes that are no TwistStamped"):
        typed.decode(raw, typed.TWIST_STAMPED)
