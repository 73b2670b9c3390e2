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


def test_what_was_published_while_the_topics_were_read_waits_for_the_topics_read_first() -> None:
    """A recorder that had to pause between two topics."""
    log_time = SimulatedLogTime()
    of_second_topic = [state(number, 5 * S + number) for number in (2, 4, 6)]
    of_first_topic = [state(number, 5 * S + number) for number in (1, 3, 5)]

    assert log_time.settle(of_second_topic, 5 * S) == []
    found = log_time.settle(of_first_topic, 6 * S)

    assert [message.published_ns - 5 * S for message in found] == [1, 2, 3, 4, 5, 6]


def test_what_the_wall_clock_says_is_yet_to_come_does_not_wait() -> None:
    """The clock was set back: times of publishing stay as far ahead for long."""
    ahead = state(1, time.time_ns() + 3600 * S)

    assert SimulatedLogTime().settle([ahead], time.time_ns()) == [ahead]


@settings(deadline=None)
@given(st.lists(st.lists(st.integers(0, 30), max_size=6), max_size=6))
def test_messages_settle_in_the_order_of_publishing_and_none_is_lost(
    rounds: list[list[int]],
) -> None:
    """Rounds of reading are 20 ms apart, offsets are in units of 10 ms."""
    log_time, found = SimulatedLogTime(), list[Heard]()
    for number, offsets in enumerate(rounds):
        begun_ns = 5 * S + number * S // 50
        batch = [state(1, 5 * S + offset * S // 100) for offset in offsets]
        ready = log_time.settle(batch, begun_ns)
        assert [m.published_ns for m in ready] == sorted(m.published_ns for m in ready)
        assert all(m.published_ns <= begun_ns - S // 10 for m in ready)
        found += ready
    found += log_time.settle([], None)

    sent = [5 * S + offset * S // 100 for offsets in rounds for offset in offsets]
    assert sorted(m.published_ns for m in found) == sorted(sent)
