"""Lab 3: standing by a virtual force, through the Jacobians' transposes (slide 73)."""

from collections.abc import Mapping
from functools import partial

import numpy as np

from controller_node.balance import BalanceController
from controller_node.control_laws import stable_pd_effort
from lecture.balance import HIPS
from lecture.labs.body import Body
from lecture.labs.hidden import uniform
from lecture.labs.sheet import Measured, Sheet
from lecture.labs.simulated import PERIOD, RATE, Push, simulate
from lecture.labs.student import Student
from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.geometry import fixed_order
from msgs_config.messages.state import StampedState

TITLE = "standing on two feet by a virtual force"

_LAB = 3
_ROOT = 6  # entries of the root, the first ones
_QUIET_SECONDS, _PUSHED_SECONDS = 10.0, 5.0
_PUSH_TICK, _PUSH_SECONDS = RATE, 0.1
_STANDING = 0.8  # of the height of the root at the beginning
_STILL = 0.01  # m/s
_EXACT = 1e-3  # of the largest number
_PUSHES = {  # N s, which the project's own law bears, too
    "forward": (1.0, 0.0, 4.0, 7.0),
    "backward": (-1.0, 0.0, 2.0, 4.0),
    "left": (0.0, 1.0, 4.0, 7.0),
    "right": (0.0, -1.0, 4.0, 7.0),
}


def grade(student: Student, sheet: Sheet) -> None:
    """Ask for the force, its moment and the joints' efforts, and then have the humanoid stand."""
    sheet.judge(
        "the force, at rest over the feet", 5, "(0, 0, 441) N ± 0.1 %", partial(_carries, student)
    )
    sheet.judge(
        "the force, hidden states", 10, "draws to the feet and brakes", partial(_draws, student)
    )
    sheet.judge("its moment, hidden", 10, "± 0.1 %", partial(_turns, student))
    for case in (1, 2):
        what = f"the joints' efforts, hidden {case}"
        sheet.judge(what, 5 * case, "± 0.1 %", partial(_presses, student, case))
    what = "stands without a push"
    sheet.judge(
        what,
        20,
        f"still after {_QUIET_SECONDS:g} s",
        partial(_stands, student, sheet, {}, _QUIET_SECONDS),
    )
    for case, (side, (x, y, low, high)) in enumerate(_PUSHES.items(), start=1):
        (impulse,) = uniform(_LAB, 20 + case, (low, high))
        force = impulse / _PUSH_SECONDS
        push = {_PUSH_TICK: Push("chest", (force * x, force * y, 0.0))}
        sheet.judge(
            f"stands, hidden push {side}",
            10,
            f"still after {_PUSHED_SECONDS:g} s",
            partial(_stands, student, sheet, push, _PUSHED_SECONDS),
        )


def _carries(student: Student) -> Measured:
    weight = 441.0
    force = student.call("virtual_force", np.zeros(3), np.zeros(3), weight, shape=(3,))
    off = float(np.abs(force - (0.0, 0.0, weight)).max()) / weight
    return Measured(off <= _EXACT, f"({force[0]:.1f}, {force[1]:.1f}, {force[2]:.1f}) N")


def _draws(student: Student) -> Measured:
    """Horizontally the force is larger along the offset, and against the velocity."""
    still = np.zeros(3)
    for case in range(1, 9):
        x, y, u, v, weight = uniform(
            _LAB, case, *[(-0.05, 0.05)] * 2, *[(-0.3, 0.3)] * 2, (300, 900)
        )
        offset, velocity = np.array((x, y, -0.8)), np.array((u, v, 0.0))
        drawn = student.call("virtual_force", offset, still, weight, shape=(3,))
        braked = student.call("virtual_force", offset, velocity, weight, shape=(3,))
        if not float(fixed_order.dot(drawn[:2], offset[:2])) > 0.0:
            return Measured(False, "it draws away from the feet")
        if not float(fixed_order.dot((braked - drawn)[:2], velocity[:2])) < 0.0:
            return Measured(False, "it does not brake")
    return Measured(True, "it does")


def _turns(student: Student) -> Measured:
    numbers = np.array(uniform(_LAB, 9, *[(-1.0, 1.0)] * 6))
    arm, force = numbers[:3], 100.0 * numbers[3:]
    return _compare(student.call("moment", arm, force, shape=(3,)), fixed_order.cross(arm, force))


def _presses(student: Student, case: int) -> Measured:
    n = 8 + case
    numbers = np.array(uniform(_LAB, 10 + case, *[(-1.0, 1.0)] * (n + 12 + 12 * n)))
    bias, wrenches = 10.0 * numbers[:n], 100.0 * numbers[n : n + 12].reshape(2, 6)
    jacobians = numbers[n + 12 :].reshape(2, 6, n)
    right, left = fixed_order.apply(jacobians.swapaxes(1, 2), wrenches)
    found = student.call("joint_efforts", bias, wrenches, jacobians, shape=(n,))
    return _compare(found, bias - right - left)


def _compare(found: FloatArray, exact: FloatArray) -> Measured:
    off = float(np.abs(found - exact).max() / np.abs(exact).max())
    return Measured(off <= _EXACT, f"{100.0 * off:.2f} % off")


def _stands(student: Student, sheet: Sheet, pushes: Mapping[int, Push], seconds: float) -> Measured:
    body = Body(load_character("humanoid"), {"keyframes": "humanoid_stand", **HIPS})
    balance = BalanceController(body.character, body.character.feet)
    lowest = _STANDING * float(body.start.position[2])
    tracking = (np.arange(len(body.stiffness)) >= _ROOT).astype(float)  # no hand holds the root

    def law(tick: int, state: StampedState, contacts: FloatArray | None) -> FloatArray:
        model, desired = body.model, body.desired(tick + 1)
        model.update(state.position, state.velocity)
        error = model.error_of_state(desired.configuration.position)
        gains = (tracking * body.stiffness, tracking * body.damping)
        motion = (error, state.velocity, desired.velocity)
        effort = stable_pd_effort(model, *gains, *motion, PERIOD)
        return tracking * (effort + _balancing(student, body, balance))

    trace = simulate(
        sheet,
        body.character,
        round(seconds * RATE),
        law,
        start=body.start,
        pushes=pushes,
        goes_on=lambda state: float(state.position[2]) > lowest,
        wrench_duration=_PUSH_SECONDS,
    )
    stood = (len(trace.position) - 1) / RATE
    if trace.has_diverged or float(trace.position[-1, 2]) <= lowest:
        return Measured(False, f"falls after {stood:.2f} s")
    body.model.update(trace.position[-1], trace.velocity[-1])
    speed = float(fixed_order.norm(body.model.centre_of_mass_velocity()))
    return Measured(speed < _STILL, f"stands, at {1e3 * speed:.2f} mm/s")


def _balancing(student: Student, body: Body, balance: BalanceController) -> FloatArray:
    """The efforts (n,) of the student's functions; `body.model` has the state."""
    model = body.model
    soles = balance.soles(model)
    arm, size = model.centre_of_mass() - soles.middle, body.character.layout.size
    velocity = model.centre_of_mass_velocity()
    force = student.call("virtual_force", -arm, velocity, model.weight, shape=(3,))
    moment = student.call("moment", arm, force, shape=(3,))
    ground = balance.shared(soles, force, moment)
    wrenches = np.concatenate((ground.forces, ground.moments), axis=1)
    jacobians = balance.jacobians(model, soles)
    return student.call("joint_efforts", model.bias_force(), wrenches, jacobians, shape=(size,))
