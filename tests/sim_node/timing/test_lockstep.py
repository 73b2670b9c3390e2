"""The barrier gives the same tick whatever the order, repetition and interleaving of commands."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.errors import CommandError
from sim_node.timing.lockstep import CommandStatus, LockstepBarrier

PROPERTY = settings(max_examples=80, deadline=None)
NAMES = ["root_x", "chest_x", "chest_y", "chest_z", "right_knee", "left_knee"]
REQUIRED = np.array([False, True, True, True, True, True])
STAMP_NS = 4_166_666

Command = dict[int, float]  # entry -> effort


@pytest.fixture
def barrier() -> LockstepBarrier:
    return opened(STAMP_NS)


def opened(stamp_ns: int) -> LockstepBarrier:
    barrier = LockstepBarrier(NAMES, REQUIRED)
    barrier.begin_tick(stamp_ns)
    return barrier


def as_arrays(command: Command) -> tuple[IntArray, FloatArray]:
    return np.array(list(command), dtype=np.intp), np.array(list(command.values()), dtype=float)


def submit(barrier: LockstepBarrier, command: Command, stamp_ns: int = STAMP_NS) -> CommandStatus:
    return barrier.submit(stamp_ns, *as_arrays(command))


def state_of(barrier: LockstepBarrier) -> tuple[object, ...]:
    """All that a command can change, but the counts."""
    return (barrier.effort.tobytes(), barrier.missing, barrier.complete, barrier.stamp_ns)


# Coverage


def test_a_new_tick_misses_every_required_entry_and_has_no_effort(barrier: LockstepBarrier) -> None:
    assert not barrier.complete
    assert barrier.missing == NAMES[1:]
    np.testing.assert_array_equal(barrier.effort, np.zeros(6))
    assert barrier.conflict is None


def test_the_tick_is_complete_when_the_last_entry_has_its_command(barrier: LockstepBarrier) -> None:
    assert submit(barrier, {3: 3.0, 1: 1.0, 2: 2.0}) is CommandStatus.ACCEPTED
    assert not barrier.complete
    assert barrier.missing == ["right_knee", "left_knee"]

    assert submit(barrier, {5: 5.0, 4: 4.0}) is CommandStatus.ACCEPTED

    assert barrier.complete
    assert barrier.missing == []
    np.testing.assert_array_equal(barrier.effort, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0])


def test_where_nothing_is_required_nothing_is_waited_for() -> None:
    barrier = LockstepBarrier(NAMES, np.zeros(6, dtype=np.bool_))

    barrier.begin_tick(STAMP_NS)

    assert barrier.complete
    np.testing.assert_array_equal(barrier.effort, np.zeros(6))


@st.composite
def senders(draw: st.DrawFn) -> list[Command]:
    """Commands of several senders that share all required entries among them."""
    required = [index for index, needed in enumerate(REQUIRED) if needed]
    order = draw(st.permutations(required))
    owners = draw(st.lists(st.integers(0, 2), min_size=len(order), max_size=len(order)))
    efforts = draw(st.lists(st.floats(-500, 500), min_size=len(order), max_size=len(order)))
    commands: list[Command] = [{}, {}, {}]
    for index, owner, effort in zip(order, owners, efforts, strict=True):
        commands[owner][index] = effort
    return [command for command in commands if command]


@PROPERTY
@given(senders(), st.data())
def test_the_effort_does_not_depend_on_order_repetition_or_loss(
    commands: list[Command], data: st.DataObject
) -> None:
    in_order = opened(STAMP_NS)
    for command in commands:
        submit(in_order, command)
    barrier = opened(STAMP_NS)
    # some come many times, some are lost at first; then all come again, as to a republished state
    arrivals = data.draw(st.lists(st.sampled_from(commands), max_size=8))
    arrivals += data.draw(st.permutations(commands))

    verdicts = [submit(barrier, command) for command in arrivals]

    assert barrier.complete
    assert barrier.effort.tobytes() == in_order.effort.tobytes()
    assert verdicts.count(CommandStatus.ACCEPTED) == len(commands)
    assert verdicts.count(CommandStatus.DUPLICATE) == len(arrivals) - len(commands)


@PROPERTY
@given(senders(), st.data())
def test_the_tick_is_complete_exactly_when_every_sender_was_heard(
    commands: list[Command], data: st.DataObject
) -> None:
    barrier = opened(STAMP_NS)
    heard: set[int] = set()

    for number in data.draw(st.lists(st.integers(0, len(commands) - 1), max_size=10)):
        submit(barrier, commands[number])
        heard |= set(commands[number])

        assert barrier.complete == (heard == {1, 2, 3, 4, 5})
        assert barrier.missing == [NAMES[index] for index in range(1, 6) if index not in heard]


def test_a_late_joiner_completes_the_tick_that_waited_for_it(barrier: LockstepBarrier) -> None:
    legs, chest = {4: 4.0, 5: 5.0}, {1: 1.0, 2: 2.0, 3: 3.0}
    for _ in range(5):  # the state is published again and again, the first answers from memory
        submit(barrier, legs)
    assert not barrier.complete

    assert submit(barrier, chest) is CommandStatus.ACCEPTED

    assert barrier.complete
    np.testing.assert_array_equal(barrier.effort, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0])


# Repetition and conflict


def test_an_exact_repeat_is_a_duplicate_and_changes_nothing(barrier: LockstepBarrier) -> None:
    submit(barrier, {4: 4.0, 5: 5.0})
    before = state_of(barrier)

    assert submit(barrier, {4: 4.0, 5: 5.0}) is CommandStatus.DUPLICATE
    assert submit(barrier, {5: 5.0}) is CommandStatus.DUPLICATE
    assert state_of(barrier) == before
    assert barrier.conflict is None


def test_a_command_that_repeats_a_part_and_adds_another_is_taken(barrier: LockstepBarrier) -> None:
    submit(barrier, {4: 4.0})

    assert submit(barrier, {4: 4.0, 5: 5.0}) is CommandStatus.ACCEPTED
    np.testing.assert_array_equal(barrier.effort, [0.0, 0.0, 0.0, 0.0, 4.0, 5.0])


@pytest.mark.parametrize("other", [4.5, -4.0, float(np.nextafter(4.0, 5.0)), 0.0])
def test_another_effort_for_the_same_entry_is_a_conflict_that_names_it(
    barrier: LockstepBarrier, other: float
) -> None:
    submit(barrier, {4: 4.0})
    before = state_of(barrier)

    verdict = submit(barrier, {1: 1.0, 2: 2.0, 3: 3.0, 4: other, 5: 5.0})

    assert verdict is CommandStatus.CONFLICT
    assert barrier.conflict == "right_knee"
    assert state_of(barrier) == before  # nothing of it was taken


@pytest.mark.parametrize("first", [0.0, -0.0])
def test_a_zero_of_the_other_sign_is_a_repeat(barrier: LockstepBarrier, first: float) -> None:
    submit(barrier, {4: first})

    assert submit(barrier, {4: -first}) is CommandStatus.DUPLICATE


def test_a_conflict_after_the_tick_is_complete_is_one_all_the_same(
    barrier: LockstepBarrier,
) -> None:
    submit(barrier, {1: 1.0, 2: 2.0, 3: 3.0, 4: 4.0, 5: 5.0})
    before = state_of(barrier)

    assert submit(barrier, {2: 2.5}) is CommandStatus.CONFLICT
    assert barrier.conflict == "chest_y"
    assert state_of(barrier) == before


def test_the_next_tick_knows_nothing_of_the_conflict(barrier: LockstepBarrier) -> None:
    submit(barrier, {4: 4.0})
    submit(barrier, {4: 5.0})

    barrier.begin_tick(STAMP_NS + 1)

    assert barrier.conflict is None
    assert submit(barrier, {4: 5.0}, STAMP_NS + 1) is CommandStatus.ACCEPTED


# Stamps


@PROPERTY
@given(st.integers(-(2**62), 2**62))
def test_only_an_answer_to_this_very_state_is_taken(stamp_ns: int) -> None:
    barrier = opened(STAMP_NS)
    before = state_of(barrier)

    verdict = submit(barrier, {4: 4.0}, stamp_ns)

    if stamp_ns == STAMP_NS:
        assert verdict is CommandStatus.ACCEPTED
    else:
        assert verdict is (CommandStatus.STALE if stamp_ns < STAMP_NS else CommandStatus.FUTURE)
        assert state_of(barrier) == before


def test_an_answer_that_was_future_is_taken_when_it_comes_again_in_its_tick(
    barrier: LockstepBarrier,
) -> None:
    assert submit(barrier, {4: 4.0}, STAMP_NS + 1) is CommandStatus.FUTURE

    barrier.begin_tick(STAMP_NS + 1)

    assert "right_knee" in barrier.missing
    assert submit(barrier, {4: 4.0}, STAMP_NS + 1) is CommandStatus.ACCEPTED
    assert submit(barrier, {4: 3.0}, STAMP_NS) is CommandStatus.STALE


def test_a_stale_command_is_no_conflict(barrier: LockstepBarrier) -> None:
    submit(barrier, {4: 4.0})

    assert submit(barrier, {4: 9.0}, STAMP_NS - 1) is CommandStatus.STALE
    assert barrier.conflict is None


# Rejections


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("stamp_ns", [STAMP_NS - 1, STAMP_NS, STAMP_NS + 1])
def test_a_number_that_is_not_finite_rejects_the_whole_command_by_joint(
    barrier: LockstepBarrier, number: float, stamp_ns: int
) -> None:
    before = state_of(barrier)

    with pytest.raises(CommandError, match=f"'left_knee' is {number}"):
        submit(barrier, {4: 4.0, 5: number, 1: 1.0}, stamp_ns)

    assert state_of(barrier) == before


def test_an_entry_that_may_not_be_commanded_rejects_the_whole_command_by_joint(
    barrier: LockstepBarrier,
) -> None:
    before = state_of(barrier)

    with pytest.raises(CommandError, match="'root_x' is not among the commanded joints"):
        submit(barrier, {4: 4.0, 0: 1000.0})

    assert state_of(barrier) == before
    assert barrier.effort[0] == 0.0


@pytest.mark.parametrize("length", [0, 1, 3])
def test_arrays_of_unequal_length_reject_the_command(barrier: LockstepBarrier, length: int) -> None:
    before = state_of(barrier)

    with pytest.raises(CommandError, match=f"2 names but {length} efforts"):
        barrier.submit(STAMP_NS, np.array([4, 5]), np.ones(length))

    assert state_of(barrier) == before


def test_an_empty_command_is_rejected(barrier: LockstepBarrier) -> None:
    with pytest.raises(CommandError, match="empty"):
        submit(barrier, {})


# Going on without a command


def test_filling_completes_the_tick_where_commands_are_missing_and_only_there(
    barrier: LockstepBarrier,
) -> None:
    submit(barrier, {4: 4.0})

    barrier.fill_missing(np.array([90.0, 10.0, 20.0, 30.0, 40.0, 50.0]))

    assert barrier.complete
    assert barrier.missing == []
    # the base is not required, so it stays without effort
    np.testing.assert_array_equal(barrier.effort, [0.0, 10.0, 20.0, 30.0, 4.0, 50.0])


def test_filling_a_complete_tick_changes_nothing(barrier: LockstepBarrier) -> None:
    submit(barrier, {1: 1.0, 2: 2.0, 3: 3.0, 4: 4.0, 5: 5.0})
    before = state_of(barrier)

    barrier.fill_missing(np.full(6, 99.0))

    assert state_of(barrier) == before


def test_what_was_filled_is_not_carried_into_the_next_tick(barrier: LockstepBarrier) -> None:
    barrier.fill_missing(np.full(6, 99.0))

    barrier.begin_tick(STAMP_NS + 1)

    assert barrier.missing == NAMES[1:]
    np.testing.assert_array_equal(barrier.effort, np.zeros(6))


# Whose arrays they are


def test_the_effort_of_a_tick_outlives_it(barrier: LockstepBarrier) -> None:
    submit(barrier, {1: 1.0, 2: 2.0, 3: 3.0, 4: 4.0, 5: 5.0})
    kept = barrier.effort

    barrier.begin_tick(STAMP_NS + 1)
    submit(barrier, {4: -4.0}, STAMP_NS + 1)
    barrier.fill_missing(np.full(6, 99.0))

    np.testing.assert_array_equal(kept, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0])


def test_a_sender_cannot_change_its_command_afterwards(barrier: LockstepBarrier) -> None:
    indices, effort = as_arrays({4: 4.0, 5: 5.0})
    barrier.submit(STAMP_NS, indices, effort)

    effort[:] = 99.0
    indices[:] = 1

    np.testing.assert_array_equal(barrier.effort, [0.0, 0.0, 0.0, 0.0, 4.0, 5.0])


def test_another_command_for_a_tick_that_is_over_is_a_conflict_and_a_repeat_is_only_late() -> None:
    barrier = LockstepBarrier(NAMES, REQUIRED)
    barrier.begin_tick(STAMP_NS)
    submit(barrier, {4: 4.0, 5: 5.0})
    barrier.fill_missing(np.zeros(6))
    barrier.begin_tick(2 * STAMP_NS)

    verdicts = [
        submit(barrier, command, STAMP_NS)
        for command in ({4: 4.0}, {5: 5.0, 4: 4.0}, {1: 1.0, 2: 0.0, 3: 0.0}, {4: 4.0, 5: 6.0})
    ]

    late = CommandStatus.STALE  # what nobody had commanded may be commanded by who is late
    assert verdicts == [late, late, late, CommandStatus.CONFLICT]
    assert barrier.conflict == NAMES[5]
    assert not barrier.effort.any()


def test_a_new_episode_knows_nothing_of_the_ticks_before() -> None:
    barrier = LockstepBarrier(NAMES, REQUIRED)
    barrier.begin_tick(STAMP_NS)
    submit(barrier, {4: 4.0})
    barrier.clear()
    barrier.begin_tick(2 * STAMP_NS)

    assert submit(barrier, {4: 5.0}, STAMP_NS) is CommandStatus.STALE


def test_opening_and_offering_change_no_argument() -> None:
    required, fill = REQUIRED.copy(), np.full(6, 7.0)
    barrier = LockstepBarrier(NAMES, required)
    barrier.begin_tick(STAMP_NS)
    submit(barrier, {4: 4.0})

    barrier.fill_missing(fill)

    np.testing.assert_array_equal(required, REQUIRED)
    np.testing.assert_array_equal(fill, np.full(6, 7.0))


# Everything at once, against the rules in plain Python


class AnyTraffic(RuleBasedStateMachine):
    """Ticks, good and bad commands in any order, beside a model of one dictionary a tick."""

    commands = st.dictionaries(
        st.integers(1, 5), st.sampled_from([-2.0, 0.0, 1.5]), min_size=1, max_size=5
    )

    @initialize()
    def begin(self) -> None:
        self.barrier = LockstepBarrier(NAMES, REQUIRED)
        self.tick = 1
        self.given: Command = {}
        self.commanded: dict[int, Command] = {1: {}}  # by tick, without what a timeout filled in
        self.expected: dict[CommandStatus, int] = dict.fromkeys(CommandStatus, 0)
        self.barrier.begin_tick(self.tick)

    @rule()
    def next_tick(self) -> None:
        self.tick += 1
        self.given = {}
        self.commanded[self.tick] = {}
        self.barrier.begin_tick(self.tick)

    @rule(command=commands)
    def command_of_this_tick(self, command: Command) -> None:
        known = {index for index in command if index in self.given}
        differing = {index for index in known if command[index] != self.given[index]}

        verdict = submit(self.barrier, command, self.tick)

        if differing:
            assert verdict is CommandStatus.CONFLICT
            assert self.barrier.conflict in {NAMES[index] for index in differing}
        elif known == set(command):
            assert verdict is CommandStatus.DUPLICATE
        else:
            assert verdict is CommandStatus.ACCEPTED
            self.given |= command
            self.commanded[self.tick] |= command
        self.expected[verdict] += 1

    @rule(command=commands, offset=st.integers(1, 3))
    def command_of_an_earlier_tick(self, command: Command, offset: int) -> None:
        before = self.commanded.get(self.tick - offset, {})
        differs = any(before.get(index, value) != value for index, value in command.items())

        verdict = submit(self.barrier, command, self.tick - offset)

        assert verdict is (CommandStatus.CONFLICT if differs else CommandStatus.STALE)
        self.expected[verdict] += 1

    @rule(command=commands, offset=st.integers(1, 3))
    def command_of_a_later_tick(self, command: Command, offset: int) -> None:
        assert submit(self.barrier, command, self.tick + offset) is CommandStatus.FUTURE
        self.expected[CommandStatus.FUTURE] += 1

    @rule(command=commands, bad=st.sampled_from([{0: 1.0}, {5: np.nan}, {1: np.inf}]))
    def command_with_a_fault(self, command: Command, bad: Command) -> None:
        with pytest.raises(CommandError):
            submit(self.barrier, command | bad, self.tick)
        self.barrier.counts[CommandStatus.REJECTED] += 1
        self.expected[CommandStatus.REJECTED] += 1

    @precondition(lambda self: len(self.given) < 5)
    @rule(fill=st.sampled_from([0.0, 3.0]))
    def timeout(self, fill: float) -> None:
        self.barrier.fill_missing(np.full(6, fill))
        self.given = dict.fromkeys(range(1, 6), fill) | self.given

    @invariant()
    def the_barrier_is_as_the_rules_say(self) -> None:
        effort = [self.given.get(index, 0.0) for index in range(6)]
        missing = [index for index in range(1, 6) if index not in self.given]
        assert self.barrier.effort.tolist() == effort
        assert self.barrier.missing == [NAMES[index] for index in missing]
        assert self.barrier.complete == (not missing)
        assert self.barrier.stamp_ns == self.tick

    @invariant()
    def the_counts_add_up(self) -> None:
        assert {verdict: self.barrier.counts[verdict] for verdict in CommandStatus} == self.expected


TestAnyTraffic = AnyTraffic.TestCase
TestAnyTraffic.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
