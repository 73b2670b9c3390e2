"""Steps that go on as they are told: the extrapolated centre of mass over the feet."""

import math

from controller_node.behaviours.state_machine import laws
from controller_node.behaviours.state_machine.description import FootPlacement, State
from controller_node.references.steering.course import Course

_SOLE_LENGTH = 0.2  # m, a sole's length


def nominal_centre(
    state: State, course: Course, rate: float, mirror: float, time: float
) -> complex:
    """Where the extrapolated centre of mass is on its course, m, `time` s after a state began.

    Along the heading and 1j to its left, from the stance sole; `rate` in 1/s is that of the
    pendulum, `mirror` is 1 where the left foot swings, else -1.
    """
    time = min(time, state.step_time)
    offset = landing_offset(state, course, rate, mirror)
    return offset * laws.turned(-time * course.turn) * math.exp(rate * time)


def landing_offset(state: State, course: Course, rate: float, side: float) -> complex:
    """How far off a landing foot the extrapolated centre of mass is, m, by the law extrapolated.

    `side` is 1 of a right foot, else -1; axes are those of the heading then.
    """
    turn, step_time = course.turn, state.step_time
    velocity = state.placement.pace * complex(course.forward, course.left)
    offset = laws.offset_of_velocity(velocity, turn, step_time, rate)
    width = step_width(state, course)
    return offset + side * laws.offset_of_width(width, turn, step_time, rate)


def step_width(state: State, course: Course) -> float:
    """The width of a step, m: wider where the feet would meet.

    To go aside, one step of two is narrower by the way aside. In a bend a foot passes the other one
    on a chord of the bend, nearer to the inner foot by the chord's height.
    """
    law, time = state.placement, state.step_time
    least = least_beside(law, course.forward * time)
    width = max(law.width, least + abs(course.left) * time)
    return width + 0.5 * abs(course.forward * course.turn) * time * time


def least_beside(law: FootPlacement, ahead: float) -> float:
    """The least distance aside of soles one of which is so much ahead of the other one, m.

    A foot that lands well ahead of the other one, or behind it, does not meet it.
    """
    return law.least_width * (1.0 - laws.smooth_step((abs(ahead) - _SOLE_LENGTH) / _SOLE_LENGTH))


def sway_of_course(state: State, course: Course, rate: float, mirror: float, time: float) -> float:
    """How much farther from the stance foot the course has the extrapolated centre of mass, m.

    Against going straight ahead, towards the other foot; arguments as of `nominal_centre`.
    """
    straight = Course(forward=course.forward)
    there = nominal_centre(state, course, rate, mirror, time)
    return mirror * (there.imag - nominal_centre(state, straight, rate, mirror, time).imag)
