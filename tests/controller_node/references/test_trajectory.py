"""Trajectories that replace a reference: closed forms, difference quotients, and no jump."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller_node.references.base import Reference
from controller_node.references.curve import Curve
from controller_node.references.hold import HoldReference
from controller_node.references.signals import SineReference
from controller_node.references.trajectory import (
    TrajectoryPoints,
    TrajectoryReference,
    points_of_lists,
)
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import ActuatedCharactersError, MotionError
from msgs_config.geometry import rotations
from tests.support.motion import (
    FLOATING,
    MOVED,
    Sample,
    assert_consistent,
    assert_moves_as_it_says,
    assert_same_motion,
    assert_same_place,
    loaded,
    random_knots,
)
from tests.support.physics import character, character_id

PANDA = character("franka_panda")
LAYOUT = PANDA.layout
START = 1.3  # s
TIMES = np.array([0.4, 1.0, 1.7])  # s after the start
INSTANT = 1e-9  # s
PAIR = ("panda_joint2", "panda_joint1")
COLUMNS = [LAYOUT.joint(name).start for name in PAIR]
DEGREES = [1, 3, 5]
PROPERTY = settings(max_examples=100, deadline=None)

every_moved = pytest.mark.parametrize("name", MOVED, ids=character_id)
every_degree = pytest.mark.parametrize("degree", DEGREES)


def swinging(whole: Character) -> Reference:
    """A reference that moves in every degree of freedom that has room for it."""
    lower, upper = whole.position_bounds()
    rest = np.array(whole.rest_position)
    room = np.minimum(rest - lower, upper - rest) > 0.05
    names = [name for name, has in zip(whole.layout.dof_names, room, strict=True) if has]
    return SineReference(whole, names, 0.05, 0.9)


def whole_points(whole: Character, degree: int, times: FloatArray = TIMES) -> TrajectoryPoints:
    """Random points of every degree of freedom, of no more than what makes this degree."""
    knots = random_knots(whole, times)
    assert knots.velocities is not None
    velocities = knots.velocities.copy()
    velocities[-1] = 0.0
    return TrajectoryPoints(
        whole.layout.dof_names,
        times,
        knots.configurations.position,
        velocities if degree > 1 else None,
        knots.accelerations if degree > 3 else None,
    )


def one_point(name: str, time: float, position: float) -> TrajectoryPoints:
    return TrajectoryPoints((name,), np.array([time]), np.array([[position]]))


def continuous(whole: Character, sample: Sample, time: float, atol: float = 1e-5) -> None:
    """Position, velocity and acceleration have no jump."""
    before, after = sample(time - INSTANT), sample(time + INSTANT)
    assert_same_motion(whole.layout, before, after, atol)


# The motion


def test_from_rest_to_one_point_it_is_the_quintic_from_rest_to_rest() -> None:
    reference = TrajectoryReference(PANDA, HoldReference(PANDA)).replaced(
        one_point("panda_joint1", 2.0, 0.7), START
    )
    begin = PANDA.rest_position[0]

    for s in (0.0, 0.2, 0.5, 0.83, 1.0):
        state = reference.sample(START + 2.0 * s)
        share = 10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5
        expected = np.array(PANDA.rest_position)
        expected[0] = begin + (0.7 - begin) * share
        np.testing.assert_allclose(state.configuration.position, expected, atol=1e-12)


@every_degree
@every_moved
def test_velocity_and_acceleration_are_the_difference_quotients(name: str, degree: int) -> None:
    whole, layout = loaded(name)
    reference = TrajectoryReference(whole, swinging(whole)).replaced(
        whole_points(whole, degree), START
    )
    times = np.random.default_rng(6).uniform(START - 1.0, START + 2.0, 40)
    knots = START + np.array([0.0, *TIMES])
    times = times[np.abs(times[:, np.newaxis] - knots).min(axis=1) > 1e-3]

    assert_moves_as_it_says(layout, reference.sample, times.tolist())


@every_degree
@every_moved
def test_nothing_jumps_at_the_start_nor_where_the_points_begin(name: str, degree: int) -> None:
    whole, _ = loaded(name)
    reference = TrajectoryReference(whole, swinging(whole)).replaced(
        whole_points(whole, degree), START
    )

    continuous(whole, reference.sample, START)
    continuous(whole, reference.sample, START + 0.4)


@every_degree
@every_moved
def test_it_goes_through_the_points_and_rests_after_the_last(name: str, degree: int) -> None:
    whole, layout = loaded(name)
    points = whole_points(whole, degree)
    reference = TrajectoryReference(whole, swinging(whole)).replaced(points, START)

    for time, position in zip(points.times.tolist(), points.positions, strict=True):
        state = reference.sample(START + time)
        apart = layout.difference(state.configuration, layout.configuration(position))
        np.testing.assert_allclose(apart, 0.0, atol=1e-9)
        assert_consistent(layout, state)
    for time in (1.7 + INSTANT, 2.0, 1e6):
        state = reference.sample(START + time)
        apart = layout.difference(state.configuration, layout.configuration(points.positions[-1]))
        np.testing.assert_allclose(apart, 0.0, atol=1e-12)
        np.testing.assert_array_equal(state.velocity, 0.0)
        np.testing.assert_array_equal(state.acceleration, 0.0)


@pytest.mark.parametrize("degree", [3, 5])
@every_moved
def test_at_the_points_it_moves_as_they_say(name: str, degree: int) -> None:
    whole, _ = loaded(name)
    points = whole_points(whole, degree)
    reference = TrajectoryReference(whole, swinging(whole)).replaced(points, START)
    assert points.velocities is not None

    for number, time in enumerate(TIMES.tolist()):
        for at in (time - INSTANT, time + INSTANT):
            state = reference.sample(START + at)
            np.testing.assert_allclose(state.velocity, points.velocities[number], atol=1e-5)
            if points.accelerations is not None and (number < 2 or at < time):
                expected = points.accelerations[number]
                np.testing.assert_allclose(state.acceleration, expected, atol=1e-3)


@pytest.mark.parametrize("name", ["franka_panda", *FLOATING], ids=character_id)
def test_what_is_not_named_comes_to_rest_where_it_is_at_the_start(name: str) -> None:
    whole, layout = loaded(name)
    before = swinging(whole)
    dof = next(joint.name for joint in layout.joints if len(joint.dof_names) == 1)
    index = layout.dof_names.index(dof)
    lower, upper = whole.position_bounds()
    target = np.clip(whole.rest_position[index] + 0.01, lower[index], upper[index])
    points = TrajectoryPoints((dof,), np.array([0.5, 0.9]), np.array([[target], [target]]))

    reference = TrajectoryReference(whole, before).replaced(points, START)

    there = before.sample(START)
    assert np.abs(there.velocity).max() > 0.1
    continuous(whole, reference.sample, START)
    others = np.arange(layout.size) != index
    for time in (0.5, 0.6, 0.9, 7.0):
        state = reference.sample(START + time)
        apart = layout.difference(there.configuration, state.configuration)
        np.testing.assert_allclose(apart[others], 0.0, atol=1e-9)
        np.testing.assert_allclose(state.velocity[others], 0.0, atol=1e-9)
        np.testing.assert_allclose(state.acceleration[others], 0.0, atol=1e-8)


def test_the_order_of_the_names_is_the_senders() -> None:
    points = TrajectoryPoints(PAIR, np.array([1.0]), np.array([[0.25, -0.5]]))

    state = TrajectoryReference(PANDA, HoldReference(PANDA)).replaced(points, 0.0).sample(1.0)

    position = state.configuration.position
    assert position[LAYOUT.joint("panda_joint2").start] == 0.25
    assert position[LAYOUT.joint("panda_joint1").start] == -0.5


# One after the other


@every_moved
def test_before_its_start_what_was_there_before_stays(name: str) -> None:
    whole, layout = loaded(name)
    before = swinging(whole)
    first = TrajectoryReference(whole, before).replaced(whole_points(whole, 5), START)
    second = first.replaced(whole_points(whole, 1), START + 0.7)

    for time in (0.0, 0.9, START - 1e-6):
        assert_same_motion(layout, first.sample(time), before.sample(time), atol=1e-15)
    for time in (START, START + 0.3, START + 0.7 - 1e-6):
        assert_same_motion(layout, second.sample(time), first.sample(time), atol=1e-15)
    continuous(whole, second.sample, START + 0.7)


def test_one_that_starts_earlier_than_the_present_one_takes_its_place() -> None:
    before = swinging(PANDA)
    later = TrajectoryReference(PANDA, before).replaced(one_point("panda_joint1", 1.0, 0.5), 5.0)

    for start in (3.0, 5.0):
        reference = later.replaced(one_point("panda_joint1", 1.0, -0.5), start)

        for time in (0.0, 2.9, start - 1e-6):
            assert_same_motion(LAYOUT, reference.sample(time), before.sample(time), atol=1e-15)
        continuous(PANDA, reference.sample, start)
        assert reference.sample(start + 5.0).configuration.position[0] == -0.5


def test_what_lies_before_the_present_start_is_forgotten() -> None:
    reference = TrajectoryReference(PANDA, HoldReference(PANDA))
    curves: list[weakref.ref[Curve]] = []
    for number in range(30):
        target = 0.1 * (-1.0) ** number
        reference = reference.replaced(one_point("panda_joint1", 0.5, target), 0.1 * number)
        assert reference.curve is not None
        curves.append(weakref.ref(reference.curve))

    gc.collect()

    assert [curve() is not None for curve in curves] == [False] * 28 + [True] * 2
    continuous(PANDA, reference.sample, 2.9)


def test_two_that_are_yet_to_begin_leave_the_present_as_it_is() -> None:
    before = swinging(PANDA)
    first = TrajectoryReference(PANDA, before).replaced(
        one_point("panda_joint1", 1.0, 0.5), 2.5, now=0.3
    )

    second = first.replaced(one_point("panda_joint1", 1.0, -0.5), 4.0, now=0.3)

    for time in (0.3, 1.7, 2.5 - 1e-6):
        assert_same_motion(LAYOUT, second.sample(time), before.sample(time), atol=1e-15)
    for time in (2.5, 3.1, 4.0 - 1e-6):
        assert_same_motion(LAYOUT, second.sample(time), first.sample(time), atol=1e-15)
    for start in (2.5, 4.0):
        continuous(PANDA, second.sample, start)


def test_not_any_number_of_them_may_wait() -> None:
    reference = TrajectoryReference(PANDA, HoldReference(PANDA))

    with pytest.raises(MotionError, match="more than 100 are yet to begin"):
        for number in range(1000):
            later = one_point("panda_joint1", 0.5, 0.1)
            reference = reference.replaced(later, 1.0 + number, now=0.0)

    assert reference.sample(2000.0).configuration.position[0] == 0.1


# A first point at time 0


@every_degree
@every_moved
def test_a_first_point_at_time_0_stands_for_where_the_reference_is(name: str, degree: int) -> None:
    whole, layout = loaded(name)
    before = swinging(whole)
    points = whole_points(whole, degree, np.array([0.0, 0.6, 1.2]))
    here = before.sample(START)
    positions = points.positions.copy()
    positions[0] = here.configuration.position + 5e-4
    points = replace(points, positions=np.clip(positions, *whole.position_bounds()))

    reference = TrajectoryReference(whole, before).replaced(points, START)

    assert_same_place(layout, reference.sample(START), here)
    continuous(whole, reference.sample, START)
    continuous(whole, reference.sample, START + 0.6)


def test_a_first_point_at_time_0_elsewhere_is_refused_with_the_distance() -> None:
    reference = TrajectoryReference(PANDA, HoldReference(PANDA))
    here = np.array(PANDA.rest_position)[COLUMNS]
    positions = np.array([here + np.array([0.0, 0.02]), here])
    points = TrajectoryPoints(PAIR, np.array([0.0, 1.0]), positions)

    with pytest.raises(MotionError, match=r"point 1 .* 'panda_joint1' is 0.02 rad away.* 0.001"):
        reference.replaced(points, START)


def test_the_distance_of_a_root_is_in_its_own_unit() -> None:
    whole, layout = loaded("humanoid")
    names = layout.joint("root").dof_names
    for column, distance in ((2, "0.3 m"), (3, "0.3 rad")):
        positions = np.tile(np.array(whole.rest_position)[:6], (2, 1))
        turn = layout.configuration(np.array(whole.rest_position)).orientations_xyzw[0]
        offset = np.zeros(6)
        offset[column] = 0.3
        positions[0, :3] += offset[:3]
        positions[0, 3:] = rotations.log(rotations.multiply(turn, rotations.exp(offset[3:])))
        points = TrajectoryPoints(names, np.array([0.0, 1.0]), positions)

        with pytest.raises(MotionError, match=f"'{names[column]}' is {distance} away"):
            TrajectoryReference(whole, HoldReference(whole)).replaced(points, 0.0)


# What is refused

NAN = float("nan")
GOOD = TrajectoryPoints(PAIR, np.array([1.0, 2.0]), np.zeros((2, 2)))
REFUSED: dict[str, tuple[TrajectoryPoints, list[str]]] = {
    "no points": (
        TrajectoryPoints(PAIR, np.zeros(0), np.zeros((0, 2))),
        ["no points", "one or more"],
    ),
    "a million points": (
        TrajectoryPoints(PAIR, np.arange(1, 1_000_001) * 0.01, np.zeros((1_000_000, 2))),
        ["it has 1000000 points; it must have 10000 or fewer"],
    ),
    "unknown": (
        replace(GOOD, dof_names=("panda_joint11", "panda_joint2")),
        ["'panda_joint11'", "did you mean 'panda_joint1'"],
    ),
    "repeated": (replace(GOOD, dof_names=("panda_joint1",) * 2), ["'panda_joint1'", "twice"]),
    "unsorted": (replace(GOOD, times=np.array([2.0, 1.0])), ["point 2 is at 1 s", "2 s"]),
    "same time": (replace(GOOD, times=np.array([1.0, 1.0])), ["point 2 is at 1 s", "later"]),
    "negative time": (replace(GOOD, times=np.array([-1.0, 1.0])), ["point 1 is at -1 s", "from 0"]),
    "time nan": (replace(GOOD, times=np.array([1.0, NAN])), ["point 2 is at nan s"]),
    "time far off": (replace(GOOD, times=np.array([1.0, 1e7])), ["point 2 is at 1e+07 s"]),
    "no duration": (
        TrajectoryPoints(PAIR, np.zeros(1), np.zeros((1, 2))),
        ["last point is at 0 s", "later than the start"],
    ),
    "position nan": (
        replace(GOOD, positions=np.array([[0.0, 0.0], [0.0, NAN]])),
        ["point 2", "position of 'panda_joint1' is nan"],
    ),
    "velocity infinite": (
        replace(GOOD, velocities=np.array([[-np.inf, 0.0], [0.0, 0.0]])),
        ["point 1", "velocity of 'panda_joint2' is -inf"],
    ),
    "acceleration huge": (
        replace(GOOD, velocities=np.zeros((2, 2)), accelerations=np.full((2, 2), 1e300)),
        ["point 1", "acceleration of 'panda_joint2' is 1e+300"],
    ),
    "accelerations alone": (
        replace(GOOD, accelerations=np.zeros((2, 2))),
        ["accelerations without velocities"],
    ),
    "beyond limits": (
        replace(GOOD, positions=np.array([[0.0, 0.0], [0.0, -3.5]])),
        ["point 2", "'panda_joint1' is -3.5", "limits", "rad"],
    ),
    "moving end": (
        replace(GOOD, velocities=np.array([[0.5, 0.5], [0.0, 0.5]])),
        ["last point's velocity of 'panda_joint1' is 0.5", "must be 0"],
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_points_that_are_wrong_are_refused_with_what_would_be_right(case: str) -> None:
    points, words = REFUSED[case]

    with pytest.raises(MotionError) as caught:
        TrajectoryReference(PANDA, HoldReference(PANDA)).replaced(points, START)

    line = str(caught.value)
    assert line.startswith("trajectory: ") and "\n" not in line
    for word in words:
        assert word in line, line


def test_a_ball_joint_in_parts_is_refused() -> None:
    whole, _ = loaded("humanoid")
    points = TrajectoryPoints(("chest_x", "chest_y"), np.array([1.0]), np.zeros((1, 2)))

    with pytest.raises(MotionError, match="'chest' comes in parts: 'chest_z' is missing"):
        TrajectoryReference(whole, HoldReference(whole)).replaced(points, START)


def test_a_messages_lists_become_arrays() -> None:
    points = points_of_lists(PAIR, [1.0, 2.0], [[1, 2], [3, 4]], [[5, 6], [7, 8]], [[], []])

    assert points.dof_names == PAIR
    np.testing.assert_array_equal(points.times, [1.0, 2.0])
    np.testing.assert_array_equal(points.positions, [[1.0, 2.0], [3.0, 4.0]])
    np.testing.assert_array_equal(points.velocities, [[5.0, 6.0], [7.0, 8.0]])
    assert points.accelerations is None


@pytest.mark.parametrize(
    ("lists", "words"),
    [
        (([[], []], [], []), "point 1 has no positions"),
        (([[1.0, 2.0], [1.0]], [], []), "point 2 has 1 positions; it must have 2"),
        (([[1.0, 2.0], []], [], []), "point 2 has 0 positions; it must have 2"),
        (([[0, 0], [0, 0]], [[1.0, 2.0], []], []), "point 2 has 0 velocities; it must have 2"),
        (([[0, 0], [0, 0]], [], [[], [1, 2, 3]]), "point 1 has 0 accelerations; it must have 2"),
    ],
)
def test_lists_that_differ_from_point_to_point_are_refused(
    lists: tuple[list[list[float]], ...], words: str
) -> None:
    with pytest.raises(MotionError, match=words):
        points_of_lists(PAIR, [1.0, 2.0], *lists)
    with pytest.raises(MotionError, match="it names no degree of freedom"):
        points_of_lists([], [1.0, 2.0], *lists)


NUMBERS = st.one_of(st.floats(-1.0, 1.0), st.floats())


@st.composite
def any_points(draw: st.DrawFn) -> TrajectoryPoints:
    """Points of any length and any numbers, some of them good."""
    names = draw(st.lists(st.sampled_from([*PAIR, "panda_joint5", "no"]), min_size=1, max_size=3))
    count = draw(st.integers(0, 3))

    def rows() -> FloatArray:
        width = len(names)
        numbers = draw(st.lists(NUMBERS, min_size=count * width, max_size=count * width))
        return np.array(numbers, dtype=float).reshape(count, width)

    spacing = draw(
        st.lists(st.one_of(st.floats(1e-3, 2.0), NUMBERS), min_size=count, max_size=count)
    )
    with np.errstate(all="ignore"):
        times = np.cumsum(np.array(spacing, dtype=float))
    still = np.zeros((count, len(names)))
    velocities = draw(st.sampled_from([None, still, rows()]))
    accelerations = draw(st.sampled_from([None, still, rows()]))
    return TrajectoryPoints(tuple(names), times, rows(), velocities, accelerations)


@PROPERTY
@given(any_points())
def test_whatever_the_points_they_are_refused_in_one_line_or_followed(
    points: TrajectoryPoints,
) -> None:
    reference = TrajectoryReference(PANDA, swinging(PANDA))
    try:
        reference = reference.replaced(points, START)
    except ActuatedCharactersError as error:
        assert isinstance(error, MotionError) and "\n" not in str(error)
        return
    end = reference.sample(START + float(points.times[-1]))
    indices = [LAYOUT.dof_names.index(name) for name in points.dof_names]
    np.testing.assert_allclose(
        end.configuration.position[indices], points.positions[-1], atol=1e-12
    )
    for time in (START, START + 0.5 * float(points.times[0]), START + 1.0):
        state = reference.sample(time)
        for array in (state.configuration.position, state.velocity, state.acceleration):
            assert np.isfinite(array).all()
