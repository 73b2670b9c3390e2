"""The inputs that a fork repeats: with them the simulator's queue acts as it was recorded."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from actuated_characters.bags.recording import Recording, read_recording
from actuated_characters.fork.inputs import ForkPoint, begun_pushes, recorded_stops
from msgs_config.errors import RecordingError
from msgs_config.messages.throw import ProjectileThrow
from msgs_config.messages.wrenches import WrenchArrays
from sim_node.physics.wrenches import ExternalWrench, WrenchQueue
from tests.support.eventful import eventful_run, write_timed
from tests.support.recordings import with_parameters

RATE, TICKS, HELD = 240, 60, 5  # Hz; ticks that a push is held


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A humanoid for a quarter of a second, with a reset in its middle."""
    run = eventful_run("humanoid", TICKS, reset_after=TICKS // 2)
    bag = write_timed(tmp_path_factory.mktemp("bag") / "bag", run.messages())
    return with_parameters(read_recording(bag), wrench_duration=HELD / RATE)


def pushed(recording: Recording, acting: Sequence[Sequence[ExternalWrench]]) -> Recording:
    """With pushes that acted in each tick."""
    names = [link.name for link in recording.character.links]
    applied = tuple(
        WrenchArrays.of_rows(
            int(stamp_ns),
            [names[push.link] for push in pushes],
            [push.wrench for push in pushes],
            [push.point for push in pushes],
        )
        for stamp_ns, pushes in zip(recording.stamps_ns[1:], acting, strict=True)
    )
    return replace(recording, applied_wrench=applied)


def queue_of(
    recording: Recording, pushes: Sequence[tuple[int, str, np.ndarray, np.ndarray]]
) -> WrenchQueue:
    """The simulator's queue with pushes in the order in which they came: row, link, and so on."""
    queue = WrenchQueue(recording.character)
    for row, link, wrench, point in pushes:
        queue.add([link], wrench[None], point[None], first_tick=row, ticks=HELD)
    return queue


@pytest.mark.parametrize("in_time", [True, False], ids=["in time", "in any order"])
@pytest.mark.parametrize("seed", range(10))
def test_overlapping_pushes_act_again_in_their_order(
    recording: Recording, seed: int, in_time: bool
) -> None:
    rng = np.random.default_rng(seed)
    links = [link.name for link in recording.character.links][:3]
    different = 2 if in_time else 40  # equal ones cannot be told apart if the later came first
    wrenches, points = rng.normal(size=(different, 6)), rng.normal(size=(2, 3))
    rows = rng.integers(0, TICKS, 40)
    sent = [
        (int(row), links[rng.integers(3)], wrenches[number % different], points[rng.integers(2)])
        for number, row in enumerate(np.sort(rows) if in_time else rows)
    ]
    queue = queue_of(recording, sent)
    acting = [queue.take(row) for row in range(TICKS)]

    found = begun_pushes(pushed(recording, acting), 0, TICKS)

    again = queue_of(
        recording,
        [(row, p.link, np.array(p.wrench), np.array(p.point)) for row, p in found],
    )
    for row, recorded in enumerate(acting):
        assert list(map(content, again.take(row))) == list(map(content, recorded))


def content(push: ExternalWrench) -> tuple[int, bytes, bytes]:
    return push.link, push.wrench.tobytes(), push.point.tobytes()


def test_a_push_that_was_shorter_is_refused(recording: Recording) -> None:
    push = ExternalWrench(1, np.ones(6), np.zeros(3), 10, HELD)
    acting = [[push] if 10 <= row < 12 else [] for row in range(TICKS)]

    with pytest.raises(RecordingError, match=r"at 0\.0416667 s ended at 0\.05 s, before"):
        begun_pushes(pushed(recording, acting), 0, TICKS)


def test_inputs_wait_for_their_episode(recording: Recording) -> None:
    reset, ball = TICKS // 2 + 1, ProjectileThrow(1.0, 0.1, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    push = ExternalWrench(1, np.ones(6), np.zeros(3), 0, HELD)
    cut_short = {*range(reset - 3, reset - 1), *range(reset + 4, reset + 4 + HELD)}
    acting = [[push] if row in cut_short else [] for row in range(TICKS)]
    throws = tuple((ball,) if row == reset + 9 else () for row in range(TICKS))
    full = replace(pushed(recording, acting), throws=throws)

    stops = recorded_stops(full, ForkPoint(reset + 4, TICKS, with_later=True))
    until = recorded_stops(full, ForkPoint(reset + 4, TICKS, with_later=False))

    assert sorted(stops) == [1, reset, reset + 1]
    assert stops[reset].resets
    (early,), (late,) = stops[1].pushes, stops[reset + 1].pushes
    assert (
        early.stamp_ns == full.stamps_ns[reset - 3] and late.stamp_ns == full.stamps_ns[reset + 4]
    )
    assert [throw.stamp_ns for throw in stops[reset + 1].throws] == [full.stamps_ns[reset + 9]]
    assert sorted(until) == [1, reset]
