"""Episodes begin anywhere, and more often around where others fell."""

from dataclasses import replace

import numpy as np
import pytest

from actuated_characters.training.starts import StartRange, Starts
from msgs_config.arrays import BoolArray, IntArray

RATE = 240
SECONDS = 10
WALK, KICK = StartRange(0, RATE * SECONDS, True), StartRange(RATE * 30, RATE * 2, False)
DRAWS = 20_000


def anywhere(starts: Starts, *ranges: StartRange) -> IntArray:
    """Rows that are drawn, but for those in which a reference begins."""
    rows = starts.draw(DRAWS, np.random.default_rng(1))
    return rows[~np.isin(rows, [each.first for each in ranges])]


def test_a_tenth_of_the_episodes_begin_where_a_run_does() -> None:
    rows = Starts([WALK, KICK], RATE).draw(DRAWS, np.random.default_rng(1))

    assert (rows == WALK.first).mean() == pytest.approx(0.05, abs=0.01)
    assert (rows == KICK.first).mean() == pytest.approx(0.05, abs=0.01)


def test_every_reference_is_as_likely_and_every_row_of_it() -> None:
    rows = anywhere(Starts([WALK, KICK], RATE), WALK, KICK)

    of_kick = rows >= KICK.first
    assert of_kick.mean() == pytest.approx(0.5, abs=0.02)
    for each, own in ((WALK, rows[~of_kick]), (KICK, rows[of_kick])):
        counts = np.histogram(own, 10, (each.first, each.first + each.count))[0]
        assert counts / len(own) == pytest.approx(0.1, abs=0.015)
        assert own.min() >= each.first
        assert own.max() < each.first + each.count


@pytest.mark.parametrize("learns", [False, True])
def test_more_episodes_begin_in_what_weighs_more(learns: bool) -> None:
    starts = Starts([WALK, replace(KICK, weight=0.25)], RATE)
    if learns:
        starts.learn(np.arange(WALK.count), np.arange(WALK.count) > WALK.count // 2)

    rows = starts.draw(DRAWS, np.random.default_rng(1))

    assert (rows >= KICK.first).mean() == pytest.approx(0.2, abs=0.02)


def test_a_reference_shorter_than_a_bin_has_all_its_rows() -> None:
    short = StartRange(5, 3, True)

    rows = Starts([short], RATE).draw(200, np.random.default_rng(1))

    assert set(rows.tolist()) == {5, 6, 7}


def test_half_of_the_episodes_begin_in_the_bin_of_the_falls_and_the_two_before() -> None:
    starts = learned(WALK, fell_at=RATE * 6)

    seconds = anywhere(starts, WALK) / RATE

    before = ((seconds >= 5.0) & (seconds < 6.5)).mean()
    assert before == pytest.approx(0.5 + 0.5 * 0.15, abs=0.03)
    assert ((seconds >= 6.0) & (seconds < 6.5)).mean() > ((seconds >= 5.0) & (seconds < 5.5)).mean()
    others = seconds[(seconds < 5.0) | (seconds >= 6.5)]
    counts = np.histogram(others, [0, 1, 2, 3, 4, 5])[0] / len(seconds)
    assert counts == pytest.approx(0.05, abs=0.015), "all the others stay as likely as before"


def test_a_motion_that_wraps_falls_in_the_bin_of_its_cycle() -> None:
    later = learned(WALK, fell_at=RATE * (SECONDS + 6))
    seconds = anywhere(later, WALK) / RATE

    assert ((seconds >= 5.0) & (seconds < 6.5)).mean() > 0.5


def test_a_fall_at_the_beginning_is_told_of_the_end_of_a_motion_that_wraps() -> None:
    seconds = anywhere(learned(WALK, fell_at=0), WALK) / RATE

    assert ((seconds >= 9.0) | (seconds < 0.5)).mean() > 0.5


def test_a_fall_after_a_motion_that_ends_is_one_of_its_last_bin() -> None:
    starts = learned(KICK, fell_at=KICK.first + KICK.count + RATE // 2)

    seconds = (anywhere(starts, KICK) - KICK.first) / RATE

    assert (seconds >= 0.5).mean() > 0.8
    assert (seconds < 0.5).mean() == pytest.approx(0.5 * 0.25, abs=0.03)


def test_what_is_no_longer_lost_is_no_longer_hard() -> None:
    starts = learned(WALK, fell_at=RATE * 6)
    rows, no = visited(WALK)
    for _ in range(500):
        starts.learn(rows, no)
    fell = rows // RATE == 2
    for _ in range(20):
        starts.learn(rows, fell)

    seconds = anywhere(starts, WALK) / RATE

    assert ((seconds >= 5.0) & (seconds < 6.5)).mean() < 0.1
    assert ((seconds >= 1.0) & (seconds < 3.0)).mean() > 0.5


def test_each_reference_keeps_its_share_however_hard_one_is() -> None:
    """The falls of one change nothing in the others; rows are those of its own."""
    first, last = StartRange(0, RATE * 4, True), StartRange(RATE * 60, RATE * SECONDS, True)
    starts = Starts([first, KICK, last], RATE)
    for _ in range(100):
        for each in (first, KICK, last):
            starts.learn(*visited(each))
        starts.learn(np.array([last.first + RATE * (SECONDS + 6)]), np.array([True]))

    rows = starts.draw(DRAWS, np.random.default_rng(1))

    of_last = rows >= last.first
    of_kick = (rows >= KICK.first) & ~of_last
    assert of_last.mean() == pytest.approx(1.0 / 3.0, abs=0.02)
    assert of_kick.mean() == pytest.approx(1.0 / 3.0, abs=0.02)
    seconds = (rows[of_last] - last.first) / RATE
    assert ((seconds >= 5.0) & (seconds < 6.5)).mean() > 0.5
    counts = np.histogram(rows[of_kick], 4, (KICK.first, KICK.first + KICK.count))[0]
    anywhere_alike = 0.9 * 0.25
    expected = (anywhere_alike + 0.1, anywhere_alike, anywhere_alike, anywhere_alike)
    assert counts / of_kick.sum() == pytest.approx(expected, abs=0.02)


def learned(where: StartRange, fell_at: int) -> Starts:
    """Starts where every row was visited a hundred times, and each time one of them was lost."""
    starts = Starts([where], RATE)
    rows, no = visited(where)
    for _ in range(100):
        starts.learn(np.append(rows, fell_at), np.append(no, True))
    return starts


def visited(where: StartRange) -> tuple[IntArray, BoolArray]:
    """Decisions at all rows, none of which is lost."""
    return where.rows[::8], np.zeros(len(where.rows[::8]), dtype=np.bool_)
