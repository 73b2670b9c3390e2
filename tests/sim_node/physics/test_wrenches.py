"""Pushes wait for their tick, act as long as they should, and are taken whole or not at all."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msgs_config.arrays import FloatArray
from msgs_config.errors import CommandError
from sim_node.physics.wrenches import WrenchQueue
from tests.support.physics import FLOATING_TURNED_FRAMES, character

pytestmark = pytest.mark.usefixtures("engine")

PROPERTY = settings(max_examples=80, deadline=None)
MOST_WAITING = 10_000

WHOLE = character(FLOATING_TURNED_FRAMES)
NAMES = [link.name for link in WHOLE.links]
NO_POINTS = np.zeros((0, 3))
WRENCH = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])


@pytest.fixture
def schedule() -> WrenchQueue:
    return WrenchQueue(WHOLE)


def push(
    schedule: WrenchQueue,
    names: Sequence[str],
    wrenches: FloatArray | None = None,
    points: FloatArray = NO_POINTS,
    first_tick: int = 5,
    ticks: int = 1,
) -> None:
    """Add pushes; by default the same wrench on each link."""
    if wrenches is None:
        wrenches = np.tile(WRENCH, (len(names), 1))
    schedule.add(names, wrenches, points, first_tick=first_tick, ticks=ticks)


# When


def test_taking_a_tick_again_gives_the_same_pushes(schedule: WrenchQueue) -> None:
    push(schedule, ["hand", "arm"], first_tick=5, ticks=2)

    first = schedule.take(5)

    assert len(first) == 2
    assert schedule.take(5) == first


def test_a_push_that_is_over_is_forgotten_and_never_comes_back(schedule: WrenchQueue) -> None:
    push(schedule, ["hand"], first_tick=5, ticks=2)

    assert schedule.take(7) == []
    assert schedule.take(5) == []  # a tick never comes again; what is over is gone


def test_clearing_forgets_what_acts_and_what_waits(schedule: WrenchQueue) -> None:
    push(schedule, ["hand"], first_tick=1, ticks=100)
    push(schedule, ["arm"], first_tick=50)
    assert schedule.take(2)

    schedule.clear()

    assert not any(schedule.take(tick) for tick in range(200))


@PROPERTY
@given(st.lists(st.tuples(st.integers(1, 30), st.integers(1, 10)), max_size=12))
def test_every_push_acts_in_its_own_time_whatever_else_waits(spans: list[tuple[int, int]]) -> None:
    schedule = WrenchQueue(WHOLE)
    for number, (first_tick, ticks) in enumerate(spans):
        push(schedule, ["hand"], np.full((1, 6), float(number)), NO_POINTS, first_tick, ticks)

    taken = {tick: [int(p.wrench[0]) for p in schedule.take(tick)] for tick in range(1, 45)}

    assert taken == {
        tick: [i for i, (first, ticks) in enumerate(spans) if first <= tick < first + ticks]
        for tick in range(1, 45)
    }


# Where and how much


def test_a_push_knows_its_link_its_wrench_and_its_point(schedule: WrenchQueue) -> None:
    wrenches, points = np.arange(18.0).reshape(3, 6), 0.1 * np.arange(9.0).reshape(3, 3)

    push(schedule, ["hand", "base", "wheel"], wrenches, points)
    pushes = schedule.take(5)

    assert [NAMES[p.link] for p in pushes] == ["hand", "base", "wheel"]
    np.testing.assert_array_equal([p.wrench for p in pushes], wrenches)
    np.testing.assert_array_equal([p.point for p in pushes], points)


def test_without_points_a_push_acts_at_the_links_centre_of_mass(schedule: WrenchQueue) -> None:
    push(schedule, NAMES)

    for pushed, link in zip(schedule.take(5), WHOLE.links, strict=True):
        np.testing.assert_array_equal(pushed.point, link.inertial_pose.position)


# Refused

TWO = np.zeros((2, 6))
NOT_FINITE = np.array([np.nan, np.inf, -np.inf])
REFUSED: dict[str, tuple[list[str], FloatArray, FloatArray, str]] = {
    "an unknown link": (
        ["hand", "tail"],
        TWO,
        NO_POINTS,
        "unknown link 'tail'.*base, arm, forearm",
    ),
    "no name": ([""], TWO[:1], NO_POINTS, "unknown link ''"),
    "no wrench": (["hand", "arm"], TWO[:0], NO_POINTS, "2 links but 0 wrenches"),
    "more wrenches": (["hand", "arm"], np.zeros((3, 6)), NO_POINTS, "2 links but 3 wrenches"),
    "fewer points": (["hand", "arm"], TWO, np.zeros((1, 3)), "2 links but 1 transforms"),
    "more points": (["hand", "arm"], TWO, np.zeros((3, 3)), "2 links but 3 transforms"),
    "nothing": ([], TWO[:0], NO_POINTS, "empty"),
    **{
        f"{number} in entry {entry} of a wrench": (
            ["hand", "arm"],
            np.stack((np.zeros(6), np.where(np.arange(6) == entry, number, 0.0))),
            NO_POINTS,
            "wrench on 'arm' is not finite",
        )
        for number in NOT_FINITE
        for entry in range(6)
    },
    **{
        f"{number} in entry {entry} of a point": (
            ["hand", "arm"],
            TWO,
            np.stack((np.where(np.arange(3) == entry, number, 0.0), np.zeros(3))),
            "point on 'hand' is not finite",
        )
        for number in NOT_FINITE
        for entry in range(3)
    },
}


@pytest.mark.parametrize("wrong", REFUSED)
def test_a_wrong_push_is_refused_whole_and_leaves_those_that_wait(
    schedule: WrenchQueue, wrong: str
) -> None:
    names, wrenches, points, why = REFUSED[wrong]
    push(schedule, ["wheel"])

    with pytest.raises(CommandError, match=why):
        push(schedule, names, wrenches, points)

    assert [NAMES[p.link] for p in schedule.take(5)] == ["wheel"]


# How many


def test_so_many_pushes_may_wait_and_not_one_more(schedule: WrenchQueue) -> None:
    push(schedule, ["hand"] * (MOST_WAITING - 1))
    with pytest.raises(CommandError, match=f"more than {MOST_WAITING} pushes wait"):
        push(schedule, ["hand", "arm"])
    push(schedule, ["hand"])

    with pytest.raises(CommandError, match="wait"):
        push(schedule, ["hand"])

    assert len(schedule.take(5)) == MOST_WAITING


@pytest.mark.parametrize("clear", [lambda s: s.take(6), lambda s: s.clear()], ids=["over", "clear"])
def test_what_is_forgotten_makes_room(schedule: WrenchQueue, clear: object) -> None:
    push(schedule, ["hand"] * MOST_WAITING)

    assert callable(clear)
    clear(schedule)
    push(schedule, ["hand"] * MOST_WAITING, first_tick=8)

    assert len(schedule.take(8)) == MOST_WAITING


# Whose arrays they are


def test_a_sender_cannot_change_its_push_afterwards(schedule: WrenchQueue) -> None:
    wrenches, points = np.ones((1, 6)), np.ones((1, 3))
    push(schedule, ["hand"], wrenches, points)

    wrenches[:], points[:] = 99.0, 99.0

    (queued,) = schedule.take(5)
    np.testing.assert_array_equal(queued.wrench, np.ones(6))
    np.testing.assert_array_equal(queued.point, np.ones(3))
