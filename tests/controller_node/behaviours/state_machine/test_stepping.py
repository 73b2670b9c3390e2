"""Steps as a machine is told to go: where feet land, and how far apart they stay."""

from dataclasses import replace

import pytest

from controller_node.behaviours.state_machine.description import State
from controller_node.behaviours.state_machine.file import read_machine
from controller_node.behaviours.state_machine.legs.stepping import (
    landing_offset,
    least_beside,
    nominal_centre,
    step_width,
    sway_of_course,
)
from controller_node.references.steering.course import Course

RATE = 3.3  # 1/s
SIDES = (1.0, -1.0)


def state(**placement: float) -> State:
    step = read_machine("walk").states["step"]
    law = replace(step.placement, pace=1.0, least_width=0.12, width=0.14, **placement)
    return replace(step, placement=law)


def step_of(course: Course, mirror: float) -> complex:
    """From the stance foot to where the other one lands; axes of the heading at landing."""
    time = state().step_time
    centre = nominal_centre(state(), course, RATE, mirror, time)
    return centre - landing_offset(state(), course, RATE, -mirror)


@pytest.mark.parametrize("left", [0.0, 0.3, -0.3])
@pytest.mark.parametrize("forward", [0.0, 0.6, 1.2])
def test_two_steps_go_as_far_as_they_are_told(forward: float, left: float) -> None:
    course = Course(forward=forward, left=left)

    both = step_of(course, 1.0) + step_of(course, -1.0)

    time = 2.0 * state().step_time
    assert both.real == pytest.approx(forward * time) and both.imag == pytest.approx(left * time)


@pytest.mark.parametrize("left", [0.1, 0.3, -0.3])
def test_feet_that_go_aside_do_not_meet(left: float) -> None:
    """The narrow one of two steps keeps the least distance: the left foot is to the left."""
    course = Course(left=left)

    beside = [mirror * step_of(course, mirror).imag for mirror in SIDES]

    assert min(beside) >= 0.12 - 1e-9
    assert step_width(state(), Course()) == 0.14


def test_feet_one_of_which_is_well_ahead_may_be_near_each_other() -> None:
    law = state().placement

    assert least_beside(law, 0.0) == least_beside(law, -0.2) == 0.12
    assert least_beside(law, 0.3) == pytest.approx(0.06)
    assert least_beside(law, -0.5) == 0.0


def test_in_a_bend_the_feet_are_farther_apart_by_the_height_of_the_chord() -> None:
    course = Course(forward=0.9, turn=0.5)
    time = state().step_time

    wider = step_width(state(), course) - step_width(state(), Course(forward=0.9))

    radius, half = 0.9 / 0.5, 0.9 * time
    assert wider == pytest.approx(radius - (radius * radius - half * half) ** 0.5, rel=0.02)


def test_straight_ahead_the_course_does_not_sway() -> None:
    for mirror in SIDES:
        assert sway_of_course(state(), Course(forward=1.0), RATE, mirror, 0.2) == 0.0
        aside = sway_of_course(state(), Course(left=0.3 * mirror), RATE, mirror, 0.2)
        assert aside > 0.03


def test_a_foot_whose_way_ends_above_the_ground_lands_later() -> None:
    step = state(depth=-0.02, descent=0.5)

    assert step.step_time == pytest.approx(step.duration + 0.04)
    assert state(depth=0.01).step_time == step.duration
