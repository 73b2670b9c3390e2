"""Log times in simulated time: that of the stamp, or of the last state."""

import time
from array import array
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String
from visualization_msgs.msg import Marker, MarkerArray

from actuated_characters.recorder.log_time import SimulatedLogTime
from actuated_characters.recorder.session_filter import Heard
from actuated_characters.recorder.topics import RecordedTopic
from msgs_config.messages import topics
from msgs_config.messages.topic import Topic

WALL_NS = 1_790_000_000_000_000_000
S = 10**9
TEXT = topics.CONFIGURATION.of(topics.SIM_NODE)


def heard(topic: Topic, message: Any, published_ns: int = WALL_NS, name: str = "") -> Heard:
    raw = message if isinstance(message, bytes) else bytes(serialize_message(message))
    return Heard(RecordedTopic(topic, name or f"/{topic.name}", topic.name, ""), raw, published_ns)


def stamped(message: Any, stamp_ns: int) -> Any:
    header = getattr(message, "header", message)
    header.stamp.sec, header.stamp.nanosec = divmod(stamp_ns, S)
    return message


def state(stamp_ns: int, published_ns: int = WALL_NS) -> Heard:
    message = JointState(name=["hinge"], position=array("d", [0.5]))
    return heard(topics.JOINT_STATES, stamped(message, stamp_ns), published_ns)


def times(log_time: SimulatedLogTime, *messages: Heard) -> list[int]:
    """The log times that are known once these have come."""
    return [time for each in messages for _, time in log_time.take(each)]


def running(first_ns: int, *later_ns: int) -> SimulatedLogTime:
    """After the states of these stamps."""
    log_time = SimulatedLogTime()
    times(log_time, *(state(stamp_ns) for stamp_ns in (first_ns, *later_ns)))
    return log_time


def clock(stamp_ns: int) -> Clock:
    message = Clock()
    message.clock.sec, message.clock.nanosec = divmod(stamp_ns, S)
    return message


def markers(stamp_ns: int) -> MarkerArray:
    return MarkerArray(markers=[stamped(Marker(), stamp_ns), Marker()])


@pytest.mark.parametrize(
    ("topic", "message"),
    [
        (topics.JOINT_STATES, stamped(JointState(), 7 * S + 3)),
        (topics.JOINT_TORQUES, stamped(JointState(name=["a"]), 7 * S + 3)),
        (topics.EPISODE, stamped(Header(), 7 * S + 3)),
        (topics.CLOCK, clock(7 * S + 3)),
        (topics.VISUALIZATION, markers(7 * S + 3)),
    ],
    ids=lambda each: each.name if isinstance(each, Topic) else "",
)
def test_a_stamp_is_the_log_time(topic: Topic, message: Any) -> None:
    assert times(running(1 * S, 6 * S), heard(topic, message)) == [7 * S + 3]


def test_a_stamp_of_either_byte_order_is_the_log_time() -> None:
    big_endian = b"\x00\x00\x00\x00" + (7).to_bytes(4, "big") + (3).to_bytes(4, "big")

    assert times(running(1 * S), heard(topics.CLOCK, big_endian)) == [7 * S + 3]


@pytest.mark.parametrize(
    ("topic", "message"),
    [
        (TEXT, String(data="a text that is no stamp")),
        (topics.EXTERNAL_WRENCH, b"\x00\x01\x00\x00" + bytes(12)),  # its stamp is not set
        (topics.DIAGNOSTICS, stamped(DiagnosticArray(), WALL_NS - 5)),  # by the wall clock
        (topics.VISUALIZATION, MarkerArray()),
        (topics.VISUALIZATION, b"\x00\x01\x00\x00\x01\x00\x00\x00"),
        (topics.CLOCK, b""),
        (topics.CLOCK, b"\x00\x01\x00\x00\xff\xff\xff\xff\x00\x00\x00\x00"),  # before 0
    ],
    ids=["text", "not set", "wall clock", "empty", "cut off", "nothing", "negative"],
)
def test_a_message_without_a_simulated_stamp_has_the_time_of_the_last_state(
    topic: Topic, message: Any
) -> None:
    assert times(running(1 * S, 6 * S), heard(topic, message)) == [6 * S]


def test_nothing_is_older_than_the_first_state() -> None:
    """Latched messages of a simulator that has run for long come to a recorder that joins late."""
    log_time = SimulatedLogTime()
    episode = heard(topics.EPISODE, stamped(Header(), 4))

    found = times(log_time, heard(TEXT, String()), episode, state(100 * S), heard(TEXT, String()))

    assert found == [100 * S] * 4


def test_the_time_of_unstamped_messages_never_goes_back() -> None:
    log_time = running(1 * S, 3 * S)

    found = times(log_time, state(2 * S), heard(TEXT, String()), state(3 * S), state(4 * S))

    assert found == [2 * S, 3 * S, 3 * S, 4 * S]  # a state keeps its stamp, also when it is late


def test_messages_before_the_first_state_wait_but_not_without_an_end() -> None:
    log_time = SimulatedLogTime()
    texts = [heard(TEXT, String(data=f"{number}")) for number in range(1001)]

    assert times(log_time, *texts[:1000]) == []
    assert times(log_time, texts[1000]) == [0] * 1001
    assert times(log_time, state(5), heard(TEXT, String())) == [5, 5]


def test_without_any_state_all_is_kept_at_the_end_and_once() -> None:
    log_time = SimulatedLogTime()
    text = heard(TEXT, String())
    assert not list(log_time.take(text))

    assert list(log_time.finish()) == [(text, 0)]
    assert not list(log_time.finish())


def test_what_is_read_late_is_written_in_its_place() -> None:
    """A recorder that stood still finds all of one topic, and of the other a little later."""
    log_time = SimulatedLogTime()
    states = [state(tick * S, WALL_NS + 2 * tick) for tick in range(1, 9)]
    texts = [heard(TEXT, String(data="a"), WALL_NS + 2 * tick + 1) for tick in range(1, 9)]

    assert log_time.settle(states, 50.0, 50.001) == []
    assert log_time.settle(texts, 50.01, 50.011) == []
    written = log_time.settle([], 50.102, 50.103)

    in_order = [each for pair in zip(states, texts, strict=True) for each in pair]
    assert written == in_order[:-1]
    assert log_time.settle_rest() == in_order[-1:]


def test_a_clock_that_is_ahead_does_not_settle_the_messages_of_others() -> None:
    log_time = SimulatedLogTime()
    ahead = heard(TEXT, String(), time.time_ns() + 3600 * S)
    early, late = state(1 * S, WALL_NS + 80), state(2 * S, WALL_NS + 90)

    assert log_time.settle([ahead], 50.0, 50.0) == []
    assert log_time.settle([late], 50.11, 50.12) == [ahead]
    assert log_time.settle([early], 50.13, 50.14) == []
    assert log_time.settle_rest() == [early, late]


@settings(deadline=None)
@given(st.lists(st.lists(st.integers(0, 30), max_size=6), max_size=20))
def test_messages_settle_in_the_order_of_publishing_and_none_is_lost(
    rounds: list[list[int]],
) -> None:
    """Rounds of reading are 20 ms apart, offsets are in units of 10 ms."""
    log_time, found = SimulatedLogTime(), list[Heard]()
    for number, offsets in enumerate(rounds):
        begun = number / 50
        batch = [state(1, 5 * S + offset * S // 100) for offset in offsets]
        ready = log_time.settle(batch, begun, begun)
        assert [m.published_ns for m in ready] == sorted(m.published_ns for m in ready)
        found += ready
        read = sum(len(each) for each in rounds[: max(0, number - 5)])  # more than 0.1 s ago
        assert len(found) >= read
    found += log_time.settle_rest()

    sent = [5 * S + offset * S // 100 for offsets in rounds for offset in offsets]
    assert sorted(m.published_ns for m in found) == sorted(sent)
