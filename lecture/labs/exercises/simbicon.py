"""Lab 4: a walk by SIMBICON: states, the foot's place, the torso's balance (slide 69)."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from lecture.labs.body import Body
from lecture.labs.hidden import uniform
from lecture.labs.sheet import Measured, Sheet
from lecture.labs.simulated import RATE, Push, heavier, simulate
from lecture.labs.student import Student
from lecture.labs.walker import Walker
from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.messages.state import StampedState

TITLE = "a walk by SIMBICON"

_LAB = 4
_SPEED = 0.4  # m/s, with which it begins
_LOWEST = 0.7  # m, of the root while it walks
_SECONDS, _HIDDEN_SECONDS = 10.0, 5.0
_STEPS_A_SECOND = 2.0  # at least; ours makes nearly three
_PUSH_SECONDS = 0.1
_EXACT = 1e-3
_FOLLOWING = (  # state, time, s, load of the swing foot, N, and the state that follows
    *(
        (0, 0.1, 0.0, 0),
        (0, 0.31, 0.0, 1),
        (0, 0.1, 300.0, 0),
        (1, 0.5, 0.0, 1),
        (1, 0.05, 300.0, 2),
    ),
    *((2, 0.2, 100.0, 2), (2, 0.31, 0.0, 3), (3, 0.4, 0.0, 3), (3, 0.1, 200.0, 0)),
)
_LIFT_TIME = 0.3  # s


def grade(student: Student, sheet: Sheet) -> None:
    """Ask for each law, and then have the humanoid walk."""
    sheet.judge("which leg stands, and which state follows", 10, "all", partial(_goes_on, student))
    sheet.judge("the foot's place, hidden", 10, "± 0.1 %", partial(_places, student))
    sheet.judge("the torso's torque, hidden", 10, "± 0.1 %", partial(_holds, student))
    sheet.judge("the stance hip's torque, hidden", 10, "± 0.1 %", partial(_supports, student))
    steps = f"{_STEPS_A_SECOND:g} steps a second"
    sheet.judge("walks", 30, f"{_SECONDS:g} s, {steps}", partial(_walks, student, sheet, _SECONDS))
    for side, case, sign in (("forward", 1, 1.0), ("backward", 2, -1.0)):
        tick, impulse = uniform(_LAB, 10 + case, (1.5, 2.5), (2.0, 5.0))
        pushes = {round(tick * RATE): Push("chest", (sign * impulse / _PUSH_SECONDS, 0.0, 0.0))}
        measure = partial(_walks, student, sheet, _HIDDEN_SECONDS, pushes=pushes)
        sheet.judge(f"hidden push {side}", 10, f"{_HIDDEN_SECONDS:g} s, {steps}", measure)
    (factor,) = uniform(_LAB, 20, (1.05, 1.15))
    measure = partial(_walks, student, sheet, _HIDDEN_SECONDS, factor)
    sheet.judge("hidden mass", 10, f"{_HIDDEN_SECONDS:g} s, {steps}", measure)


def _goes_on(student: Student) -> Measured:
    legs = [student.number("stance_leg", state) for state in range(4)]
    right = sum(
        student.number("next_state", state, time, _LIFT_TIME, load) == following
        for state, time, load, following in _FOLLOWING
    )
    is_right = legs == [1.0, 1.0, 0.0, 0.0] and right == len(_FOLLOWING)
    legs_named = ", ".join(f"{leg:g}" for leg in legs)
    return Measured(is_right, f"legs {legs_named}; {right} of {len(_FOLLOWING)} states")


def _places(student: Student) -> Measured:
    given = uniform(_LAB, 1, (-0.5, 0.5), (0.1, 0.5), (0.1, 0.5), (-0.3, 0.3), (-1.0, 1.0))
    angle, c_d, c_v, distance, velocity = given
    found = student.call("foot_placement", *given)
    return _compare(found, np.array(angle + c_d * distance + c_v * velocity))


def _holds(student: Student) -> Measured:
    numbers = np.array(uniform(_LAB, 2, *[(-1.0, 1.0)] * 6))
    stiffness, damping = uniform(_LAB, 3, (100.0, 400.0), (10.0, 40.0))
    found = student.call("torso_torque", numbers[:3], numbers[3:], stiffness, damping, shape=(3,))
    return _compare(found, stiffness * numbers[:3] - damping * numbers[3:])


def _supports(student: Student) -> Measured:
    torso, swing = 50.0 * np.array(uniform(_LAB, 4, *[(-1.0, 1.0)] * 6)).reshape(2, 3)
    return _compare(student.call("stance_hip_torque", torso, swing, shape=(3,)), -torso - swing)


def _compare(found: FloatArray, exact: FloatArray) -> Measured:
    off = float(np.abs(found - exact).max() / np.abs(exact).max())
    return Measured(off <= _EXACT, f"{100.0 * off:.2f} % off")


def _walks(
    student: Student,
    sheet: Sheet,
    seconds: float,
    factor: float = 1.0,
    pushes: Mapping[int, Push] | None = None,
) -> Measured:
    """Walk from standing, with a little speed, with so many times the mass."""
    character = heavier(load_character("humanoid"), factor)
    body = Body(character, {"keyframes": "humanoid_stand"})
    velocity = body.start.velocity.copy()
    velocity[0] = _SPEED
    walker = Walker(student, body)
    trace = simulate(
        sheet,
        character,
        round(seconds * RATE),
        walker,
        start=replace(body.start, velocity=velocity),
        pushes=pushes or {},
        goes_on=_is_up,
        watch_contacts=True,
        wrench_duration=_PUSH_SECONDS,
    )
    if trace.has_diverged or float(trace.position[-1, 2]) <= _LOWEST:
        return Measured(False, f"falls after {(len(trace.position) - 1) / RATE:.2f} s")
    enough = walker.steps >= _STEPS_A_SECOND * seconds
    return Measured(enough, f"{walker.steps} steps, {trace.position[-1, 0]:.2f} m")


def _is_up(state: StampedState) -> bool:
    return float(state.position[2]) > _LOWEST
