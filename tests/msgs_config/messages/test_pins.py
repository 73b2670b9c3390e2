"""Pins are whole ROS messages in both directions."""

import numpy as np
import pytest
from geometry_msgs.msg import Transform, Twist, Wrench
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import MultiDOFJointState

from msgs_config.errors import MessageError
from msgs_config.messages.pins import LET_GO, PinArrays, decode_pins, encode_pins

STAMP_NS = 3 * 10**9 + 7
ROWS = {"hand": (1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 90.0), "neck": LET_GO}


def test_what_is_sent_is_read_by_ros_and_back() -> None:
    raw = encode_pins(PinArrays.of_rows(STAMP_NS, ROWS, "/sim_node#1"))

    message = deserialize_message(raw, MultiDOFJointState)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (3, 7)
    assert message.header.frame_id == "/sim_node#1"
    assert message.joint_names == ["hand", "neck"]
    place, point = message.transforms[0].translation, message.twist[0].linear
    assert (place.x, place.y, place.z) == (1.0, 2.0, 3.0)
    assert message.transforms[0].rotation.w == 1.0
    assert (point.x, point.y, point.z) == (0.1, 0.2, 0.3)
    assert [wrench.force.x for wrench in message.wrench] == [90.0, 0.0]
    found = decode_pins(serialize_message(message))
    assert (found.stamp_ns, found.rows, found.frame_id) == (STAMP_NS, ROWS, "/sim_node#1")


def test_points_and_places_may_be_left_out() -> None:
    message = MultiDOFJointState(joint_names=["hand"], wrench=[Wrench()])

    found = decode_pins(serialize_message(message))

    assert (len(found.places), len(found.points), found.forces.tolist()) == (0, 0, [0.0])


def test_lengths_are_as_the_sender_gave_them() -> None:
    message = MultiDOFJointState(
        joint_names=["hand"], transforms=[Transform()] * 2, twist=[Twist()] * 3
    )

    found = decode_pins(serialize_message(message))

    assert (len(found.places), len(found.points), len(found.forces)) == (2, 3, 0)


def test_no_pins_are_a_message_too() -> None:
    found = decode_pins(encode_pins(PinArrays.of_rows(STAMP_NS, {})))

    assert found.rows == {} and found.places.shape == (0, 3)


def test_other_bytes_are_no_pins() -> None:
    with pytest.raises(MessageError):
        decode_pins(b"\x00\x01\x00\x00\xff\xff\xff\xff")
    with pytest.raises(MessageError):
        decode_pins(np.zeros(3).tobytes())
