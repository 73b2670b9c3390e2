"""Our own bytes are those of ROS, in both directions, and hostile bytes do no harm."""

import random
import struct
from array import array
from collections.abc import Sequence
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout, JointType
from msgs_config.errors import LayoutError, MessageError
from msgs_config.messages import typed
from msgs_config.messages.cdr import JOINT_STATE
from msgs_config.messages.joint_state import (
    JointArrays,
    JointStateDecoder,
    JointStateEncoder,
    state_in_layout,
)

PROPERTY = settings(max_examples=120, deadline=None)
SECOND = 10**9
SPECIALS = [0.0, -0.0, np.inf, -np.inf, np.nan, -np.nan, 5e-324, np.finfo(float).max]
SMALL_LAYOUT = JointLayout(
    [("root", JointType.FLOATING), ("chest", JointType.SPHERICAL), ("knee", JointType.REVOLUTE)]
)

# ROS strings hold no NUL, and UTF-8 no surrogates.
texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=12)
names_lists = st.lists(texts, max_size=6)
arrays = st.lists(
    st.one_of(st.sampled_from(SPECIALS), st.floats(allow_subnormal=True)), max_size=5
).map(lambda values: np.array(values, dtype=float))
stamps = st.tuples(
    st.one_of(st.sampled_from([-(2**31), -1, 0, 2**31 - 1]), st.integers(-(2**31), 2**31 - 1)),
    st.integers(0, SECOND - 1),
).map(lambda parts: parts[0] * SECOND + parts[1])


def ros_message(
    names: Sequence[str],
    position: FloatArray,
    velocity: FloatArray,
    effort: FloatArray,
    stamp_ns: int = SECOND + 5,
    frame_id: str = "",
) -> JointState:
    message = JointState(
        name=list(names),
        position=array("d", position.tobytes()),
        velocity=array("d", velocity.tobytes()),
        effort=array("d", effort.tobytes()),
    )
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, SECOND)
    message.header.frame_id = frame_id
    return message


def cdr(
    names: Sequence[bytes],
    numbers: Sequence[Sequence[float]],
    *,
    order: str = "<",
    stamp: tuple[int, int] = (5, 6),
    name_count: int | None = None,
    counts: Sequence[int] | None = None,
) -> bytes:
    """A serialised JointState written down from the specification, padding zero.

    Each name is the string's bytes with its end; `order` is '<' or '>'; the counts are what the
    message claims of the number of names and of each array, the truth by default.
    """
    content = struct.pack(order + "iII", *stamp, 1) + b"\0"

    def aligned(size: int) -> bytes:
        return content + bytes(-len(content) % size)

    count = len(names) if name_count is None else name_count
    content = aligned(4) + struct.pack(order + "I", count)
    for name in names:
        content = aligned(4) + struct.pack(order + "I", len(name)) + name
    for index, values in enumerate(numbers):
        count = len(values) if counts is None else counts[index]
        content = aligned(4) + struct.pack(order + "I", count)
        if values:
            content = aligned(8) + struct.pack(f"{order}{len(values)}d", *values)
    return (b"\0\1\0\0" if order == "<" else b"\0\0\0\0") + content


def bits(values: FloatArray) -> bytes:
    return np.asarray(values, dtype=float).tobytes()


def assert_same_content(decoded: JointArrays, message: JointState) -> None:
    """Compare with what ROS holds, the doubles bit for bit."""
    stamp = message.header.stamp
    assert decoded.stamp_ns == stamp.sec * SECOND + stamp.nanosec
    assert decoded.names == tuple(message.name)
    assert decoded.position.tobytes() == bits(message.position)
    assert decoded.velocity.tobytes() == bits(message.velocity)
    assert decoded.effort.tobytes() == bits(message.effort)


def described(decoder: JointStateDecoder, raw: bytes) -> tuple[object, ...] | None:
    """What a decoder makes of some bytes, to compare; None if it refuses them."""
    try:
        decoded = decoder.decode(raw)
    except MessageError:
        return None
    doubles = (bits(decoded.position), bits(decoded.velocity), bits(decoded.effort))
    return (decoded.stamp_ns, decoded.names, *doubles)


# Encoding


@PROPERTY
@given(names_lists, stamps, arrays, arrays, arrays)
def test_ros_reads_what_the_encoder_writes_which_is_what_the_specification_says(
    names: list[str],
    stamp_ns: int,
    position: FloatArray,
    velocity: FloatArray,
    effort: FloatArray,
) -> None:
    raw = JointStateEncoder(names).encode(stamp_ns, position, velocity, effort)

    arrays = JointArrays(stamp_ns, tuple(names), position, velocity, effort)
    assert_same_content(arrays, deserialize_message(raw, JointState))
    numbers = [values.tolist() for values in (position, velocity, effort)]
    stamp = divmod(stamp_ns, SECOND)
    assert raw == cdr([name.encode() + b"\0" for name in names], numbers, stamp=stamp)


def test_an_encoder_keeps_nothing_of_the_message_before() -> None:
    encoder = JointStateEncoder(["knee", "hip"])
    first = encoder.encode(1, np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.array([5.0, 6.0]))
    first_bytes = bytes(first)

    second = deserialize_message(encoder.encode(2, effort=np.array([7.0, 8.0])), JointState)

    assert first == first_bytes
    assert len(second.position) == len(second.velocity) == 0
    assert list(second.effort) == [7.0, 8.0]


def test_an_array_that_is_a_view_is_written_as_what_it_shows() -> None:
    every_other = np.arange(6.0)[::2]

    raw = JointStateEncoder(["a", "b", "c"]).encode(1, position=every_other)

    assert list(deserialize_message(raw, JointState).position) == [0.0, 2.0, 4.0]


# Decoding


@PROPERTY
@given(names_lists, stamps, arrays, arrays, arrays, texts)
def test_the_decoder_reads_what_ros_writes_bit_for_bit(
    names: list[str],
    stamp_ns: int,
    position: FloatArray,
    velocity: FloatArray,
    effort: FloatArray,
    frame_id: str,
) -> None:
    message = ros_message(names, position, velocity, effort, stamp_ns, frame_id)
    raw = serialize_message(message)  # with garbage behind it where an array is empty
    decoder = JointStateDecoder()

    for _ in range(3):  # the first time through ROS, then perhaps by the kept names
        assert_same_content(decoder.decode(raw), message)


def test_many_senders_that_take_turns_are_told_apart() -> None:
    senders = {f"joint{index}" * (index % 5 + 1): float(index) for index in range(40)}
    decoder = JointStateDecoder()

    for _ in range(3):
        for name, value in senders.items():
            raw = JointStateEncoder([name]).encode(1, effort=np.array([value]))
            decoded = decoder.decode(raw)
            assert (decoded.names, decoded.effort.tolist()) == ((name,), [value])


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (["knee"], ["knee2"]),
        (["knee2"], ["knee"]),
        (["a"], ["a", "b"]),
        (["a", "b"], ["a"]),
        ([], ["a"]),
        (["a"], []),
        (["ab", "c"], ["a", "bc"]),
        (["a", ""], ["a"]),
    ],
)
def test_names_that_begin_alike_are_told_apart(first: list[str], second: list[str]) -> None:
    decoder = JointStateDecoder()
    one, two = np.array([1.0]), np.array([2.0])

    for _ in range(2):
        decoded = decoder.decode(JointStateEncoder(first).encode(1, effort=one))
        assert (decoded.names, decoded.effort.tolist()) == (tuple(first), [1.0])
        decoded = decoder.decode(JointStateEncoder(second).encode(1, effort=two))
        assert (decoded.names, decoded.effort.tolist()) == (tuple(second), [2.0])


def test_what_was_decoded_stays_when_the_next_message_comes() -> None:
    encoder, decoder = JointStateEncoder(["knee"]), JointStateDecoder()
    decoder.decode(encoder.encode(1, effort=np.array([1.0])))
    decoded = decoder.decode(encoder.encode(2, effort=np.array([2.0])))

    decoder.decode(encoder.encode(3, effort=np.array([3.0])))
    decoded.effort[0] += 10.0

    assert (decoded.stamp_ns, decoded.effort.tolist()) == (2, [12.0])


def test_lists_that_change_their_lengths_are_read() -> None:
    decoder, encoder = JointStateDecoder(), JointStateEncoder(["chest_x", "knee"], "sim#1")
    values, none = np.array([1.5, -2.5]), np.zeros(0)
    for lists in 2 * [(values, values), (values, values, 2 * values), (none, none, values), ()]:
        for stamp_ns in (SECOND + 5, 3 * SECOND):
            decoded = decoder.decode(encoder.encode(stamp_ns, *lists))

            assert (decoded.stamp_ns, decoded.frame_id) == (stamp_ns, "sim#1")
            whole = [*lists, none, none, none][:3]
            for found, wanted in zip(decoded[2:5], whole, strict=True):
                np.testing.assert_array_equal(found, wanted)


def test_what_stands_in_the_gaps_is_of_no_matter() -> None:
    decoder, encoder = JointStateDecoder(), JointStateEncoder(["a", "b"])
    sound = encoder.encode(5, *np.ones((3, 2)))
    gaps = [place for place in range(len(sound)) if _is_gap(sound, place)]

    assert len(gaps) >= 8  # before two lists or more
    for content in (0x00, 0xFF, 0x7F):
        raw = bytearray(sound)
        for place in gaps:
            raw[place] = content
        for _ in range(2):
            assert_same_content(decoder.decode(bytes(raw)), deserialize_message(sound, JointState))


def _is_gap(raw: bytes, place: int) -> bool:
    """Whether ROS reads the same whatever that byte is."""
    changed = bytearray(raw)
    changed[place] ^= 0xFF
    try:
        message = deserialize_message(bytes(changed), JointState)
    except Exception:  # rclpy has no exception type for it
        return False
    return place > 12 and message == deserialize_message(raw, JointState)


@pytest.mark.parametrize("warm", [False, True])
def test_a_big_endian_sender_is_understood(warm: bool) -> None:
    numbers = [[1.5, -2.25], [], [np.pi, -0.0]]
    names = [b"right_knee\0", b"chest_x\0"]
    decoder = JointStateDecoder()
    if warm:
        decoder.decode(cdr(names, numbers))

    decoded = decoder.decode(cdr(names, numbers, order=">", stamp=(-7, 8)))

    assert decoded.stamp_ns == -7 * SECOND + 8
    assert decoded.names == ("right_knee", "chest_x")
    assert decoded.position.tolist() == [1.5, -2.25]
    assert decoded.velocity.tolist() == []
    assert bits(decoded.effort) == bits(np.array([np.pi, -0.0]))


@pytest.mark.parametrize("name", ["größe", "膝", "🦿", "é" * 7, "naïve_x"])
def test_names_beyond_ascii_come_through_both_ways(name: str) -> None:
    raw = JointStateEncoder([name, "knee"]).encode(1, position=np.array([1.0, 2.0]))
    decoder = JointStateDecoder()

    assert deserialize_message(raw, JointState).name == [name, "knee"]
    for _ in range(2):
        assert decoder.decode(raw).names == (name, "knee")


@pytest.mark.parametrize(
    "name", [b"", b"\0", b"no end", b"\xff\xfe\0", b"kn\0ee\0", b"\xed\xa0\x80\0", b"\0\0\0\0"]
)
def test_a_malformed_name_is_refused_or_read_as_ros_reads_it(name: bytes) -> None:
    raw = cdr([name, b"knee\0"], [[], [], [1.0, 2.0]])
    decoder = JointStateDecoder()

    for _ in range(2):
        content = described(decoder, raw)
        assert content is None or content[1] == tuple(deserialize_message(raw, JointState).name)


# Hostile bytes


@pytest.mark.parametrize("warm", [False, True])
def test_a_message_cut_off_anywhere_is_refused(warm: bool) -> None:
    raw = cdr([b"knee\0", b"hip\0"], [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    decoder = JointStateDecoder()
    if warm:
        decoder.decode(raw)

    for length in range(len(raw)):
        with pytest.raises(MessageError):
            decoder.decode(raw[:length])


@pytest.mark.parametrize("warm", [False, True])
@pytest.mark.parametrize("count", [7, 2**16, 2**29, 2**31, 2**32 - 1])
@pytest.mark.parametrize("array_index", range(3))
def test_an_array_that_claims_more_numbers_than_there_are_is_refused(
    array_index: int, count: int, warm: bool
) -> None:
    counts = [1, 1, 1]
    counts[array_index] = count
    names = [b"knee\0", b"hip\0"]
    decoder = JointStateDecoder()
    if warm:
        decoder.decode(cdr(names, [[], [], []]))

    with pytest.raises(MessageError):
        decoder.decode(cdr(names, [[1.0], [1.0], [1.0]], counts=counts))


@pytest.mark.parametrize("count", [3, 10**6, 2**31, 2**32 - 1])
def test_a_message_that_claims_more_names_than_there_are_is_refused_in_silence(
    count: int, capfd: pytest.CaptureFixture[str]
) -> None:
    raw = cdr([b"knee\0", b"hip\0"], [[1.0, 2.0], [], []], name_count=count)

    for read in (JointStateDecoder().decode, partial(typed.decode, type_name=JOINT_STATE)):
        with pytest.raises(MessageError, match="bytes that are no JointState"):
            read(raw)
    assert capfd.readouterr() == ("", "")


def hostile_bytes(rng: random.Random, sound: bytes) -> bytes:
    """A sound message cut, grown or changed in some bytes, or nothing but chance."""
    kind = rng.randrange(4)
    if kind == 0:
        return rng.randbytes(rng.randrange(250))
    if kind == 1:
        return sound[: rng.randrange(len(sound))] + rng.randbytes(rng.randrange(12))
    changed = bytearray(sound)
    # after the names lie the counts and the doubles, which later messages are read from
    first = 0 if kind == 2 else 12
    for _ in range(rng.randint(1, 6)):
        changed[rng.randrange(first, len(changed))] = rng.choice([0, 1, 2, 8, 127, 128, 255])
    return bytes(changed)


@pytest.mark.parametrize("seed", range(4))
def test_hostile_bytes_are_refused_or_read_as_ros_reads_them(seed: int) -> None:
    rng = random.Random(seed)
    names = ["right_knee", "chest_x", "chest_y", "größe"][: seed + 1]
    values = np.arange(len(names), dtype=float)
    sound = JointStateEncoder(names).encode(SECOND + 5, values, values, values)
    warm = JointStateDecoder()
    warm.decode(sound)

    for _ in range(1500):
        hostile = hostile_bytes(rng, sound)
        assert described(warm, hostile) == described(JointStateDecoder(), hostile)
    assert_same_content(warm.decode(sound), deserialize_message(sound, JointState))


# A state in the layout's order


@PROPERTY
@given(st.permutations(range(SMALL_LAYOUT.size)), st.booleans())
def test_a_state_is_matched_by_name(order: list[int], with_effort: bool) -> None:
    size = SMALL_LAYOUT.size
    position, velocity, effort = np.random.default_rng(5).normal(size=(3, size))
    received = JointArrays(
        stamp_ns=77,
        names=tuple(SMALL_LAYOUT.dof_names[index] for index in order),
        position=position[order],
        velocity=velocity[order],
        effort=effort[order] if with_effort else np.zeros(0),
    )

    state = state_in_layout(SMALL_LAYOUT, received)

    assert state.stamp_ns == 77
    np.testing.assert_array_equal(state.position, position)
    np.testing.assert_array_equal(state.velocity, velocity)
    if with_effort:
        np.testing.assert_array_equal(state.effort, effort)
    else:
        assert state.effort is None


@pytest.mark.parametrize(
    ("entries", "line"),
    [
        (slice(0, 9), "'knee' is missing"),
        ([0, 1, 2, 3, 4, 5, 9], "'chest_x' is missing"),
        (None, "unknown degree of freedom 'tail'"),
    ],
)
def test_a_state_of_other_joints_is_refused_by_name(
    entries: slice | list[int] | None, line: str
) -> None:
    known = np.array(SMALL_LAYOUT.dof_names)
    names = (*known[:-1], "tail") if entries is None else tuple(known[entries].tolist())
    values = np.zeros(len(names))

    with pytest.raises(LayoutError, match=line):
        state_in_layout(SMALL_LAYOUT, JointArrays(1, names, values, values, values))


@pytest.mark.parametrize(
    "lengths", [(9, 10, 10), (10, 11, 10), (10, 10, 9), (0, 10, 10), (10, 0, 0), (10, 10, 1)]
)
def test_arrays_of_another_length_than_the_names_are_refused(
    lengths: tuple[int, int, int],
) -> None:
    values = [np.zeros(length) for length in lengths]

    with pytest.raises(MessageError, match="10 names"):
        state_in_layout(SMALL_LAYOUT, JointArrays(1, SMALL_LAYOUT.dof_names, *values))
