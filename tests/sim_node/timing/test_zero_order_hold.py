"""Real time: which command is held, and for how long; all times are made up."""

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from msgs_config.arrays import FloatArray, IntArray
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


@pytest.mark.parametrize("stamp_ns", [-1, -TICK_NS, -(2**31) * 10**9])
@pytest.mark.parametrize("first", [TICK_NS, FIRST])
def test_a_stamp_before_the_beginning_of_time_is_stale(stamp_ns: int, first: int) -> None:
    hold = opened(first)

    assert submit(hold, {4: 4.0}, stamp_ns) is CommandStatus.STALE
    np.testing.assert_array_equal(hold.effort, np.zeros(6))


# Repetition and conflict


def test_of_two_commands_that_answer_one_state_the_last_counts_and_the_entry_is_named(
    hold: ZeroOrderHold,
) -> None:
    submit(hold, {4: 4.0, 5: 5.0})

    verdict = submit(hold, {1: 1.0, 2: 2.0, 3: 3.0, 4: 4.0, 5: -5.0})

    assert verdict is CommandStatus.CONFLICT
    assert hold.conflict == "left_knee"
    np.testing.assert_array_equal(hold.effort, [0.0, 1.0, 2.0, 3.0, 4.0, -5.0])
    assert submit(hold, {5: -5.0}) is CommandStatus.DUPLICATE


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
        in_force = {i: e for i, (t, e, _) in self.given.items() if self.tick - t < 3}
        ages = [self.tick - t for t, _, _ in self.given.values() if self.tick - t < 3]
        assert self.hold.effort.tolist() == [in_force.get(index, 0.0) for index in range(6)]
        assert self.hold.age_ns == (max(ages) if ages else None)

    @invariant()
    def the_counts_add_up(self) -> None:
        assert {verdict: self.hold.counts[verdict] for verdict in CommandStatus} == self.counts


TestAnyTraffic = AnyTraffic.TestCase
TestAnyTraffic.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
