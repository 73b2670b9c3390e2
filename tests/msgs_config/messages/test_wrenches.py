"""Forces on links are whole ROS messages in both directions, and hostile bytes do no harm."""

import random
import struct
from dataclasses import replace

import numpy as np
import pytest
from geometry_msgs.msg import Transform, Twist, Wrench
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState, MultiDOFJointState

from msgs_config.arrays import FloatArray
from msgs_config.errors import MessageError
from msgs_config.messages.joint_state import JointStateEncoder, with_stamp
from msgs_config.messages.wrenches import (
    ContactEncoder,
    WrenchArrays,
    decode_wrenches,
    encode_wrenches,
    select,
)

PROPERTY = settings(max_examples=150, deadline=None)
SECOND = 10**9
SPECIALS = [0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, np.finfo(float).max]

# ROS strings hold no NUL, and UTF-8 no surrogates.
texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=9)
numbers = st.one_of(st.sampled_from(SPECIALS), st.floats(allow_subnormal=True))
stamps = st.tuples(
    st.one_of(st.sampled_from([-(2**31), -1, 0, 2**31 - 1]), st.integers(-(2**31), 2**31 - 1)),
    st.integers(0, SECOND - 1),
).map(lambda parts: parts[0] * SECOND + parts[1])


def rows(width: int) -> st.SearchStrategy[FloatArray]:
    return st.integers(0, 4).flatmap(lambda count: arrays(float, (count, width), elements=numbers))


any_wrenches = st.builds(
    WrenchArrays,
    stamp_ns=stamps,
    links=st.lists(texts, max_size=4).map(tuple),
    wrenches=rows(6),
    points=rows(3),
)


def same_bits(one: FloatArray, other: FloatArray) -> bool:
    """Whether two arrays have one shape and the same numbers, to the bit; any NaN is NaN."""
    bits = [np.where(np.isnan(array), np.nan, array).tobytes() for array in (one, other)]
    return one.shape == other.shape and bits[0] == bits[1]


def message_of(wrenches: WrenchArrays) -> MultiDOFJointState:
    """The message as ROS itself would make it."""
    message = MultiDOFJointState(joint_names=list(wrenches.links))
    message.header.frame_id = "world"
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(wrenches.stamp_ns, SECOND)
    for row in wrenches.wrenches.tolist():
        wrench = Wrench()
        wrench.force.x, wrench.force.y, wrench.force.z = row[:3]
        wrench.torque.x, wrench.torque.y, wrench.torque.z = row[3:]
        message.wrench.append(wrench)
    for x, y, z in wrenches.points.tolist():
        transform = Transform()
        transform.translation.x, transform.translation.y, transform.translation.z = x, y, z
        message.transforms.append(transform)
    return message


def numbers_of(message: MultiDOFJointState) -> tuple[FloatArray, FloatArray]:
    """Wrenches (m, 6) and points (m, 3), field by field."""
    wrenches = [
        [getattr(getattr(w, part), axis) for part in ("force", "torque") for axis in "xyz"]
        for w in message.wrench
    ]
    points = [[getattr(t.translation, axis) for axis in "xyz"] for t in message.transforms]
    return np.array(wrenches).reshape(-1, 6), np.array(points).reshape(-1, 3)


# Out


@PROPERTY
@given(any_wrenches)
def test_ros_reads_what_was_written(wrenches: WrenchArrays) -> None:
    message = deserialize_message(encode_wrenches(wrenches), MultiDOFJointState)

    stamp = message.header.stamp
    assert stamp.sec * SECOND + stamp.nanosec == wrenches.stamp_ns
    assert message.header.frame_id == "world"
    assert tuple(message.joint_names) == wrenches.links
    assert len(message.twist) == 0
    for ours, theirs in zip((wrenches.wrenches, wrenches.points), numbers_of(message), strict=True):
        assert same_bits(ours, theirs)
    for transform in message.transforms:
        turn = transform.rotation
        assert (turn.x, turn.y, turn.z, turn.w) == (0.0, 0.0, 0.0, 1.0)


@PROPERTY
@given(any_wrenches)
def test_the_message_that_ros_makes_of_the_same_content_is_the_same(
    wrenches: WrenchArrays,
) -> None:
    ours = deserialize_message(encode_wrenches(wrenches), MultiDOFJointState)

    # through ROS' own writer, as padding and the end are not always the same bytes
    theirs = deserialize_message(serialize_message(message_of(wrenches)), MultiDOFJointState)
    again = deserialize_message(serialize_message(ours), MultiDOFJointState)

    assert repr(ours) == repr(theirs)
    assert repr(again) == repr(ours)


def test_without_links_the_lists_are_empty_and_the_stamp_is_there() -> None:
    empty = WrenchArrays.of_rows(7 * SECOND + 5, (), [], [])

    message = deserialize_message(encode_wrenches(empty), MultiDOFJointState)

    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (7, 5)
    assert not message.joint_names
    assert not message.wrench
    assert not message.transforms
    assert not message.twist


def test_rows_of_several_kinds_become_arrays() -> None:
    made = WrenchArrays.of_rows(
        1, ["a", "b"], [np.arange(6.0), np.ones(6)], [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]
    )

    assert made.links == ("a", "b")
    np.testing.assert_array_equal(made.wrenches, [[0, 1, 2, 3, 4, 5], [1] * 6])
    np.testing.assert_array_equal(made.points, [[1, 2, 3], [4, 5, 6]])


def test_only_what_touches_is_selected() -> None:
    # Arrange
    wrenches = np.arange(24.0).reshape(4, 6)

    # Act
    selected = select(5, ["a", "b", "c", "d"], wrenches, np.array([False, True, False, True]))

    # Assert
    assert selected.stamp_ns == 5
    assert selected.links == ("b", "d")
    np.testing.assert_array_equal(selected.wrenches, wrenches[[1, 3]])
    assert selected.points.shape == (0, 3)


def test_where_nothing_touches_the_selection_is_an_empty_message() -> None:
    selected = select(5, ["a", "b"], np.zeros((2, 6)), np.zeros(2, dtype=np.bool_))

    decoded = decode_wrenches(encode_wrenches(selected))

    assert decoded.stamp_ns == 5
    assert decoded.links == ()
    assert decoded.wrenches.shape == (0, 6)
    assert decoded.points.shape == (0, 3)


@PROPERTY
@given(st.data())
def test_the_contacts_of_a_character_are_the_message_of_what_was_selected(
    data: st.DataObject,
) -> None:
    links = ["left_ankle", "chest", "größer", "r"]
    encoder = ContactEncoder(links)
    for stamp_ns in (0, 3 * SECOND + 7, 5 * SECOND):  # heads are kept from one to the next
        wrenches = data.draw(arrays(float, (4, 6), elements=numbers))
        touching = data.draw(arrays(np.bool_, 4))

        raw = encoder.encode(stamp_ns, wrenches, touching)

        assert raw == encode_wrenches(select(stamp_ns, links, wrenches, touching))


def test_a_message_with_another_stamp_is_the_same_otherwise() -> None:
    wrenches = WrenchArrays.of_rows(1, ["a"], [np.arange(6.0)], [(1.0, 2.0, 3.0)])

    raw = with_stamp(encode_wrenches(wrenches), 7 * SECOND + 5)

    assert raw == encode_wrenches(replace(wrenches, stamp_ns=7 * SECOND + 5))


# In


@PROPERTY
@given(any_wrenches)
def test_what_was_written_is_read_again(wrenches: WrenchArrays) -> None:
    decoded = decode_wrenches(encode_wrenches(wrenches))

    assert decoded.stamp_ns == wrenches.stamp_ns
    assert decoded.links == wrenches.links
    assert same_bits(decoded.wrenches, wrenches.wrenches)
    assert same_bits(decoded.points, wrenches.points)


@PROPERTY
@given(any_wrenches)
def test_what_ros_wrote_is_read(wrenches: WrenchArrays) -> None:
    decoded = decode_wrenches(serialize_message(message_of(wrenches)))

    assert decoded.stamp_ns == wrenches.stamp_ns
    assert decoded.links == wrenches.links
    assert same_bits(decoded.wrenches, wrenches.wrenches)
    assert same_bits(decoded.points, wrenches.points)


def test_turns_twists_and_the_frame_are_not_looked_at() -> None:
    # Arrange
    message = message_of(WrenchArrays.of_rows(3, ["a"], [np.arange(6.0)], [(1.0, 2.0, 3.0)]))
    message.header.frame_id = "elsewhere"
    message.transforms[0].rotation.x = 0.7
    message.twist = [Twist(), Twist()]

    # Act
    decoded = decode_wrenches(serialize_message(message))

    # Assert
    assert decoded.links == ("a",)
    np.testing.assert_array_equal(decoded.wrenches, [np.arange(6.0)])
    np.testing.assert_array_equal(decoded.points, [[1.0, 2.0, 3.0]])


def test_a_big_endian_message_is_read_too() -> None:
    # Arrange: one link "ab" with one wrench, written down from the specification
    head = struct.pack(">iII", 5, 6, 1) + bytes(4)  # stamp, empty frame, padded
    names = struct.pack(">II", 1, 3) + b"ab\0" + bytes(1)
    content = head + names + struct.pack(">III", 0, 0, 1)
    content += bytes(-len(content) % 8) + struct.pack(">6d", 1, 2, 3, 4, 5, 6)

    # Act
    decoded = decode_wrenches(b"\x00\x00\x00\x00" + content)

    # Assert
    assert decoded.stamp_ns == 5 * SECOND + 6
    assert decoded.links == ("ab",)
    np.testing.assert_array_equal(decoded.wrenches, [[1, 2, 3, 4, 5, 6]])


# Hostile


def is_message_or_refused(raw: bytes) -> bool:
    """Decodes bytes; whether they were a message, each part of which has its shape."""
    try:
        decoded = decode_wrenches(raw)
    except MessageError as error:
        assert "\n" not in str(error)
        return False
    assert isinstance(decoded.stamp_ns, int)
    assert all(isinstance(link, str) for link in decoded.links)
    assert decoded.wrenches.ndim == 2 and decoded.wrenches.shape[1] == 6
    assert decoded.points.ndim == 2 and decoded.points.shape[1] == 3
    return True


EXAMPLE = encode_wrenches(
    WrenchArrays.of_rows(
        3 * SECOND + 7,
        ["left_wrist", "chest", "größer"],
        np.arange(18.0).reshape(3, 6),
        np.arange(9.0).reshape(3, 3),
    )
)


@PROPERTY
@given(st.binary(max_size=200))
def test_any_bytes_are_a_message_or_refused(raw: bytes) -> None:
    is_message_or_refused(raw)
    is_message_or_refused(EXAMPLE[:4] + raw)


def test_a_message_cut_off_anywhere_is_refused() -> None:
    for length in range(len(EXAMPLE)):
        assert not is_message_or_refused(EXAMPLE[:length]), length


def test_a_message_with_any_bytes_changed_is_a_message_or_refused() -> None:
    rng = random.Random(1)
    for _ in range(5000):
        raw = bytearray(EXAMPLE)
        for _ in range(rng.randint(1, 4)):
            raw[rng.randrange(4, len(raw))] = rng.choice(
                (0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256))
            )
        is_message_or_refused(bytes(raw))


@pytest.mark.parametrize("count", [4, 1000, 2**24, 2**31 - 1, 2**31, 2**32 - 1])
def test_a_count_that_claims_too_much_is_refused(count: int) -> None:
    raw = bytearray(encode_wrenches(WrenchArrays.of_rows(1, ["a"], [np.zeros(6)], [])))
    place = raw.index(struct.pack("<I", 1), len(raw) - 60)  # the count of the wrenches
    raw[place : place + 4] = struct.pack("<I", count)

    assert not is_message_or_refused(bytes(raw))


def test_a_message_of_another_type_is_a_message_or_refused() -> None:
    joint_state = JointStateEncoder(["a", "b"]).encode(5, np.ones(2), np.ones(2), np.ones(2))
    assert deserialize_message(joint_state, JointState).name == ["a", "b"]

    is_message_or_refused(joint_state)
