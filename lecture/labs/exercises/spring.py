"""Lab 1: a mass that a spring and a damper lift (slides 52 to 62)."""

from collections.abc import Callable
from functools import partial

import numpy as np

from lecture.labs.hidden import uniform
from lecture.labs.sheet import Measured, Sheet
from lecture.labs.simulated import PERIOD, RATE, Trace, heavier, simulate
from lecture.labs.student import Student
from lecture.theory import second_order
from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.messages.state import StampedState

TITLE = "a mass on a spring: PD and PID"

_LAB = 1
_GRAVITY = 9.81  # m/s^2
_TARGET = 1.0  # m above where it begins
_SECONDS = 10.0
_EXACT = 1e-4  # m
_NEARLY = 0.999  # m: at the bound even a stable mass swings out a hundred times as far at first
_FAR = 50.0  # m, of a mass that has been flung away
_SETTLING = 5.84  # time until a critically damped mass stays within 2 %, times sqrt(kp / m)
_FORCE = Callable[[float, float], float]


def grade(student: Student, sheet: Sheet) -> None:
    """Ask for the force of PD, the damping that is critical, PID, and the bound of explicit PD."""
    sheet.judge(
        "PD, 1 kg, kp 100 N/m: below the target",
        10,
        "98.1 mm ± 0.1 mm",
        partial(_rests, student, sheet, 1.0, 100.0, 20.0),
    )
    for case in (1, 2):
        mass, stiffness, ratio = uniform(_LAB, case, (0.5, 3.0), (60.0, 300.0), (0.4, 1.2))
        damping = ratio * second_order.critical_damping(stiffness, mass)
        measure = partial(_rests, student, sheet, mass, stiffness, damping)
        sheet.judge(f"PD, hidden mass and gains {case}", 10, "m g / kp ± 0.1 mm", measure)
    for case in (1, 2, 3):
        mass, stiffness = uniform(_LAB, 10 + case, (0.5, 3.0), (60.0, 300.0))
        sheet.judge(
            f"critical damping, hidden {case}",
            10,
            "overshoot < 0.5 %, settles in 5.84 sqrt(m / kp) ± 5 %",
            partial(_settles, student, sheet, mass, stiffness),
        )
    for case in (1, 2):
        mass, stiffness, share = uniform(_LAB, 20 + case, (0.5, 2.0), (80.0, 200.0), (0.1, 0.3))
        measure = partial(_reaches, student, sheet, mass, stiffness, share)
        sheet.judge(f"PID, hidden mass and gains {case}", 10, "at the target ± 0.1 mm", measure)
    for case in (1, 2):
        mass, damping = uniform(_LAB, 30 + case, (0.5, 3.0), (20.0, 100.0))
        sheet.judge(
            f"explicit PD's largest stiffness, hidden {case}",
            10,
            "stable at 0.99 of it, not at 1.01",
            partial(_finds_bound, student, sheet, mass, damping),
        )


def _lift(sheet: Sheet, mass: float, force: _FORCE, height: float = 0.0) -> Trace:
    """The mass (kg) from a height (m), under a force (N) of the error (m) and its rate (m/s)."""

    def law(tick: int, state: StampedState, contacts: FloatArray | None) -> FloatArray:
        error, rate = _TARGET - float(state.position[0]), -float(state.velocity[0])
        return np.array([force(error, rate)])

    return simulate(
        sheet,
        heavier(load_character("lift"), mass),
        round(_SECONDS * RATE),
        law,
        goes_on=lambda state: abs(float(state.position[0])) < _FAR,
        initial_position=[height],
    )


def _pd(student: Student, stiffness: float, damping: float) -> _FORCE:
    return lambda error, rate: student.number("pd_force", error, rate, stiffness, damping)


def _at_rest(trace: Trace) -> float | None:
    """The mean height in the last second, m; None if it does not rest there."""
    heights = trace.position[-RATE:, 0]
    if _has_flown(trace) or float(np.ptp(heights)) > _EXACT:
        return None
    return float(heights[-1])


def _has_flown(trace: Trace) -> bool:
    return trace.has_diverged or abs(float(trace.position[-1, 0])) >= _FAR


def _rests(
    student: Student, sheet: Sheet, mass: float, stiffness: float, damping: float
) -> Measured:
    trace = _lift(sheet, mass, _pd(student, stiffness, damping))
    rest = _at_rest(trace)
    if rest is None:
        return Measured(False, "it does not come to rest")
    below, asked = _TARGET - rest, mass * _GRAVITY / stiffness
    return Measured(abs(below - asked) <= _EXACT, f"{1e3 * below:.2f} mm")


def _settles(student: Student, sheet: Sheet, mass: float, stiffness: float) -> Measured:
    damping = student.number("critical_damping", stiffness, mass)
    trace = _lift(sheet, mass, _pd(student, stiffness, damping))
    rest = _at_rest(trace)
    if rest is None:
        return Measured(False, f"kd {damping:.2f} N s/m: it does not come to rest")
    heights = trace.position[:, 0]
    beyond = second_order.measured_overshoot(heights, rest)
    times = np.linspace(0.0, (len(heights) - 1) * PERIOD, len(heights))
    time = second_order.settling_time(times, heights, rest)
    asked = _SETTLING * (mass / stiffness) ** 0.5
    is_right = beyond < 0.005 and time is not None and abs(time - asked) <= 0.05 * asked
    return Measured(is_right, f"overshoot {100 * beyond:.2f} %, {(time or 0.0) / asked:.2f} of it")


def _reaches(
    student: Student, sheet: Sheet, mass: float, stiffness: float, share: float
) -> Measured:
    """With a share of the integral gain at which it becomes unstable."""
    damping = second_order.critical_damping(stiffness, mass)
    gains = (
        stiffness,
        damping,
        share * second_order.largest_integral_gain(stiffness, damping, mass),
    )
    integral = 0.0

    def force(error: float, rate: float) -> float:
        nonlocal integral
        integral += PERIOD * error
        return student.number("pid_force", error, rate, integral, *gains)

    rest = _at_rest(_lift(sheet, mass, force))
    if rest is None:
        return Measured(False, "it does not come to rest")
    return Measured(abs(rest - _TARGET) <= _EXACT, f"{1e3 * abs(_TARGET - rest):.2f} mm from it")


def _finds_bound(student: Student, sheet: Sheet, mass: float, damping: float) -> Measured:
    stiffness = student.number("largest_stiffness", damping, mass, PERIOD)
    flown = [
        _has_flown(_lift(sheet, mass, _pd(student, share * stiffness, damping), _NEARLY))
        for share in (0.99, 1.01)
    ]
    found = " and ".join("unstable" if each else "stable" for each in flown)
    return Measured(flown == [False, True], f"{stiffness:.0f} N/m: {found}")
