"""What a long wait calls for, on a clock of whole sixteenths of a second: no rounding."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_node.timing.watchdog import Watchdog, WatchdogEvent

PROPERTY = settings(max_examples=100, deadline=None)
START = 1000.0
sixteenths = st.integers(1, 200).map(lambda count: count / 16)
waits = st.lists(st.integers(0, 60).map(lambda count: count / 16), max_size=40)


def restarted(republish: float = 0.5, explain: float = 2.0, timeout: float = 4.0) -> Watchdog:
    patience = Watchdog(republish, timeout, explain)
    patience.restart(START)
    return patience


@pytest.mark.parametrize("now", [-math.inf, 0.0, 1e12])
def test_nothing_is_due_before_the_first_state(now: float) -> None:
    patience = Watchdog(republish_period=0.5, explain_after=2.0, timeout=4.0)

    assert patience.due(now) == []


def test_everything_comes_at_its_time() -> None:
    patience = restarted()

    told = {quarter / 4: due for quarter in range(25) if (due := patience.due(START + quarter / 4))}

    assert told == {
        0.5: [WatchdogEvent.REPUBLISH],
        1.0: [WatchdogEvent.REPUBLISH],
        1.5: [WatchdogEvent.REPUBLISH],
        2.0: [WatchdogEvent.REPUBLISH, WatchdogEvent.EXPLAIN],
        2.5: [WatchdogEvent.REPUBLISH],
        3.0: [WatchdogEvent.REPUBLISH],
        3.5: [WatchdogEvent.REPUBLISH],
        4.0: [WatchdogEvent.REPUBLISH, WatchdogEvent.TIMEOUT],
        4.5: [WatchdogEvent.REPUBLISH],
        5.0: [WatchdogEvent.REPUBLISH],
        5.5: [WatchdogEvent.REPUBLISH],
        6.0: [WatchdogEvent.REPUBLISH],
    }


def test_whoever_asks_late_is_told_everything_once() -> None:
    patience = restarted()

    assert set(patience.due(START + 100.0)) == {
        WatchdogEvent.REPUBLISH,
        WatchdogEvent.EXPLAIN,
        WatchdogEvent.TIMEOUT,
    }
    assert patience.due(START + 100.0) == []
    assert patience.due(START + 100.5) == [WatchdogEvent.REPUBLISH]


def test_a_timeout_of_zero_never_comes() -> None:
    patience = restarted(timeout=0.0)

    told = [due for second in range(10_000) for due in patience.due(START + 1000.0 * second)]

    assert WatchdogEvent.TIMEOUT not in told


def test_a_new_state_starts_every_wait_again() -> None:
    patience = restarted()
    patience.due(START + 100.0)

    patience.restart(START + 100.0)

    assert patience.due(START + 100.25) == []
    assert patience.due(START + 102.0) == [WatchdogEvent.REPUBLISH, WatchdogEvent.EXPLAIN]
    assert patience.due(START + 104.0) == [WatchdogEvent.REPUBLISH, WatchdogEvent.TIMEOUT]


@PROPERTY
@given(sixteenths, sixteenths, sixteenths, waits)
def test_explanation_and_timeout_come_once_and_at_the_first_chance(
    republish: float, explain: float, timeout: float, steps: list[float]
) -> None:
    patience = restarted(republish, explain, timeout)
    now, told = START, dict[WatchdogEvent, list[float]]()
    asked = []

    for step in steps:
        now += step
        asked.append(now)
        for due in patience.due(now):
            told.setdefault(due, []).append(now)

    for due, after in ((WatchdogEvent.EXPLAIN, explain), (WatchdogEvent.TIMEOUT, timeout)):
        late_enough = [time for time in asked if time >= START + after]
        assert told.get(due, []) == late_enough[:1]


@PROPERTY
@given(sixteenths, waits)
def test_a_state_is_never_sent_again_sooner_than_its_period_nor_later_than_asked(
    period: float, steps: list[float]
) -> None:
    patience = restarted(republish=period)
    now = last = START

    for step in steps:
        now += step
        is_due = WatchdogEvent.REPUBLISH in patience.due(now)
        assert is_due == (now - last >= period)
        last = now if is_due else last


@PROPERTY
@given(st.lists(st.integers(0, 15).map(lambda count: count / 32), max_size=40))
def test_while_states_follow_each_other_nothing_is_due(steps: list[float]) -> None:
    patience = restarted()
    now = START

    for step in steps:  # each less than the shortest wait
        now += step
        assert patience.due(now) == []
        patience.restart(now)
