"""Pushes wait for their tick, act as long as they should, and are taken whole or not at all."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msgs_config.arrays import FloatArray
from msgs_config.errors import CommandError
from sim_node.physics.wrenches import ExternalWrench, WrenchQueue
from tests.support.physics import FLOATING_TURNED_FRAMES, character

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


def acting(schedule: WrenchQueue, ticks: range) -> list[int]:
    """The ticks at which something acts."""
    return [tick for tick in ticks if schedule.take(tick)]


# When


def test_without_pushes_nothing_acts(schedule: WrenchQueue) -> None:
    assert acting(schedule, range(10)) == []


@pytest.mark.parametrize(("first_tick", "ticks"), [(1, 1), (5, 1), (5, 3), (9, 24)])
def test_a_push_acts_from_its_first_tick_for_its_number_of_ticks(
    schedule: WrenchQueue, first_tick: int, ticks: int
) -> None:
    push(schedule, ["hand"], first_tick=first_tick, ticks=ticks)

    assert acting(schedule, range(1, 50)) == list(range(first_tick, first_tick + ticks))


@pytest.mark.parametrize("tick", [4, 5, 6, 7, 8])
def test_a_push_says_itself_when_it_acts(tick: int) -> None:
    waiting = ExternalWrench(link=0, wrench=WRENCH, point=np.zeros(3), first_tick=5, ticks=3)

    assert waiting.acts_at(tick) == (tick in (5, 6, 7))


def test_taking_a_tick_again_gives_the_same_pushes(schedule: WrenchQueue) -> None:
    push(schedule, ["hand", "arm"], first_tick=5, ticks=2)

    first = schedule.take(5)

    assert len(first) == 2
    assert schedule.take(5) == first


def test_a_push_that_is_over_is_forgotten_and_never_comes_back(schedule: WrenchQueue) -> None:
    push(schedule, ["hand"], first_tick=5, ticks=2)

    assert schedule.take(7) == []
    assert schedule.take(5) == []  # a tick never comes again; what is over is gone


def test_a_push_of_the_far_future_waits(schedule: WrenchQueue) -> None:
    push(schedule, ["hand"], first_tick=10**15, ticks=3)

    assert acting(schedule, range(1000)) == []
    assert len(schedule.take(10**15 + 2)) == 1
    assert schedule.take(10**15 + 3) == []


def test_clearing_forgets_what_acts_and_what_waits(schedule: WrenchQueue) -> None:
    push(schedule, ["hand"], first_tick=1, ticks=100)
    push(schedule, ["arm"], first_tick=50)
    assert schedule.take(2)

    schedule.clear()

    assert acting(schedule, range(200)) == []


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


def test_several_pushes_on_one_link_all_act(schedule: WrenchQueue) -> None:
    push(schedule, ["hand", "hand"])
    push(schedule, ["hand"], first_tick=4, ticks=2)

    assert [len(schedule.take(tick)) for tick in (4, 5, 6)] == [1, 3, 0]


def test_pushes_are_kept_in_the_order_in_which_they_came(schedule: WrenchQueue) -> None:
    for name in ("wheel", "base", "hand"):
        push(schedule, [name], ticks=2)

    for tick in (5, 6):
        assert [NAMES[p.link] for p in schedule.take(tick)] == ["wheel", "base", "hand"]


# Refused


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("entry", range(6))
def test_a_wrench_that_is_not_finite_is_refused_by_link(
    schedule: WrenchQueue, number: float, entry: int
) -> None:
    wrenches = np.zeros((2, 6))
    wrenches[1, entry] = number

    with pytest.raises(CommandError, match="wrench on 'arm' is not finite"):
        push(schedule, ["hand", "arm"], wrenches)

    assert schedule.take(5) == []


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("entry", range(3))
def test_a_point_that_is_not_finite_is_refused_by_link(
    schedule: WrenchQueue, number: float, entry: int
) -> None:
    points = np.zeros((2, 3))
    points[0, entry] = number

    with pytest.raises(CommandError, match="point on 'hand' is not finite"):
        push(schedule, ["hand", "arm"], points=points)

    assert schedule.take(5) == []


@pytest.mark.parametrize(
    "names", [["tail"], ["hand", "tail"], ["tail", "hand"], ["shoulder"], [""]]
)
def test_an_unknown_link_refuses_all_and_lists_those_that_exist(
    schedule: WrenchQueue, names: list[str]
) -> None:
    with pytest.raises(CommandError, match=r"unknown link '.*base, arm, forearm"):
        push(schedule, names)

    assert schedule.take(5) == []


@pytest.mark.parametrize("count", [0, 1, 3])
def test_another_number_of_wrenches_than_of_links_is_refused(
    schedule: WrenchQueue, count: int
) -> None:
    with pytest.raises(CommandError, match=f"2 links but {count} wrenches"):
        push(schedule, ["hand", "arm"], np.zeros((count, 6)))

    assert schedule.take(5) == []


@pytest.mark.parametrize("count", [1, 3])
def test_another_number_of_points_than_of_links_is_refused(
    schedule: WrenchQueue, count: int
) -> None:
    with pytest.raises(CommandError, match=f"2 links but {count} transforms"):
        push(schedule, ["hand", "arm"], points=np.zeros((count, 3)))

    assert schedule.take(5) == []


def test_an_empty_push_is_refused(schedule: WrenchQueue) -> None:
    with pytest.raises(CommandError, match="empty"):
        push(schedule, [], np.zeros((0, 6)))


def test_a_refused_push_leaves_those_that_wait(schedule: WrenchQueue) -> None:
    push(schedule, ["hand"], ticks=2)

    with pytest.raises(CommandError):
        push(schedule, ["arm", "tail"])

    assert [NAMES[p.link] for p in schedule.take(5)] == ["hand"]


# How many


def test_so_many_pushes_may_wait_and_not_one_more(schedule: WrenchQueue) -> None:
    push(schedule, ["hand"] * (MOST_WAITING - 1))
    with pytest.raises(CommandError, match=f"more than {MOST_WAITING} pushes wait"):
        push(schedule, ["hand", "arm"])
    push(schedule, ["hand"])

    with pytest.raises(CommandError, match="wait"):
        push(schedule, ["hand"])

    assert len(schedule.take(5)) == MOST_WAITING


@pytest.mark.parametrize(
    "forget", [lambda s: s.take(6), lambda s: s.clear()], ids=["over", "clear"]
)
def test_what_is_forgotten_makes_room(schedule: WrenchQueue, forget: object) -> None:
    push(schedule, ["hand"] * MOST_WAITING)

    assert callable(forget)
    forget(schedule)
    push(schedule, ["hand"] * MOST_WAITING, first_tick=8)

    assert len(schedule.take(8)) == MOST_WAITING


# Whose arrays they are


def test_a_sender_cannot_change_its_push_afterwards(schedule: WrenchQueue) -> None:
    wrenches, points = np.ones((1, 6)), np.ones((1, 3))
    push(schedule, ["hand"], wrenches, points)

    wrenches[:], points[:] = 99.0, 99.0

    (waiting,) = schedule.take(5)
    np.testing.assert_array_equal(waiting.wrench, np.ones(6))
    np.testing.assert_array_equal(waiting.point, np.ones(3))
