"""Feet of a steered reference: those on the ground stay, the others come down where they should."""

import math
from functools import cache

import numpy as np
import pytest

from controller_node.references.clip import ClipReference
from controller_node.references.steering.reference import SteeredReference
from controller_node.references.steering.stepping import Stepping
from controller_node.references.steering.velocity import VelocityCommand
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.lowest_points import lowest_heights
from msgs_config.clips.reading import read_clip
from tests.controller_node.references.steering.test_reference import LASTING, RATE, make, steer
from tests.support.physics import character

HUMANOID = character("humanoid")
FEET = [[link.name for link in HUMANOID.links].index(name) for name in HUMANOID.feet]
WALK = 0.978  # m/s, the captured walk's speed
CAPTURED_SLIDE = 0.2  # m/s, the mean of the captured walk's ankles while they stand
BEYOND_WALK = {
    "in a bend": (1.0, 0.0, 0.8),
    "on the spot": (0.0, 0.0, 1.0),
    "aside": (0.0, 0.3, 0.0),
    "back": (-0.5, 0.0, 0.0),
    "slow": (0.2, 0.0, 0.0),
    "all at once": (0.4, -0.2, 0.5),
}


@cache
def driven(*velocity: float) -> SteeredReference:
    return steer(make(**LASTING), VelocityCommand(0, *velocity))


def feet_of(reference: SteeredReference, tick: int) -> tuple[FloatArray, FloatArray]:
    """Places (f, 3) of the ankles and heights (f,) of the soles, m, by MuJoCo's kinematics."""
    model = DynamicsModel(HUMANOID)
    position = reference.sample(tick / RATE).configuration.position
    model.update(position, np.zeros(HUMANOID.layout.size))
    return model.link_poses()[0][FEET], lowest_heights(HUMANOID, model)[FEET]


def stands(reference: SteeredReference, tick: int) -> list[bool]:
    course, gait = reference.course(tick), reference._gait
    cycles = gait.foot_cycles(course.pace)
    return [cycle.swung(course.phase, course.is_backward) == 0.0 for cycle in cycles]


@cache
def mean_slide(reference: SteeredReference) -> float:
    """Mean speed over the ground of feet that stand, m/s."""
    found = []
    for tick in range(4 * RATE, 6 * RATE, 7):
        here, there = feet_of(reference, tick)[0], feet_of(reference, tick + 1)[0]
        still = np.array(stands(reference, tick)) & np.array(stands(reference, tick + 1))
        found += (RATE * np.linalg.norm((there - here)[:, :2], axis=1))[still].tolist()
    return float(np.mean(found))


def test_straight_ahead_at_its_own_speed_the_walk_is_the_captured_one() -> None:
    reference = driven(WALK)
    frames = read_clip(HUMANOID, "walk")
    clip = ClipReference(HUMANOID.layout, frames)

    for tick in range(6 * RATE, 8 * RATE, 31):
        course, found = reference.course(tick), reference.sample(tick / RATE).configuration
        captured = clip.sample(course.phase * float(frames.times[-1])).configuration
        knees = [HUMANOID.layout.joint(f"{side}_knee").start for side in ("left", "right")]
        assert found.position[knees] == pytest.approx(captured.position[knees], abs=0.05)
        assert reference.course(tick).pace == pytest.approx(WALK)


@pytest.mark.parametrize("velocity", BEYOND_WALK.values(), ids=BEYOND_WALK)
def test_feet_that_stand_slide_no_more_than_captured_ones(
    velocity: tuple[float, float, float],
) -> None:
    captured = mean_slide(driven(WALK))
    assert captured == pytest.approx(CAPTURED_SLIDE, abs=0.03)
    assert mean_slide(driven(*velocity)) < captured + 0.03


@pytest.mark.parametrize("velocity", BEYOND_WALK.values(), ids=BEYOND_WALK)
def test_each_foot_is_lifted_in_turn(velocity: tuple[float, float, float]) -> None:
    reference = driven(*velocity)

    heights = np.array([feet_of(reference, tick)[1] for tick in range(4 * RATE, 6 * RATE, 5)])
    assert heights.min() > -0.01
    assert (heights.max(axis=0) > 0.04).all()
    assert (heights.min(axis=1) < 0.02).all()  # one is on the ground


def test_feet_do_not_meet_while_it_goes_aside() -> None:
    reference = driven(0.0, 0.3, 0.0)

    apart = [
        float(np.linalg.norm(np.diff(feet_of(reference, tick)[0][:, :2], axis=0)))
        for tick in range(4 * RATE, 6 * RATE, 5)
    ]
    assert min(apart) > 0.1


@pytest.mark.parametrize("velocity", BEYOND_WALK.values(), ids=BEYOND_WALK)
def test_told_to_stop_it_stands_on_both_feet_as_at_rest(
    velocity: tuple[float, float, float],
) -> None:
    reference = steer(driven(*velocity), VelocityCommand(4 * RATE, 0.0))
    rest = DynamicsModel(HUMANOID)
    rest.update(np.array(HUMANOID.rest_position), np.zeros(HUMANOID.layout.size))
    beside = np.diff(rest.link_poses()[0][FEET], axis=0)[0, 1]

    places, heights = feet_of(reference, 8 * RATE)
    assert float(np.linalg.norm(np.diff(places[:, :2], axis=0))) == pytest.approx(beside, abs=0.02)
    assert heights == pytest.approx(0.0, abs=0.005)
    assert reference.course(8 * RATE).phase == reference.course(9 * RATE).phase
    still = reference.sample(8.0).velocity
    assert still == pytest.approx(0.0, abs=1e-6)


def test_it_stands_within_two_seconds_of_a_walk() -> None:
    reference = steer(driven(WALK), VelocityCommand(4 * RATE, 0.0))

    assert np.abs(reference.sample(6.0).velocity).max() < 0.05


@pytest.mark.parametrize("later", range(0, 300, 60))
def test_as_it_has_braked_from_a_run_both_feet_are_about_where_they_stay(later: int) -> None:
    command = VelocityCommand(5 * RATE + later, 0.0)
    reference = steer(driven(2.5), command)

    braked = command.tick + round(2.5 / reference.limits.braking * RATE)
    assert not reference.course(braked + 1).is_moving
    soon, in_the_end = (reference.course(tick).feet for tick in (braked + RATE // 4, 9 * RATE))
    for foot, last in zip(soon, in_the_end, strict=True):
        assert abs(foot.place - last.place) < 0.1  # a step of the run is 1.1 m long


def test_a_foot_comes_down_in_front_as_far_as_the_character_goes_in_half_a_stance() -> None:
    reference = driven(0.6)
    frequency, landed = reference._gait.frequency(WALK), 0

    for tick in range(4 * RATE, 6 * RATE):
        before, after = stands(reference, tick), stands(reference, tick + 1)
        for foot, cycle in enumerate(reference._gait.foot_cycles(0.6)):
            if after[foot] and not before[foot]:
                course = reference.course(tick + 1)
                ahead = course.feet[foot].place.real - course.x
                expected = cycle.middle.place.real + 0.6 * 0.5 * cycle.duty / frequency
                assert ahead == pytest.approx(expected, abs=0.01)
                landed += 1
    assert landed >= 3


@pytest.mark.parametrize(
    ("first", "then"),
    [
        pytest.param((2.0, 0.0, 0.0), (0.6, 0.0, 0.0), id="slower"),
        pytest.param((1.0, 0.0, 0.8), (1.0, 0.0, -0.8), id="the other bend"),
        pytest.param((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), id="turning"),
        pytest.param((0.8, 0.0, 0.0), (1.2, 0.0, 0.0), id="faster"),
    ],
)
def test_a_foot_comes_down_where_a_command_will_have_it_amid_its_stance(
    first: tuple[float, float, float], then: tuple[float, float, float]
) -> None:
    reference = steer(driven(*first), VelocityCommand(4 * RATE, *then))
    landed = 0

    for tick in range(4 * RATE + RATE // 2, 6 * RATE):
        before, after = stands(reference, tick), stands(reference, tick + 1)
        for foot in np.flatnonzero(np.greater(after, before)).tolist():
            lifted = next(t for t in range(tick + 1, 8 * RATE) if not stands(reference, t)[foot])
            amid = reference.course((tick + 1 + lifted) // 2)
            at_ease = Stepping(reference._gait)._at_ease(amid)[foot].moved_by(amid.frame)
            stays = reference.course(tick + 1).feet[foot]
            assert abs(stays.place - at_ease.place) < 0.015
            assert stays.heading == pytest.approx(at_ease.heading, abs=0.02)
            landed += 1
    assert landed >= 2


def test_no_joint_jerks_where_a_drive_changes() -> None:
    reference = steer(
        make(**LASTING),
        VelocityCommand(0, 1.0, 0.0, 0.3),
        VelocityCommand(700, -0.4),
        VelocityCommand(1400, 0.0, -0.3),
        VelocityCommand(2100, 2.0),
        VelocityCommand(3000, 0.0),
    )

    fastest = max(float(np.abs(reference.sample(t / RATE).velocity[6:]).max()) for t in range(4000))
    assert fastest < 25.0  # rad/s; the captured walk's and run's is 15


def test_in_a_bend_feet_are_outside_by_the_lean() -> None:
    straight, bend = driven(1.5), driven(1.5, 0.0, 0.6)

    def mean_left(reference: SteeredReference) -> float:
        lefts = []
        for tick in range(5 * RATE, 8 * RATE, 11):
            course = reference.course(tick)
            for foot, standing in zip(course.feet, stands(reference, tick), strict=True):
                if standing:
                    off = foot.place - complex(course.x, course.y)
                    turned = off * complex(math.cos(course.heading), -math.sin(course.heading))
                    lefts.append(turned.imag)
        return float(np.mean(lefts))

    lean = 1.5 * 0.6 / 9.81 * HUMANOID.rest_position[2]
    assert mean_left(bend) - mean_left(straight) == pytest.approx(-lean, abs=0.04)


@cache
def pressed_beside_feet(reference: SteeredReference) -> float:
    """How far aside of the soles that stand the ground's force would act, m, on the average.

    The zero moment point of the centre of mass, whose path is smoothed over 0.1 s.
    """
    ticks, half = range(4 * RATE, 7 * RATE), 12
    model, path, spans = DynamicsModel(HUMANOID), [], []
    for tick in ticks:
        state, course = reference.sample(tick / RATE), reference.course(tick)
        model.update(state.configuration.position, state.velocity)
        path.append(model.centre_of_mass().copy())
        places = model.link_poses()[0][FEET]
        left = np.array((-math.sin(course.heading), math.cos(course.heading)))
        lefts = [places[foot, :2] @ left for foot, on in enumerate(stands(reference, tick)) if on]
        spans.append((left, lefts))
    kernel = np.hanning(2 * half + 3)[1:-1] / np.hanning(2 * half + 3).sum()
    smooth = np.array([np.convolve(row, kernel, "valid") for row in np.array(path).T]).T
    acceleration = RATE**2 * np.diff(smooth, n=2, axis=0)
    height = smooth[1:-1, 2:] / (9.81 + acceleration[:, 2:])
    points = smooth[1:-1, :2] - height * acceleration[:, :2]
    outside = []
    for point, (left, lefts) in zip(points, spans[half + 1 :], strict=False):
        if lefts:
            at = float(point @ left)
            outside.append(max(min(lefts) - 0.045 - at, at - max(lefts) - 0.045, 0.0))
    return float(np.mean(outside))


@pytest.mark.parametrize("velocity", BEYOND_WALK.values(), ids=BEYOND_WALK)
def test_it_sways_so_that_feet_can_hold_it_as_well_as_in_the_captured_walk(
    velocity: tuple[float, float, float],
) -> None:
    assert pressed_beside_feet(driven(*velocity)) < 1.4 * pressed_beside_feet(driven(WALK))


def test_a_character_whose_file_names_no_feet_is_steered_without_prints() -> None:
    reference = make("laikago", **{"steering.clips": ["walk"], **LASTING})
    reference = steer(reference, VelocityCommand(0, 0.2))

    assert reference.course(500).feet == ()
    assert reference.course(500).phase > 0.0
