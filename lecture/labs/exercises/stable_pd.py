"""Lab 2: stable PD of a whole character, where explicit PD blows up (slides 63 to 68)."""

from functools import partial
from typing import NamedTuple

import numpy as np

from actuated_characters.metrics.error_measures import joint_errors
from controller_node.control_laws import stable_pd_effort
from lecture.labs.body import Body
from lecture.labs.hidden import uniform
from lecture.labs.sheet import Measured, Sheet
from lecture.labs.simulated import PERIOD, RATE, Trace, simulate
from lecture.labs.student import Student
from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.geometry import fixed_order
from msgs_config.messages.state import StampedState

TITLE = "stable PD of a humanoid that follows captured motion"

_LAB = 2
_SECONDS = 2.0
_HIDDEN_CLIPS = ("run", "dance_a", "kick")
_EXACT = 1e-3  # of the largest effort
_NEAR = 1.1  # times the error that stable PD has
_SIZE = 6  # degrees of freedom of the hidden equation


def grade(student: Student, sheet: Sheet) -> None:
    """Ask for the equation itself, and then for motions that it follows."""
    e, v, vr, c, kp, kd = np.array([[0.3], [1.0], [0.5], [4.0], [600.0], [60.0]])
    one = _System(e, v, vr, c, kp, kd, np.array([[2.0]]), 0.01)
    sheet.judge(
        "the equation, one mass of 2 kg",
        10,
        "111.69 N ± 0.01 N",
        partial(_solves, student, one),
    )
    for case in (1, 2):
        measure = partial(_solves, student, _random_system(case))
        sheet.judge(f"the equation, hidden {case}", 10, "the effort ± 0.1 %", measure)
    sheet.judge(
        "the walk: joints' mean error",
        10,
        f"at most {_NEAR} of stable PD's",
        partial(_follows, student, sheet, "walk", 1.0),
    )
    for case, clip in enumerate(_HIDDEN_CLIPS, start=1):
        (factor,) = uniform(_LAB, 10 + case, (0.7, 3.0))
        measure = partial(_follows, student, sheet, clip, factor)
        asked = f"at most {_NEAR} of stable PD's"
        sheet.judge(f"hidden motion and gains {case}", 20, asked, measure)


class _System(NamedTuple):
    """What the law is asked with."""

    error: FloatArray  # (n,)
    velocity: FloatArray  # (n,)
    reference_velocity: FloatArray  # (n,)
    bias: FloatArray  # (n,)
    stiffness: FloatArray  # (n,)
    damping: FloatArray  # (n,)
    mass: FloatArray  # (n, n)
    period: float


def _random_system(case: int) -> _System:
    """A system of some degrees of freedom; its mass matrix is positive definite."""
    n = _SIZE
    words = np.array(uniform(_LAB, case, *[(-1.0, 1.0)] * (n * n + 6 * n + 1)))
    root, rest = words[: n * n].reshape(n, n), words[n * n : -1].reshape(6, n)
    error, velocity, reference_velocity, bias, stiffness, damping = rest
    return _System(
        *(error, velocity, reference_velocity),
        10.0 * bias,
        500.0 + 400.0 * stiffness,
        50.0 + 40.0 * damping,
        fixed_order.product(root, root.T) + np.eye(n),
        0.01 + 0.005 * float(words[-1]),
    )


def _solves(student: Student, asked: _System) -> Measured:
    """Compare with the solution of the equation."""
    found = _ask(student, asked)
    implicit = asked.damping * asked.period
    known = asked.stiffness * (asked.error - asked.period * asked.velocity)
    known += asked.damping * (asked.reference_velocity - asked.velocity)
    right = (known - asked.bias)[:, np.newaxis]
    exact = known - implicit * fixed_order.solve(asked.mass + np.diag(implicit), right)[:, 0]
    off = float(np.abs(found - exact).max() / np.abs(exact).max())
    figure = f"{found[0]:.2f} N" if len(found) == 1 else f"{100.0 * off:.2f} % off"
    return Measured(off <= _EXACT, figure)


def _ask(student: Student, asked: _System) -> FloatArray:
    return student.call(
        "stable_pd",
        *(asked.error, asked.velocity, asked.reference_velocity, asked.mass, asked.bias),
        *(asked.stiffness, asked.damping, asked.period),
        shape=asked.error.shape,
    )


def _follows(student: Student, sheet: Sheet, clip: str, factor: float) -> Measured:
    """Follow a clip with gains times a factor, as well as the project's law does."""
    body = Body(load_character("humanoid"), {"clip": clip})
    stiffness, damping = factor * body.stiffness, factor * body.damping

    def law(tick: int, state: StampedState, contacts: FloatArray | None) -> FloatArray:
        model, desired = body.model, body.desired(tick + 1)
        model.update(state.position, state.velocity)
        error = model.error_of_state(desired.configuration.position)
        motion, gains = (error, state.velocity, desired.velocity), (stiffness, damping)
        asked = _System(*motion, model.bias_force(), *gains, model.mass_matrix(), PERIOD)
        return _ask(student, asked)

    def ours(tick: int, state: StampedState, contacts: FloatArray | None) -> FloatArray:
        model, desired = body.model, body.desired(tick + 1)
        model.update(state.position, state.velocity)
        error = model.error_of_state(desired.configuration.position)
        gains = (stiffness, damping, error, state.velocity, desired.velocity)
        return stable_pd_effort(model, *gains, PERIOD)

    ticks = round(_SECONDS * RATE)
    trace = simulate(sheet, body.character, ticks, law, start=body.start)
    if trace.has_diverged:
        return Measured(False, f"it flies apart after {len(trace.position) / RATE:.2f} s")
    best = _mean_error(body, simulate(sheet, body.character, ticks, ours, start=body.start))
    error = _mean_error(body, trace)
    return Measured(error <= _NEAR * best, f"{error:.4f} rad; stable PD's: {best:.4f}")


def _mean_error(body: Body, trace: Trace) -> float:
    """The mean angle in rad between the joints and the reference."""
    desired = [body.desired(tick).configuration.position for tick in range(len(trace.position))]
    errors = joint_errors(body.character.layout, trace.position, np.array(desired))
    return float(fixed_order.mean(errors.ravel()))
