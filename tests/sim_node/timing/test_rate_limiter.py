"""When a tick is due by the wall clock, and how late it was; all times are made up."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_node.timing.rate_limiter import RateLimiter

PERIOD = 0.25  # s; a power of two, so that multiples are exact
START = 1000.0


def started(period: float = PERIOD, now: float = START) -> RateLimiter:
    pace = RateLimiter(period)
    pace.restart(now)
    return pace


def test_the_first_tick_is_due_a_period_after_the_start() -> None:
    pace = started()

    assert pace.wait(START) == PERIOD
    assert pace.wait(START + 0.1) == pytest.approx(PERIOD - 0.1)
    assert pace.wait(START + PERIOD) == 0.0
    assert pace.wait(START + 10.0) == 0.0


def test_ticks_are_due_a_period_apart_however_late_each_one_began() -> None:
    pace = started()

    for number, late in enumerate([0.0, 0.05, 0.2, 0.0, 0.01], start=1):
        due = START + number * PERIOD
        assert pace.wait(due - 0.03125) == 0.03125
        pace.tick(due + late)

    assert pace.missed == 0


def test_a_period_of_zero_makes_every_tick_due_at_once_and_none_late() -> None:
    pace = started(period=0.0)

    for now in (START, START, START + 1.0, START + 100.0):
        assert pace.wait(now) == 0.0
        pace.tick(now)

    assert pace.missed == 0
    assert pace.summary().keys() == {"ticks_per_s", "tick_us_p50", "tick_us_p99"}


def test_a_tick_takes_until_the_next_one_begins_and_pauses_are_left_out() -> None:
    pace = started(period=0.0)

    for now in (START, START + 0.5, START + 1.0):
        pace.tick(now)
    pace.restart(START + 90.0)
    pace.tick(START + 99.0)

    assert pace.summary() == {"ticks_per_s": 2.0, "tick_us_p50": 5e5, "tick_us_p99": 5e5}


def test_what_never_began_has_nothing_to_say() -> None:
    assert RateLimiter(PERIOD).summary() == {}
    assert started().summary() == {}


def test_a_deadline_is_missed_when_the_next_tick_was_due_already() -> None:
    period = 0.03125
    pace = started(period)

    pace.tick(START + 2.0 * period)  # just when the next is due
    assert pace.missed == 0
    pace.tick(START + 3.0 * period + 0.001)

    assert pace.missed == 1


def test_a_small_backlog_is_caught_up_with() -> None:
    # 1 ms ticks, the first of them 20 ms late
    period, now = 0.001, START
    pace = started(period, now)
    now += period + 0.020
    taken = 0

    # the others begin as soon as they may, each takes 0.1 ms
    while pace.wait(now) == 0.0:
        pace.tick(now)
        taken += 1
        now += 0.0001

    # all that were due by now began, and the schedule is the old one
    assert taken == math.floor((now - START) / period)
    due = START + (taken + 1) * period
    assert pace.wait(now) == pytest.approx(due - now, abs=1e-9)
    assert pace.missed == 22  # 20 ms less 0.9 ms a tick is more than 1 ms


def test_after_a_long_stall_the_schedule_begins_anew() -> None:
    period = 0.001
    pace = started(period)

    pace.tick(START + 5.0)

    assert pace.missed == 1
    assert pace.wait(START + 5.0) == pytest.approx(period, abs=1e-9)
    pace.tick(START + 5.0 + period)
    assert pace.missed == 1


@pytest.mark.parametrize("period", [0.001, 0.25, 10.0])
def test_what_is_late_by_less_than_a_period_never_moves_the_schedule(period: float) -> None:
    pace = started(period)

    for number in range(1, 50):
        pace.tick(START + (number + 0.9) * period)

    assert pace.wait(START) == pytest.approx(50 * period, abs=1e-9)
    assert pace.missed == 0


@settings(max_examples=60, deadline=None)
@given(
    st.floats(1e-4, 1.0), st.lists(st.floats(0.0, 0.5), min_size=1, max_size=60), st.floats(0, 1)
)
def test_ticks_are_never_more_than_the_wall_clock_allows(
    period: float, busy: list[float], idle: float
) -> None:
    pace, now = started(period, now=0.0), idle * period
    for count, seconds in enumerate(busy, start=1):
        now += pace.wait(now)
        pace.tick(now)
        now += seconds

        assert count <= now / period + 1e-6
        assert pace.wait(now) <= period + 1e-9


def test_lateness_is_summed_up_in_microseconds() -> None:
    pace = started()
    lates = [0.0, 0.001, 0.002, 0.003, 0.1]
    for number, late in enumerate(lates, start=1):
        pace.tick(START + number * PERIOD + late)

    summary = pace.summary()

    assert summary["missed_deadlines"] == 0
    assert summary["late_us_p50"] == pytest.approx(2000.0, abs=0.1)
    assert summary["late_us_p99"] == pytest.approx(1e6 * np.percentile(lates, 99.0), abs=0.2)
    assert summary["late_us_p99.9"] == pytest.approx(1e6 * np.percentile(lates, 99.9), abs=0.2)


def test_lateness_and_durations_are_those_of_the_last_ticks_alone() -> None:
    capacity = 1 << 15
    pace = started()
    for number in range(1, 2 * capacity + 1):
        pace.tick(START + number * PERIOD)

    for number in range(2 * capacity + 1, 3 * capacity + 2):
        pace.tick(START + number * PERIOD + 0.0625)

    summary = pace.summary()
    assert summary["late_us_p50"] == summary["late_us_p99.9"] == 62500.0
    assert summary["tick_us_p50"] == summary["tick_us_p99"] == 1e6 * PERIOD
    half = capacity // 2
    for number in range(3 * capacity + 2, 3 * capacity + 2 + half):
        pace.tick(START + number * PERIOD)
    assert pace.summary()["late_us_p50"] == pytest.approx(31250.0)  # the oldest half is replaced


@pytest.mark.parametrize(("before", "after"), [(PERIOD, 0.5), (PERIOD, 0.0), (0.0, PERIOD)])
def test_another_period_counts_from_now(before: float, after: float) -> None:
    pace = started(before)
    pace.tick(START + before)

    pace.change(after, START + 50.0)

    assert pace.wait(START + 50.0) == after
    pace.tick(START + 50.0 + after)
    assert pace.wait(START + 50.0 + after) == after
    assert pace.missed == 0


@pytest.mark.parametrize(("missed", "warns"), [(0, False), (2, False), (3, True)])
def test_more_than_a_hundredth_of_missed_deadlines_is_a_warning_once(
    missed: int, warns: bool
) -> None:
    pace, ticks = started(), 200

    now = START
    for number in range(ticks):
        now += pace.wait(now)
        # late by a period and a half, which the ticks after it catch up with
        pace.tick(now + (1.5 * PERIOD if number % 60 == 30 and number // 60 < missed else 0.0))

    warning = pace.take_warning()
    assert pace.missed == missed
    assert (warning is not None) is warns
    assert not warns or (warning is not None and f"{missed} of the last {ticks}" in warning)
    assert pace.take_warning() is None  # of what came since


def test_fewer_than_a_hundred_deadlines_are_not_judged() -> None:
    pace = started()
    pace.tick(START + PERIOD)
    pace.tick(START + 3.5 * PERIOD)

    assert pace.missed == 1
    assert pace.take_warning() is None


def test_without_a_schedule_no_deadline_is_missed() -> None:
    pace = started(period=0.0)

    pace.tick(START + 100.0)

    assert pace.take_warning() is None
