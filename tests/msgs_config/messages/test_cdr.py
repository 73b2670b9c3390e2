"""Serialised messages are those of ROS, and what is cut off is refused."""

import numpy as np
import pytest
from geometry_msgs.msg import Transform, Twist, Wrench, WrenchStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Header

from msgs_config.errors import MessageError
from msgs_config.messages.cdr import (
    MULTI_DOF_JOINT_STATE,
    DoublesEncoder,
    encode_arrays,
    encode_clock,
    encode_head,
    read_frame_id,
    read_message,
    with_stamp,
)

SECOND = 10**9
stamps = st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(0, SECOND - 1)).map(
    lambda parts: parts[0] * SECOND + parts[1]
)
frame_ids = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=12)


@settings(max_examples=120, deadline=None)
@given(stamps)
def test_ros_reads_the_clock(stamp_ns: int) -> None:
    message = deserialize_message(encode_clock(stamp_ns), Clock)

    assert message.clock.sec * SECOND + message.clock.nanosec == stamp_ns
    assert 0 <= message.clock.nanosec < SECOND


@settings(max_examples=60, deadline=None)
@given(stamps, frame_ids, st.integers(0, 4))
def test_lists_of_rows_are_read_by_ros_and_back(stamp_ns: int, frame_id: str, rows: int) -> None:
    names = [f"link_{row}" for row in range(rows)]
    lists = [np.arange(rows * width, dtype=float).reshape(-1, width) for width in (7, 6, 6)]

    raw = encode_arrays(with_stamp(encode_head(names, frame_id), stamp_ns), lists)

    message = deserialize_message(raw, MultiDOFJointState)
    assert message.header.stamp.sec * SECOND + message.header.stamp.nanosec == stamp_ns
    assert (message.joint_names, message.header.frame_id) == (names, frame_id)
    flat = [
        [(t.translation.x, t.rotation.w) for t in message.transforms],
        [(t.linear.x, t.angular.z) for t in message.twist],
        [(w.force.x, w.torque.z) for w in message.wrench],
    ]
    assert flat == [[(row[0], row[-1]) for row in rows] for rows in lists]
    found = read_message(raw, MULTI_DOF_JOINT_STATE)
    assert found[:3] == (stamp_ns, frame_id, tuple(names))
    for values, wanted in zip(found.lists, lists, strict=True):
        np.testing.assert_array_equal(values, wanted.ravel())


def test_what_ros_wrote_is_read() -> None:
    message = MultiDOFJointState(joint_names=["chest"], transforms=[Transform()])
    message.twist, message.wrench = [Twist()], [Wrench()]
    message.transforms[0].translation.y = 2.0
    message.wrench[0].torque.z = -3.0
    message.header.frame_id = "größe"

    found = read_message(serialize_message(message), MULTI_DOF_JOINT_STATE)

    assert (found.frame_id, found.names) == ("größe", ("chest",))
    np.testing.assert_array_equal(found.lists[0], [0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    np.testing.assert_array_equal(found.lists[2], [0.0, 0.0, 0.0, 0.0, 0.0, -3.0])


def test_doubles_behind_texts_are_read_by_ros() -> None:
    raw = DoublesEncoder("odd").encode(7 * SECOND + 1, np.arange(6.0))

    message = deserialize_message(raw, WrenchStamped)

    assert (message.header.frame_id, message.header.stamp.sec) == ("odd", 7)
    assert (message.wrench.force.y, message.wrench.torque.z) == (1.0, 5.0)


def test_a_header_that_is_cut_off_names_no_frame() -> None:
    raw = serialize_message(Header(frame_id="base"))

    assert read_frame_id(raw) == "base"
    for length in range(len(raw) - 1):
        with pytest.raises(MessageError, match="header"):
            read_frame_id(raw[:length])
