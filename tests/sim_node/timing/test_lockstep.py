"""The barrier gives the same tick whatever the order, repetition and interleaving of commands."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.errors import CommandError
from sim_node.timing.lockstep import CommandStatus, LockstepBarrier
from sim_node.timing.zero_order_hold import ZeroOrderHold

PROPERTY = settings(max_examples=80, deadline=None)
NAMES = ["root_x", "chest_x", "chest_y", "chest_z", "right_knee", "left_knee"]
REQUIRED = np.array([False, True, True, True, True, True])
STAMP_NS = 4_166_666

Command = dict[int, float]  # entry -> effort
Collector = LockstepBarrier | ZeroOrderHold


@pytest.fixture
def barrier() -> LockstepBarrier:
    return opened(STAMP_NS)


def opened(stamp_ns: int) -> LockstepBarrier:
    barrier = LockstepBarrier(NAMES, REQUIRED)
    barrier.begin_tick(stamp_ns)
    return barrier


def as_arrays(command: Command) -> tuple[IntArray, FloatArray]:
    return np.array(list(command), dtype=np.intp), np.array(list(command.values()), dtype=float)


def submit(barrier: Collector, command: Command, stamp_ns: int = STAMP_NS) -> CommandStatus:
    return barrier.submit(stamp_ns, *as_arrays(command))


def state_of(barrier: Collector) -> tuple[object, ...]:
    """All that a command can change, but the counts."""
    return (barrier.effort.tobytes(), list(barrier.missing), barrier.complete, barrier.stamp_ns)


# Coverage


def test_the_tick_is_complete_when_the_last_entry_has_its_command(barrier: LockstepBarrier) -> None:
    assert submit(barrier, {3: 3.0, 1: 1.0, 2: 2.0}) is CommandStatus.ACCEPTED
    assert not barrier.complete
    assert barrier.missing == ["right_knee", "left_knee"]

    assert submit(barrier, {5: 5.0, 4: 4.0}) is CommandStatus.ACCEPTED

    assert barrier.complete
    assert barrier.missing == []
    np.testing.assert_array_equal(barrier.effort, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0])


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


# Repetition and conflict


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


def test_where_nothing_is_required_nothing_is_waited_for() -> None:
    barrier = LockstepBarrier(NAMES, np.zeros(6, dtype=np.bool_))
    barrier.begin_tick(STAMP_NS)

    assert barrier.complete


def test_a_new_episode_knows_nothing_of_the_ticks_before() -> None:
    barrier = LockstepBarrier(NAMES, REQUIRED)
    barrier.begin_tick(STAMP_NS)
    submit(barrier, {4: 4.0})
    barrier.clear()
    barrier.begin_tick(2 * STAMP_NS)

    assert submit(barrier, {4: 5.0}, STAMP_NS) is CommandStatus.STALE


# What the barrier and the zero-order hold have in common


def hold() -> ZeroOrderHold:
    collector = ZeroOrderHold(NAMES, REQUIRED, timeout_ns=10**9)
    collector.begin_tick(STAMP_NS)
    return collector


@pytest.fixture(params=[lambda: opened(STAMP_NS), hold], ids=["barrier", "hold"])
def collector(request: pytest.FixtureRequest) -> Collector:
    made: Collector = request.param()
    return made


@pytest.mark.parametrize(
    ("indices", "effort", "why"),
    [
        ([4, 5], [4.0, np.nan], "'left_knee' is nan"),
        ([4, 5], [np.inf, 5.0], "'right_knee' is inf"),
        ([4, 5, 1], [4.0, -np.inf, 1.0], "'left_knee' is -inf"),
        ([4, 0], [4.0, 1.0], "'root_x' is not among the commanded joints"),
        ([4, 5], [4.0], "2 names but 1 efforts"),
        ([4, 5], [], "2 names but 0 efforts"),
        ([4, 5], [1.0, 2.0, 3.0], "2 names but 3 efforts"),
        ([], [], "empty"),
    ],
)
@pytest.mark.parametrize("stamp_ns", [0, STAMP_NS - 1, STAMP_NS, STAMP_NS + 1])
def test_a_refused_command_changes_nothing(
    collector: Collector, indices: list[int], effort: list[float], why: str, stamp_ns: int
) -> None:
    submit(collector, {3: 1.0})
    before, counts = state_of(collector), collector.counts.copy()

    with pytest.raises(CommandError, match=why):
        collector.submit(stamp_ns, np.array(indices, dtype=np.intp), np.array(effort))

    assert state_of(collector) == before
    assert collector.counts == counts
    assert collector.conflict is None


@pytest.mark.parametrize("first", [0.0, -0.0])
def test_a_zero_of_the_other_sign_is_a_repeat(collector: Collector, first: float) -> None:
    submit(collector, {4: first})

    assert submit(collector, {4: -first}) is CommandStatus.DUPLICATE


def test_the_next_tick_knows_nothing_of_a_conflict(collector: Collector) -> None:
    submit(collector, {4: 4.0})
    assert submit(collector, {4: 5.0}) is CommandStatus.CONFLICT

    collector.begin_tick(STAMP_NS + 1)

    assert collector.conflict is None
    assert submit(collector, {4: 5.0}, STAMP_NS + 1) is CommandStatus.ACCEPTED


def test_neither_the_sender_nor_a_later_tick_changes_a_commands_effort(
    collector: Collector,
) -> None:
    indices, effort = as_arrays({4: 4.0, 5: 5.0})
    collector.submit(STAMP_NS, indices, effort)
    accepted = collector.effort

    effort[:] = 99.0
    indices[:] = 1
    collector.begin_tick(STAMP_NS + 1)
    submit(collector, {4: -4.0}, STAMP_NS + 1)

    np.testing.assert_array_equal(accepted, [0.0, 0.0, 0.0, 0.0, 4.0, 5.0])


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
