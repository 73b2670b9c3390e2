"""Real time: which command is held, and for how long; all times are made up."""

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.errors import CommandError
from sim_node.timing.lockstep import CommandStatus
from sim_node.timing.zero_order_hold import ZeroOrderHold

NAMES = ["root_x", "chest_x", "chest_y", "chest_z", "right_knee", "left_knee"]
ALLOWED = np.array([False, True, True, True, True, True])
TICK_NS = 4_000_000
TIMEOUT_NS = 5 * TICK_NS
FIRST = 10 * TICK_NS  # the stamp that a test begins with

Command = dict[int, float]  # entry -> effort


@pytest.fixture
def hold() -> ZeroOrderHold:
    return opened(FIRST)


def opened(stamp_ns: int, timeout_ns: int = TIMEOUT_NS) -> ZeroOrderHold:
    hold = ZeroOrderHold(NAMES, ALLOWED, timeout_ns)
    hold.begin_tick(stamp_ns)
    return hold


def as_arrays(command: Command) -> tuple[IntArray, FloatArray]:
    return np.array(list(command), dtype=np.intp), np.array(list(command.values()), dtype=float)


def submit(hold: ZeroOrderHold, command: Command, stamp_ns: int = FIRST) -> CommandStatus:
    return hold.submit(stamp_ns, *as_arrays(command))


def state_of(hold: ZeroOrderHold) -> tuple[object, ...]:
    """All that a command can change, but the counts."""
    return (hold.effort.tobytes(), hold.age_ns, hold.stamp_ns, hold.timeouts)


# Held, and for how long


def test_without_a_command_the_effort_is_zero_and_no_tick_waits(hold: ZeroOrderHold) -> None:
    assert hold.complete
    assert list(hold.missing) == []
    assert hold.age_ns is None
    assert hold.conflict is None
    np.testing.assert_array_equal(hold.effort, np.zeros(6))


def test_a_command_is_held_until_it_is_as_old_as_the_timeout_and_then_zero(
    hold: ZeroOrderHold,
) -> None:
    submit(hold, {4: 4.0, 5: -5.0})
    efforts, ages = [], []

    for tick in range(8):
        hold.begin_tick(FIRST + tick * TICK_NS)
        efforts.append(hold.effort[4:].tolist())
        ages.append(hold.age_ns)

    assert efforts == [[4.0, -5.0]] * 5 + [[0.0, 0.0]] * 3
    assert ages == [tick * TICK_NS for tick in range(5)] + [None] * 3


def test_a_command_is_as_old_as_the_state_that_it_answers(hold: ZeroOrderHold) -> None:
    assert submit(hold, {4: 4.0}, FIRST - 3 * TICK_NS) is CommandStatus.ACCEPTED

    assert hold.age_ns == 3 * TICK_NS
    hold.begin_tick(FIRST + TICK_NS)
    assert hold.effort[4] == 4.0
    hold.begin_tick(FIRST + 2 * TICK_NS)
    assert hold.effort[4] == 0.0


def test_each_degree_of_freedom_ages_by_itself(hold: ZeroOrderHold) -> None:
    submit(hold, {1: 1.0, 2: 2.0, 3: 3.0})
    hold.begin_tick(FIRST + 3 * TICK_NS)
    submit(hold, {4: 4.0}, FIRST + 3 * TICK_NS)

    assert hold.age_ns == 3 * TICK_NS  # the oldest that is held
    hold.begin_tick(FIRST + 5 * TICK_NS)
    np.testing.assert_array_equal(hold.effort, [0.0, 0.0, 0.0, 0.0, 4.0, 0.0])
    assert hold.age_ns == 2 * TICK_NS
    hold.begin_tick(FIRST + 8 * TICK_NS)
    np.testing.assert_array_equal(hold.effort, np.zeros(6))


def test_a_newer_command_replaces_the_one_that_is_held(hold: ZeroOrderHold) -> None:
    submit(hold, {4: 4.0, 5: 5.0})
    hold.begin_tick(FIRST + TICK_NS)

    assert submit(hold, {4: -4.0}, FIRST + TICK_NS) is CommandStatus.ACCEPTED

    np.testing.assert_array_equal(hold.effort[4:], [-4.0, 5.0])
    assert hold.conflict is None


def test_a_command_that_comes_again_and_again_is_held_for_ever(hold: ZeroOrderHold) -> None:
    for tick in range(50):
        hold.begin_tick(FIRST + tick * TICK_NS)
        if tick % 4 == 0:
            submit(hold, {4: 4.0}, FIRST + tick * TICK_NS)

        assert hold.effort[4] == 4.0
    assert hold.timeouts == 0


def test_a_timeout_is_counted_once_however_long_it_lasts_and_however_many_it_hits(
    hold: ZeroOrderHold,
) -> None:
    counts = []
    for tick in range(30):
        hold.begin_tick(FIRST + tick * TICK_NS)
        if tick in (0, 15):
            submit(hold, {4: 4.0, 5: 5.0}, FIRST + tick * TICK_NS)
        counts.append(hold.timeouts)

    assert counts == [0] * 5 + [1] * 15 + [2] * 10


def test_a_timeout_shorter_than_a_tick_is_one_all_the_same() -> None:
    hold = opened(FIRST, timeout_ns=1)
    assert submit(hold, {4: 4.0}) is CommandStatus.ACCEPTED
    assert hold.effort[4] == 4.0

    hold.begin_tick(FIRST + TICK_NS)

    assert hold.effort[4] == 0.0
    assert hold.timeouts == 1


def test_another_timeout_counts_at_once(hold: ZeroOrderHold) -> None:
    submit(hold, {4: 4.0})
    hold.timeout_ns = 2 * TICK_NS
    hold.begin_tick(FIRST + TICK_NS)
    assert hold.effort[4] == 4.0

    hold.begin_tick(FIRST + 2 * TICK_NS)

    assert hold.effort[4] == 0.0
    assert hold.timeouts == 1


def test_the_longest_timeout_that_can_be_set_is_one_too() -> None:
    hold = opened(FIRST, timeout_ns=10**21)
    submit(hold, {4: 4.0})

    hold.begin_tick(2**62)

    assert hold.effort[4] == 4.0


# Stamps


def test_an_unset_stamp_answers_the_last_state(hold: ZeroOrderHold) -> None:
    assert submit(hold, {4: 4.0}, 0) is CommandStatus.ACCEPTED
    assert hold.age_ns == 0

    hold.begin_tick(FIRST + TICK_NS)

    assert submit(hold, {5: 5.0}, 0) is CommandStatus.ACCEPTED
    np.testing.assert_array_equal(hold.effort[4:], [4.0, 5.0])
    assert hold.age_ns == TICK_NS


def test_of_several_unset_stamps_in_a_tick_the_last_counts_and_none_conflicts(
    hold: ZeroOrderHold,
) -> None:
    verdicts = [submit(hold, {4: effort}, 0) for effort in (1.0, 2.0, 2.0, 3.0)]

    assert verdicts == [CommandStatus.ACCEPTED] * 4
    assert hold.effort[4] == 3.0
    assert hold.conflict is None


@pytest.mark.parametrize("late", [5 * TICK_NS, 6 * TICK_NS, FIRST - 1])
def test_an_answer_older_than_the_timeout_is_stale(hold: ZeroOrderHold, late: int) -> None:
    before = state_of(hold)

    assert submit(hold, {4: 4.0}, FIRST - late) is CommandStatus.STALE
    assert state_of(hold) == before


@pytest.mark.parametrize("stamp_ns", [-1, -TICK_NS, -(2**31) * 10**9])
@pytest.mark.parametrize("first", [TICK_NS, FIRST])
def test_a_stamp_before_the_beginning_of_time_is_stale(stamp_ns: int, first: int) -> None:
    hold = opened(first)

    assert submit(hold, {4: 4.0}, stamp_ns) is CommandStatus.STALE
    np.testing.assert_array_equal(hold.effort, np.zeros(6))


def test_an_answer_overtaken_by_a_newer_one_is_stale(hold: ZeroOrderHold) -> None:
    submit(hold, {4: 4.0})
    before = state_of(hold)

    assert submit(hold, {4: 9.0}, FIRST - TICK_NS) is CommandStatus.STALE
    assert submit(hold, {4: 9.0, 5: 9.0}, FIRST - TICK_NS) is CommandStatus.STALE  # none of it
    assert state_of(hold) == before
    assert submit(hold, {5: 5.0}, FIRST - TICK_NS) is CommandStatus.ACCEPTED  # nobody overtook this


@pytest.mark.parametrize("early", [1, TICK_NS, 2**62])
def test_an_answer_to_a_state_that_never_was_is_dropped(hold: ZeroOrderHold, early: int) -> None:
    before = state_of(hold)

    assert submit(hold, {4: 4.0}, FIRST + early) is CommandStatus.FUTURE
    assert state_of(hold) == before


# Repetition and conflict


def test_an_exact_repeat_is_a_duplicate_and_changes_nothing(hold: ZeroOrderHold) -> None:
    submit(hold, {4: 4.0, 5: 5.0})
    before = state_of(hold)

    assert submit(hold, {4: 4.0, 5: 5.0}) is CommandStatus.DUPLICATE
    assert submit(hold, {5: 5.0}) is CommandStatus.DUPLICATE
    assert state_of(hold) == before
    assert hold.conflict is None


def test_a_repeat_in_a_later_tick_is_a_duplicate_too_and_makes_it_no_younger(
    hold: ZeroOrderHold,
) -> None:
    submit(hold, {4: 4.0})
    hold.begin_tick(FIRST + 2 * TICK_NS)

    assert submit(hold, {4: 4.0}, FIRST) is CommandStatus.DUPLICATE
    assert hold.age_ns == 2 * TICK_NS


def test_a_command_that_repeats_a_part_and_adds_another_is_taken(hold: ZeroOrderHold) -> None:
    submit(hold, {4: 4.0})

    assert submit(hold, {4: 4.0, 5: 5.0}) is CommandStatus.ACCEPTED
    np.testing.assert_array_equal(hold.effort[4:], [4.0, 5.0])


def test_of_two_commands_that_answer_one_state_the_last_counts_and_the_entry_is_named(
    hold: ZeroOrderHold,
) -> None:
    submit(hold, {4: 4.0, 5: 5.0})

    verdict = submit(hold, {1: 1.0, 2: 2.0, 3: 3.0, 4: 4.0, 5: -5.0})

    assert verdict is CommandStatus.CONFLICT
    assert hold.conflict == "left_knee"
    np.testing.assert_array_equal(hold.effort, [0.0, 1.0, 2.0, 3.0, 4.0, -5.0])
    assert submit(hold, {5: -5.0}) is CommandStatus.DUPLICATE


def test_a_conflict_with_a_command_of_an_earlier_tick_is_one_too(hold: ZeroOrderHold) -> None:
    submit(hold, {4: 4.0})
    hold.begin_tick(FIRST + TICK_NS)

    assert submit(hold, {4: 9.0}, FIRST) is CommandStatus.CONFLICT
    assert hold.conflict == "right_knee"


def test_the_next_tick_knows_nothing_of_the_conflict(hold: ZeroOrderHold) -> None:
    submit(hold, {4: 4.0})
    submit(hold, {4: 5.0})

    hold.begin_tick(FIRST + TICK_NS)

    assert hold.conflict is None
    assert hold.effort[4] == 5.0


@pytest.mark.parametrize("first", [0.0, -0.0])
def test_a_zero_of_the_other_sign_is_a_repeat(hold: ZeroOrderHold, first: float) -> None:
    submit(hold, {4: first})

    assert submit(hold, {4: -first}) is CommandStatus.DUPLICATE


# Refused


@pytest.mark.parametrize(
    ("indices", "effort", "why"),
    [
        ([4, 5], [4.0, np.nan], "'left_knee' is nan"),
        ([4, 5], [np.inf, 5.0], "'right_knee' is inf"),
        ([4, 0], [4.0, 1.0], "'root_x' is not among the commanded joints"),
        ([4, 5], [4.0], "2 names but 1 efforts"),
        ([4, 5], [], "2 names but 0 efforts"),
        ([], [], "empty"),
    ],
)
@pytest.mark.parametrize("stamp_ns", [0, FIRST - TICK_NS, FIRST, FIRST + 1])
def test_a_refused_command_changes_nothing(
    hold: ZeroOrderHold, indices: list[int], effort: list[float], why: str, stamp_ns: int
) -> None:
    submit(hold, {4: 1.0}, FIRST - 2 * TICK_NS)
    before, counts = state_of(hold), hold.counts.copy()

    with pytest.raises(CommandError, match=why):
        hold.submit(stamp_ns, np.array(indices, dtype=np.intp), np.array(effort))

    assert state_of(hold) == before
    assert hold.counts == counts
    assert hold.conflict is None


# Episodes


def test_a_new_episode_knows_no_command_of_the_one_before(hold: ZeroOrderHold) -> None:
    submit(hold, {4: 4.0})

    hold.clear()
    hold.begin_tick(FIRST + TICK_NS)

    assert hold.age_ns is None
    np.testing.assert_array_equal(hold.effort, np.zeros(6))
    assert hold.timeouts == 0  # forgotten, not too old


@pytest.mark.parametrize("effort", [4.0, 5.0])
@pytest.mark.parametrize("late", range(4))
def test_an_answer_to_a_state_of_the_episode_before_is_stale(
    hold: ZeroOrderHold, effort: float, late: int
) -> None:
    submit(hold, {4: 4.0})

    hold.clear()
    hold.begin_tick(FIRST + TICK_NS)
    verdict = submit(hold, {4: effort}, FIRST - late * TICK_NS)

    assert verdict is CommandStatus.STALE
    np.testing.assert_array_equal(hold.effort, np.zeros(6))
    assert hold.conflict is None


@pytest.mark.parametrize("stamp_ns", [0, FIRST + TICK_NS])
def test_the_first_state_of_an_episode_can_be_answered(hold: ZeroOrderHold, stamp_ns: int) -> None:
    hold.clear()
    hold.begin_tick(FIRST + TICK_NS)

    assert submit(hold, {4: 4.0}, stamp_ns) is CommandStatus.ACCEPTED
    assert hold.effort[4] == 4.0


# Whose arrays they are


def test_the_effort_of_a_tick_outlives_it(hold: ZeroOrderHold) -> None:
    submit(hold, {4: 4.0})
    kept = hold.effort

    hold.begin_tick(FIRST + TICK_NS)
    submit(hold, {4: -4.0}, FIRST + TICK_NS)

    assert kept[4] == 4.0


def test_a_sender_cannot_change_its_command_afterwards(hold: ZeroOrderHold) -> None:
    indices, effort = as_arrays({4: 4.0, 5: 5.0})
    hold.submit(FIRST, indices, effort)

    effort[:] = 99.0
    indices[:] = 1

    np.testing.assert_array_equal(hold.effort, [0.0, 0.0, 0.0, 0.0, 4.0, 5.0])


# Everything at once, against the rules in plain Python


class AnyTraffic(RuleBasedStateMachine):
    """Ticks, episodes and commands in any order, beside a model of one dictionary."""

    commands = st.dictionaries(
        st.integers(1, 5), st.sampled_from([-2.0, 0.0, 1.5]), min_size=1, max_size=3
    )

    @initialize()
    def begin(self) -> None:
        self.hold = ZeroOrderHold(NAMES, ALLOWED, timeout_ns=3)
        self.tick = 1
        self.episode_began = 1
        self.given: dict[int, tuple[int, float, bool]] = {}  # tick, effort, whether stamped
        self.counts: dict[CommandStatus, int] = dict.fromkeys(CommandStatus, 0)
        self.hold.begin_tick(self.tick)

    @rule(count=st.integers(1, 4))
    def next_ticks(self, count: int) -> None:
        for _ in range(count):
            self.tick += 1
            self.hold.begin_tick(self.tick)

    @rule()
    def next_episode(self) -> None:
        self.hold.clear()
        self.given = {}
        self.tick += 1
        self.episode_began = self.tick
        self.hold.begin_tick(self.tick)

    @rule(command=commands, offset=st.integers(-2, 4), stamped=st.booleans())
    def command(self, command: Command, offset: int, stamped: bool) -> None:
        answered = self.tick - offset if stamped else self.tick
        if answered == 0:
            return  # says that there is no stamp
        verdict = submit(self.hold, command, answered if stamped else 0)

        known = {index: self.given[index] for index in command if index in self.given}
        repeated = {i: effort for i, (t, effort, s) in known.items() if s and t == answered}
        differing = [i for i, effort in repeated.items() if effort != command[i]]
        if answered > self.tick:
            expected = CommandStatus.FUTURE
        elif (
            answered < self.episode_began
            or self.tick - answered >= 3
            or any(answered < t for t, _, _ in known.values())
        ):
            expected = CommandStatus.STALE
        elif stamped and differing:
            expected = CommandStatus.CONFLICT
            assert self.hold.conflict in {NAMES[index] for index in differing}
        elif stamped and len(repeated) == len(command):
            expected = CommandStatus.DUPLICATE
        else:
            expected = CommandStatus.ACCEPTED
        assert verdict is expected
        self.counts[verdict] += 1
        if verdict in (CommandStatus.ACCEPTED, CommandStatus.CONFLICT):
            self.given |= {i: (answered, effort, stamped) for i, effort in command.items()}

    @invariant()
    def what_is_held_is_as_the_rules_say(self) -> None:
        held = {i: e for i, (t, e, _) in self.given.items() if self.tick - t < 3}
        ages = [self.tick - t for t, _, _ in self.given.values() if self.tick - t < 3]
        assert self.hold.effort.tolist() == [held.get(index, 0.0) for index in range(6)]
        assert self.hold.age_ns == (max(ages) if ages else None)

    @invariant()
    def the_counts_add_up(self) -> None:
        assert {verdict: self.hold.counts[verdict] for verdict in CommandStatus} == self.counts


TestAnyTraffic = AnyTraffic.TestCase
TestAnyTraffic.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
