"""To which simulator a receiver belongs: ids, and the binding under any interleaving."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msgs_config.errors import ConfigurationError
from msgs_config.messages.session import (
    ANONYMOUS,
    SESSION,
    SILENT,
    SILENT_AND_ALONE,
    ForeignSessions,
    GivenSession,
    OwnSession,
    SessionBinding,
    episode_session,
    episode_text,
    is_session,
    make_session,
    read_session,
)

ONE, OTHER, THIRD = "/sim_node#00000000000a", "/sim_node#00000000000b", "/left/sim_node#1"
SESSIONS = (ONE, OTHER, THIRD, ANONYMOUS)
TURN = 0.05  # s between two looks of a receiver that works


# Ids


def test_a_session_id_is_the_nodes_name_with_digits_and_never_the_same_twice() -> None:
    made = {make_session("/left/sim_node") for _ in range(100)}

    assert len(made) == 100
    assert all(name.startswith("/left/sim_node#") and is_session(name) for name in made)


@pytest.mark.parametrize(
    "text", ["", "world", "base_link", "#", "a b#1", "x#", "#1", "a#1#2", "é#1"]
)
def test_a_text_that_is_no_id_names_no_session(text: str) -> None:
    assert not is_session(text)
    assert read_session(text) == ANONYMOUS


@given(st.integers(1, 10**9), st.sampled_from(SESSIONS))
def test_an_episode_says_its_number_and_its_session(number: int, session: str) -> None:
    text = episode_text(number, session)

    assert text.split()[0] == str(number)
    assert episode_session(text) == session


@pytest.mark.parametrize("wrong", ["mine", "#1", "/sim_node#", "/sim node#1", "x#" + "1" * 99])
def test_a_parameter_that_is_no_id_is_refused_with_an_example(wrong: str) -> None:
    with pytest.raises(ConfigurationError, match=r"'session' is .* such as /sim_node#3fa29c01b7de"):
        GivenSession.given({SESSION.name: wrong})


def test_an_id_or_nothing_may_be_given() -> None:
    assert GivenSession.given({SESSION.name: ONE}).id == ONE
    assert GivenSession.given({}).id == ""


# The binding


class Receiver:
    """A receiver of states with a clock of its own, in a graph with some publishers."""

    def __init__(self, given: str = "", publishers: int = 1) -> None:
        self.publishers = publishers
        self.binding = SessionBinding(given, lambda: self.publishers)
        self.now = 100.0
        self.binding.note_look(self.now)

    def work(self, seconds: float) -> None:
        """Look for messages again and again, and find none."""
        for _ in range(round(seconds / TURN)):
            self.now += TURN
            self.binding.note_look(self.now)

    def stand_still(self, seconds: float) -> None:
        """Do not look: the process is stopped."""
        self.now += seconds
        self.binding.note_look(self.now)

    def hear(self, session: str) -> bool:
        """Hear a usable state; whether it was taken."""
        if self.binding.admits(session):
            self.binding.take(session)
            return True
        return False


def test_the_first_one_is_bound_and_others_are_rejected_until_it_ends() -> None:
    receiver = Receiver(publishers=2)

    assert receiver.hear(ONE)
    for _ in range(200):
        receiver.work(0.5)  # as often as a simulator that waits speaks
        assert not receiver.hear(OTHER)
        assert receiver.hear(ONE)
    assert receiver.binding.bound == ONE


@pytest.mark.parametrize(("publishers", "seconds"), [(1, SILENT_AND_ALONE), (2, SILENT)])
def test_one_that_has_ended_is_released_and_another_taken_up(
    publishers: int, seconds: float
) -> None:
    receiver = Receiver(publishers=publishers)
    receiver.hear(ONE)
    receiver.work(100.0)  # paused
    assert not receiver.hear(OTHER)

    receiver.work(seconds - 2 * TURN)
    assert not receiver.hear(OTHER)
    receiver.work(3 * TURN)

    assert receiver.hear(OTHER)
    assert receiver.binding.bound == OTHER
    assert not receiver.hear(ONE)


def test_the_time_in_which_the_receiver_stands_still_is_no_silence() -> None:
    receiver = Receiver(publishers=2)
    receiver.hear(ONE)
    receiver.hear(OTHER)

    receiver.stand_still(1000.0)

    assert not receiver.hear(OTHER)
    assert receiver.hear(ONE)


def test_any_word_of_the_bound_simulator_is_a_sign_of_life() -> None:
    receiver = Receiver(publishers=2)
    receiver.hear(ONE)

    for _ in range(20):  # paused: no states, but its episode
        receiver.work(0.8 * SILENT)
        assert receiver.binding.hear(ONE)
        assert not receiver.hear(OTHER)


def test_a_word_of_another_one_is_no_sign_of_life() -> None:
    receiver = Receiver(publishers=2)
    receiver.hear(ONE)

    receiver.hear(OTHER)
    for _ in range(round(SILENT / TURN) + 1):
        receiver.work(TURN)
        assert not receiver.binding.hear(OTHER)

    assert receiver.hear(OTHER)


@given(st.lists(st.tuples(st.sampled_from(SESSIONS), st.floats(0.0, 100.0)), max_size=30))
def test_one_that_was_given_is_never_released(events: list[tuple[str, float]]) -> None:
    receiver = Receiver(given=ONE)

    for session, seconds in events:
        receiver.work(min(seconds, 2 * SILENT))
        receiver.stand_still(seconds)
        assert receiver.hear(session) == (session == ONE)


_events = st.one_of(
    st.tuples(st.just("hear"), st.sampled_from(SESSIONS)),
    st.tuples(st.just("look at"), st.sampled_from(SESSIONS)),  # admitted, but not usable
    st.tuples(st.just("work"), st.floats(0.0, 1.2 * SILENT)),
    st.tuples(st.just("stand still"), st.floats(0.0, 50.0)),
    st.tuples(st.just("publishers"), st.integers(0, 4)),
)


@given(st.lists(_events, max_size=60))
def test_no_interleaving_mixes_two_sessions(events: list[tuple[str, object]]) -> None:
    receiver = Receiver()
    silent: float | None = None  # for how long another one has spoken, and the bound one not
    bound: str | None = None

    for kind, value in events:
        if kind == "publishers":
            receiver.publishers = int(str(value))
        elif kind == "work":
            receiver.work(float(str(value)))
            if silent is not None:
                silent += round(float(str(value)) / TURN) * TURN
        elif kind == "stand still":
            receiver.stand_still(float(str(value)))
            if silent is not None:
                silent += min(float(str(value)), 0.1)
        else:
            session = str(value)
            needed = SILENT_AND_ALONE if receiver.publishers <= 1 else SILENT
            has_ended = silent is not None and silent >= needed
            is_close = silent is not None and abs(silent - needed) < 1e-6  # sums are rounded
            admitted = receiver.binding.admits(session)
            if session == bound:
                assert admitted
                silent = None
            elif bound is not None:
                assert admitted == has_ended or is_close
                silent = silent or 0.0
                bound = None if admitted else bound
            else:
                assert admitted
            if kind == "hear" and admitted:
                is_new = receiver.binding.take(session)
                assert is_new == (bound is None)
                bound, silent = session, None
        assert receiver.binding.bound == bound


# What is said of the others


def test_each_foreign_session_is_named_once_with_both_names() -> None:
    foreign = ForeignSessions()

    lines = [foreign.reject("joint_states", OTHER, ONE) for _ in range(3)]
    lines += [foreign.reject("contacts", OTHER, ONE), foreign.reject("episode", THIRD, ONE)]

    assert [line is not None for line in lines] == [True, False, False, False, True]
    assert lines[0] is not None and ONE in lines[0] and OTHER in lines[0]
    assert "ROS_DOMAIN_ID" in lines[0]
    assert foreign.counts == {"joint_states": 3, "contacts": 1, "episode": 1}


def test_any_number_of_foreign_sessions_is_counted_but_few_are_named() -> None:
    foreign = ForeignSessions()

    lines = [foreign.reject("episode", make_session("/x"), ONE) for _ in range(1000)]

    logged = [line for line in lines if line is not None]
    assert len(logged) == 9
    assert "no more are named" in logged[-1]
    assert foreign.counts["episode"] == 1000


def test_messages_of_another_session_are_rejected_counted_and_named_once() -> None:
    lines: list[str] = []
    own = OwnSession("/sim_node#0a", lines.append)

    verdicts = [
        own.rejects("push", frame_id)
        for frame_id in ("/sim_node#0a", "", "world", "/other#0b", "/other#0b", "/third#0c")
    ]

    assert verdicts == [False, False, False, True, True, True]
    assert own.counts == {"push": 3}
    assert [line.split(";")[0] for line in lines] == [
        f"rejected 'push': its session is {other}, this node's is /sim_node#0a"
        for other in ("/other#0b", "/third#0c")
    ]
