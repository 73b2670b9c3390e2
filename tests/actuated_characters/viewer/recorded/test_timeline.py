"""The time line: where it is after playing, steps and jumps, and which state that is."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from actuated_characters.viewer.recorded.timeline import Playback, frame_times, row_at

TIMES = np.arange(241) / 240.0  # one second


def playing(speed: float = 1.0, **fields: object) -> Playback:
    timeline = Playback(TIMES)
    timeline.speed = speed
    for name, value in fields.items():
        setattr(timeline, name, value)
    timeline.play()
    return timeline


@given(st.floats(0.0, 1.0))
def test_a_time_shows_the_last_state_that_is_not_after_it(time: float) -> None:
    row = row_at(TIMES, time)

    assert TIMES[row] <= time + 1e-8
    assert row == 240 or TIMES[row + 1] > time


@pytest.mark.parametrize("row", [0, 1, 7, 100, 240])
def test_each_state_is_shown_at_its_own_time(row: int) -> None:
    timeline = Playback(TIMES)
    timeline.seek(float(TIMES[row]))
    assert timeline.row == row


@given(st.floats(-1.0, 2.0))
def test_where_a_hand_points_the_nearest_state_is_shown(time: float) -> None:
    timeline = Playback(TIMES)
    timeline.seek_nearest(time)
    assert abs(timeline.time - time) == pytest.approx(np.abs(TIMES - time).min(), abs=1e-12)


@pytest.mark.parametrize(("speed", "row"), [(1.0, 60), (0.1, 6), (2.0, 120)])
def test_it_plays_at_its_speed(speed: float, row: int) -> None:
    timeline = playing(speed)
    for _ in range(25):
        timeline.advance(0.01)
    assert timeline.row == row


def test_it_stands_until_it_is_played_and_at_its_end() -> None:
    timeline = Playback(TIMES)
    timeline.advance(0.5)
    assert timeline.row == 0

    timeline.play()
    timeline.advance(5.0)
    assert (timeline.row, timeline.plays) == (240, False)

    timeline.play()
    assert (timeline.row, timeline.plays) == (0, True)


def test_it_plays_on_from_a_time_also_from_the_end() -> None:
    timeline = Playback(TIMES)
    timeline.play_from(0.5)
    timeline.advance(0.25)
    assert (timeline.row, timeline.plays) == (180, True)

    timeline.play_from(1.0)
    assert (timeline.row, timeline.plays) == (240, True)
    timeline.advance(0.01)
    assert (timeline.row, timeline.plays) == (240, False)


def test_a_loop_begins_again_where_the_time_is() -> None:
    timeline = playing(loops=True)
    timeline.advance(2.25)
    assert (timeline.row, timeline.plays) == (60, True)


def test_steps_are_single_states_within_the_run() -> None:
    timeline = playing()
    timeline.step(1)
    assert (timeline.row, timeline.plays) == (1, False)
    timeline.step(-5)
    assert timeline.row == 0
    timeline.seek(9.0)
    timeline.step(1)
    assert (timeline.row, timeline.time) == (240, 1.0)


def test_the_frames_of_a_film_are_evenly_apart_and_include_both_ends() -> None:
    assert frame_times(0.5, 1.0, 0.1) == pytest.approx([0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
    assert frame_times(0.5, 0.5, 0.1) == [0.5]
