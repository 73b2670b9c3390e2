"""What a recorder keeps of several simulators: all of one, and nothing of the others."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from actuated_characters.recorder.session_filter import Heard, SessionFilter, find_session
from actuated_characters.recorder.topics import RecordedTopic
from actuated_characters.replay.players.simulator_outputs import SessionRewriter
from msgs_config.messages import topics, typed
from msgs_config.messages.joint_state import JointStateEncoder
from msgs_config.messages.session import ANONYMOUS, episode_text
from msgs_config.messages.topic import SessionPlace, Topic
from msgs_config.messages.wrenches import WrenchArrays, decode_wrenches, encode_wrenches
from tests.support.ros import joint_state, stamp_ns

ONE, OTHER = "/sim_node#00000000000a", "/sim_node#00000000000b"
CONFIGURATION = topics.CONFIGURATION.of(topics.SIM_NODE)
NAMED = (topics.EPISODE, CONFIGURATION, topics.CONTACTS, topics.JOINT_STATES, topics.JOINT_TORQUES)


def heard(topic: Topic, session: str, number: int = 1) -> Heard:
    """A message on a topic, of a session."""
    if topic is topics.EPISODE:
        raw = serialize_message(Header(frame_id=episode_text(number, session)))
    elif topic is CONFIGURATION:
        raw = serialize_message(String(data=json.dumps({"session": session, "n": number})))
    elif topic is topics.CONTACTS:
        raw = encode_wrenches(WrenchArrays.of_rows(number, [], [], [], session or "world"))
    else:
        message = joint_state(number, ["hinge"], effort=[0.0])
        message.header.frame_id = session
        raw = serialize_message(message)
    recorded = RecordedTopic(topic, f"/{topic.name}", topic.name, "")
    return Heard(recorded, bytes(raw), number)


def filtered(
    given_session: str, messages: list[Heard]
) -> tuple[SessionFilter, list[Heard], list[str]]:
    """What a filter lets through of messages, in its order, and what it says."""
    lines: list[str] = []
    session_filter = SessionFilter(given_session, lines.append)
    passed = [each for message in messages for each in session_filter.take(message)]
    return session_filter, passed + session_filter.finish(), lines


def content(message: Heard) -> tuple[str, bytes, int]:
    """What can be compared of a message."""
    return message.recorded.name, message.raw, message.published_ns


_any_messages = st.lists(
    st.builds(
        heard,
        st.sampled_from(NAMED),
        st.sampled_from([ONE, OTHER, ANONYMOUS]),
        st.integers(1, 1000),
    ),
    max_size=40,
)


@settings(deadline=None)
@given(_any_messages)
def test_of_any_interleaving_all_of_one_simulator_is_kept_and_nothing_of_others(
    messages: list[Heard],
) -> None:
    session_filter, passed, lines = filtered("", messages)

    states = [m for m in messages if m.recorded.topic is topics.JOINT_STATES]
    if states:
        bound = find_session(states[0])
        own = [message for message in messages if find_session(message) in (bound, None)]
        assert session_filter.bound == bound
        assert sorted(map(content, passed)) == sorted(map(content, own))
        dropped = sum(session_filter.dropped(f"/{topic.name}") for topic in NAMED)
        assert dropped == len(messages) - len(own)
        assert bool(lines) == bool(dropped)
    assert len({find_session(message) for message in passed} - {None}) <= 1


@settings(deadline=None)
@given(_any_messages)
def test_a_session_that_is_given_is_the_only_one_from_the_first_message_on(
    messages: list[Heard],
) -> None:
    _, passed, _ = filtered(OTHER, messages)

    assert passed == [message for message in messages if find_session(message) in (OTHER, None)]


def test_what_came_before_the_first_state_is_kept_in_front_of_it() -> None:
    first = [heard(CONFIGURATION, ONE), heard(topics.EPISODE, ONE), heard(topics.CONTACTS, ONE)]
    strange = [heard(CONFIGURATION, OTHER), heard(topics.EPISODE, OTHER)]
    state = heard(topics.JOINT_STATES, ONE)

    _, passed, lines = filtered("", [strange[0], *first, strange[1], state])

    assert passed == [*first, state]
    assert len(lines) == 1 and ONE in lines[0] and OTHER in lines[0]


def test_however_late_the_first_state_comes_what_is_latched_is_kept() -> None:
    latched = [heard(CONFIGURATION, ONE), heard(topics.EPISODE, ONE)]
    torques = [heard(topics.JOINT_TORQUES, ONE, number) for number in range(1, 5000)]
    state = heard(topics.JOINT_STATES, ONE, 5000)

    _, passed, _ = filtered("", [*latched, *torques, state])

    assert passed[:2] == latched
    assert passed[2:] == [*torques[-len(passed[2:-1]) :], state]
    assert len(passed) > 500


def test_of_a_simulator_that_has_had_no_state_yet_the_configuration_is_kept_at_the_end() -> None:
    message = heard(CONFIGURATION, ONE)

    assert filtered("", [message])[1] == [message]


def test_bytes_that_are_no_message_are_of_no_simulator_that_names_itself() -> None:
    garbage = heard(topics.JOINT_STATES, ONE)._replace(raw=b"\x00\x01\x00\x00\xff")

    assert filtered(ONE, [garbage, heard(topics.JOINT_STATES, ONE)])[1] == [
        heard(topics.JOINT_STATES, ONE)
    ]


# A bag that speaks in a session of its own


@given(st.lists(st.floats(width=64), min_size=3, max_size=3), st.sampled_from(["", "world", OTHER]))
def test_a_state_in_another_session_has_the_same_numbers_to_the_bit(
    numbers: list[float], frame_id: str
) -> None:
    values = np.array(numbers)
    encoder = JointStateEncoder(["c", "a", "b"], frame_id)
    raw = encoder.encode(4_166_666, values, values[::-1].copy())

    found = deserialize_message(SessionRewriter(ONE).rewrite(topics.JOINT_STATES, raw), JointState)

    assert found.header.frame_id == ONE
    assert (stamp_ns(found), list(found.name)) == (4_166_666, ["c", "a", "b"])
    assert np.array(found.position).tobytes() == values.tobytes()
    assert np.array(found.velocity).tobytes() == values[::-1].tobytes()
    assert len(found.effort) == 0


@pytest.mark.parametrize(
    "topic",
    [t for t in topics.TABLE if t.session in (SessionPlace.FRAME_ID, SessionPlace.FRAME_ID_IF_ANY)],
    ids=lambda topic: topic.name,
)
def test_all_that_names_a_session_is_said_in_the_new_one(topic: Topic) -> None:
    own, theirs = (typed.stamped(topic.type_name, 5, session) for session in (ONE, OTHER))

    found = SessionRewriter(ONE).rewrite(topic, typed.encode(theirs))

    assert found == typed.encode(own)


def test_what_comes_with_a_state_is_said_in_the_session_too_also_of_older_bags() -> None:
    session = SessionRewriter(ONE)
    wrench = WrenchArrays.of_rows(5, ["chest"], [np.arange(6.0)], [])
    older = String(data=json.dumps({"character": "lift"}))

    contacts = decode_wrenches(session.rewrite(topics.CONTACTS, encode_wrenches(wrench)))
    odometry = session.rewrite(topics.ODOM, b"anything")
    old_episode = bytes(serialize_message(Header(frame_id="2")))
    episode = deserialize_message(session.rewrite(topics.EPISODE, old_episode), Header)
    raw = session.rewrite(topics.CONFIGURATION, bytes(serialize_message(older)))
    configuration = deserialize_message(raw, String)

    assert contacts.frame_id == ONE
    assert contacts.wrenches.tolist() == wrench.wrenches.tolist()
    assert odometry == b"anything"
    assert episode.frame_id == f"2 {ONE}"
    assert json.loads(configuration.data) == {"character": "lift", "session": ONE}
