"""When a controller manager updates."""

import pytest

from actuated_characters.ros2_control.timetable import Timetable, UpdatePeriod
from msgs_config.errors import ConfigurationError


def test_an_update_is_due_each_period_and_its_time_is_whole_periods() -> None:
    timetable = Timetable(UpdatePeriod(1000, 250))
    for _ in range(3):
        timetable.stand()
    timetable.begin(7)

    due = [(tick, timetable.now_ns) for tick in range(7, 20) if timetable.is_update(tick)]

    assert due == [(7, 16_000_000), (11, 20_000_000), (15, 24_000_000), (19, 28_000_000)]
    assert [timetable.share(tick) for tick in (19, 20, 22)] == [0.0, 0.25, 0.75]


def test_another_episode_begins_with_an_update_and_time_goes_on() -> None:
    timetable = Timetable(UpdatePeriod(1000, 250))
    timetable.begin(1)
    assert timetable.is_update(1) and not timetable.is_update(2)

    timetable.begin(3)

    assert timetable.is_update(3) and timetable.now_ns == 8_000_000


def test_the_same_tick_is_no_update_twice() -> None:
    timetable = Timetable(UpdatePeriod(100, 100))
    timetable.begin(1)

    assert timetable.is_update(1) and not timetable.is_update(1)


@pytest.mark.parametrize(
    ("rate", "update_rate", "says"),
    [(240, 240, "whole nanoseconds"), (1000, 400, "divide 'rate'"), (100, 200, "divide 'rate'")],
)
def test_rates_that_a_manager_would_miss_are_refused(
    rate: int, update_rate: int, says: str
) -> None:
    with pytest.raises(ConfigurationError, match=says):
        UpdatePeriod(rate, update_rate)


def test_the_start_is_a_number_of_periods() -> None:
    period = UpdatePeriod(1000, 250)

    assert period.whole_ns(3.0) == 3_000_000_000
    with pytest.raises(ConfigurationError, match=r"'start_time' is 0.001 s"):
        period.whole_ns(0.001)
