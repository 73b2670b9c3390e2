"""Forces on links are whole ROS messages in both directions, and hostile bytes do no harm."""

import random
import struct
from dataclasses import replace

import numpy as np
import pytest
from geometry_msgs.msg import Twist
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import MultiDOFJointState

from msgs_config.arrays import FloatArray
from msgs_config.errors import MessageError
from msgs_config.messages.cdr import with_stamp
from msgs_config.messages.joint_state import JointStateEncoder
from msgs_config.messages.wrenches import (
    SelectionEncoder,
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


def any_rows(width: int) -> st.SearchStrategy[FloatArray]:
    return st.integers(0, 4).flatmap(lambda count: arrays(float, (count, width), elements=numbers))


any_wrenches = st.builds(
    WrenchArrays,
    stamp_ns=stamps,
    links=st.lists(texts, max_size=4).map(tuple),
    wrenches=any_rows(6),
    points=any_rows(3),
    frame_id=texts,
)


def same_bits(one: FloatArray, other: FloatArray) -> bool:
    """Whether two arrays have one shape and the same numbers, to the bit; any NaN is NaN."""
    bits = [np.where(np.isnan(array), np.nan, array).tobytes() for array in (one, other)]
    return one.shape == other.shape and bits[0] == bits[1]


def assert_same_wrenches(one: WrenchArrays, other: WrenchArrays) -> None:
    assert (one.stamp_ns, one.links, one.frame_id) == (other.stamp_ns, other.links, other.frame_id)
    assert same_bits(one.wrenches, other.wrenches)
    assert same_bits(one.points, other.points)


@PROPERTY
@given(any_wrenches)
def test_what_was_written_is_read_again(wrenches: WrenchArrays) -> None:
    assert_same_wrenches(decode_wrenches(encode_wrenches(wrenches)), wrenches)


def test_the_fields_of_the_message_are_those_of_the_contract() -> None:
    rows = np.arange(6.0), np.arange(6.0, 12.0)
    points = (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)
    wrenches = WrenchArrays.of_rows(7 * SECOND + 5, ["a", "b"], rows, points)

    message = deserialize_message(encode_wrenches(wrenches), MultiDOFJointState)

    stamp, wrench, transform = message.header.stamp, message.wrench[1], message.transforms[1]
    assert (stamp.sec, stamp.nanosec, message.header.frame_id) == (7, 5, "world")
    assert message.joint_names == ["a", "b"]
    assert (wrench.force.x, wrench.force.y, wrench.force.z) == (6.0, 7.0, 8.0)
    assert (wrench.torque.x, wrench.torque.y, wrench.torque.z) == (9.0, 10.0, 11.0)
    place, turn = transform.translation, transform.rotation
    assert (place.x, place.y, place.z) == points[1]
    assert (turn.x, turn.y, turn.z, turn.w) == (0.0, 0.0, 0.0, 1.0)
    assert not message.twist


@pytest.mark.parametrize("touching", [[False, True, False, True], [False] * 4])
def test_only_what_touches_is_selected(touching: list[bool]) -> None:
    names, wrenches = ["a", "b", "c", "d"], np.arange(24.0).reshape(4, 6)

    selected = select(5, names, wrenches, np.array(touching), "/sim_node#1")

    assert (selected.stamp_ns, selected.frame_id) == (5, "/sim_node#1")
    assert list(selected.links) == [n for n, t in zip(names, touching, strict=True) if t]
    np.testing.assert_array_equal(selected.wrenches, wrenches[touching])
    assert selected.points.shape == (0, 3)
    assert_same_wrenches(decode_wrenches(encode_wrenches(selected)), selected)


@pytest.mark.parametrize("links", [4, 9])
def test_any_selection_is_encoded_as_it_is_elsewhere(links: int) -> None:
    names = [f"link{'s' * row}" for row in range(links)]
    encoder = SelectionEncoder(names, "/sim_node#1")
    rng = np.random.default_rng(links)
    every = [np.array([bits >> row & 1 for row in range(links)], bool) for bits in range(2**links)]

    for touching in every + every:  # more than are kept, and each again
        wrenches = rng.normal(size=(links, 6))
        stamp_ns = int(rng.integers(10**10))
        wanted = encode_wrenches(select(stamp_ns, names, wrenches, touching, "/sim_node#1"))
        assert encoder.encode(stamp_ns, wrenches, touching) == wanted


def test_a_message_with_another_stamp_is_the_same_otherwise() -> None:
    wrenches = WrenchArrays.of_rows(1, ["a"], [np.arange(6.0)], [(1.0, 2.0, 3.0)])

    raw = with_stamp(encode_wrenches(wrenches), 7 * SECOND + 5)

    assert_same_wrenches(decode_wrenches(raw), replace(wrenches, stamp_ns=7 * SECOND + 5))


def test_turns_and_twists_are_not_looked_at() -> None:
    wrenches = WrenchArrays.of_rows(3, ["a"], [np.arange(6.0)], [(1.0, 2.0, 3.0)], "elsewhere")
    message = deserialize_message(encode_wrenches(wrenches), MultiDOFJointState)
    message.transforms[0].rotation.x = 0.7
    message.twist = [Twist(), Twist()]

    assert_same_wrenches(decode_wrenches(serialize_message(message)), wrenches)


# Hostile


def is_message(raw: bytes) -> bool:
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
    is_message(raw)
    is_message(EXAMPLE[:4] + raw)


def test_a_message_cut_off_anywhere_is_refused() -> None:
    for length in range(len(EXAMPLE)):
        assert not is_message(EXAMPLE[:length]), length


def test_a_message_with_any_bytes_changed_is_a_message_or_refused() -> None:
    rng = random.Random(1)
    for _ in range(5000):
        raw = bytearray(EXAMPLE)
        for _ in range(rng.randint(1, 4)):
            raw[rng.randrange(4, len(raw))] = rng.choice(
                (0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256))
            )
        is_message(bytes(raw))


@pytest.mark.parametrize("count", [4, 1000, 2**24, 2**31 - 1, 2**31, 2**32 - 1])
def test_a_count_that_claims_too_much_is_refused_in_silence(
    count: int, capfd: pytest.CaptureFixture[str]
) -> None:
    raw = bytearray(encode_wrenches(WrenchArrays.of_rows(1, ["a"], [np.zeros(6)], [])))
    place = raw.index(struct.pack("<I", 1), len(raw) - 60)  # the count of the wrenches
    raw[place : place + 4] = struct.pack("<I", count)

    assert not is_message(bytes(raw))
    assert capfd.readouterr() == ("", "")


def test_a_message_of_another_type_is_a_message_or_refused() -> None:
    is_message(JointStateEncoder(["a", "b"]).encode(5, np.ones(2), np.ones(2), np.ones(2)))
