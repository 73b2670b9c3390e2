"""Stamps are exact integers of the tick count, at every rate and forever."""

from fractions import Fraction

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from msgs_config.errors import ClockError, ConfigurationError
from msgs_config.messages.clock import TickClock

PROPERTY = settings(max_examples=200, deadline=None)
RATES = [1, 3, 7, 60, 240, 999, 1000, 1920, 99_991, 100_000]
rates = st.one_of(st.sampled_from(RATES), st.integers(1, 100_000))
ticks = st.one_of(st.integers(0, 10_000), st.integers(0, 10**13))


@PROPERTY
@given(rates, ticks)
@example(7, 10**13)
@example(100_000, 10**13)
@example(99_991, 10**17 + 1)  # beyond the whole numbers of a float
def test_a_stamp_is_the_tick_over_the_rate_rounded_down_and_leads_back_to_its_tick(
    rate: int, tick: int
) -> None:
    clock = TickClock(rate)

    stamp_ns = clock.stamp_ns(tick)

    assert isinstance(stamp_ns, int)
    assert 0 <= Fraction(tick * 10**9, rate) - stamp_ns < 1
    assert clock.tick(stamp_ns) == tick
    for beside in (stamp_ns - 1, stamp_ns + 1):
        with pytest.raises(ClockError):
            clock.tick(beside)


@pytest.mark.parametrize(
    ("rate", "stamps"),
    [
        (3, [333_333_333, 666_666_666, 1_000_000_000, 1_333_333_333]),
        (240, [4_166_666, 8_333_333, 12_500_000, 16_666_666]),
        (1000, [1_000_000, 2_000_000, 3_000_000, 4_000_000]),
    ],
)
def test_the_first_stamps_are_those_worked_out_by_hand(rate: int, stamps: list[int]) -> None:
    clock = TickClock(rate)

    assert [clock.stamp_ns(tick) for tick in (1, 2, 3, 4)] == stamps


@PROPERTY
@given(rates, st.integers(0, 10**18))
def test_any_number_is_a_stamp_exactly_if_a_tick_has_it(rate: int, number: int) -> None:
    clock = TickClock(rate)
    nearby = number * rate // 10**9
    has_tick = any(tick * 10**9 // rate == number for tick in (nearby - 1, nearby, nearby + 1))

    if has_tick:
        assert clock.stamp_ns(clock.tick(number)) == number
    else:
        with pytest.raises(ClockError):
            clock.tick(number)


def test_a_stamp_of_another_rate_is_refused_with_the_cause() -> None:
    stamp_ns = TickClock(240).stamp_ns(1)

    with pytest.raises(ClockError) as caught:
        TickClock(250).tick(stamp_ns)

    for word in (str(stamp_ns), "250 Hz", "'rate'"):
        assert word in str(caught.value)


@pytest.mark.parametrize("rate", [-240, -1, 0, 100_001, 10**9])
def test_a_rate_out_of_bounds_is_refused_with_the_bounds(rate: int) -> None:
    with pytest.raises(ConfigurationError, match=f"rate is {rate} Hz; it must be 1 to 100000"):
        TickClock(rate)


@pytest.mark.parametrize("rate", [1, 100_000])
def test_the_bounds_themselves_are_rates(rate: int) -> None:
    assert TickClock(rate).period_s == 1.0 / rate
