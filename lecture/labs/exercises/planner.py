"""Lab 6: a planner that samples: a pendulum swings up with a motor that cannot lift it at once."""

import math
from collections.abc import Mapping
from functools import partial

import numpy as np

from actuated_characters.batch.worlds import Batch
from lecture.labs.hidden import uniform
from lecture.labs.sheet import Measured, Sheet
from lecture.labs.simulated import ENGINE, RATE, Push, heavier, simulate
from lecture.labs.student import Student
from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.messages.state import StampedState

TITLE = "a planner that samples: a weak motor swings a pendulum up"

_LAB = 6
_SAMPLES = 64
_KNOTS, _KNOT_TICKS = 15, 24  # a plan of 1.5 s
_SIGMA, _TEMPERATURE = 1.0, 0.1
_SECONDS, _HELD_SECONDS = 8.0, 2.0
_UPRIGHT = math.pi  # rad; zero hangs
_NEAR = 0.3  # rad
_EXACT = 1e-2
_COST_GRID = 2.0**-24


def grade(student: Student, sheet: Sheet) -> None:
    """Ask for the planner's parts, and then have it swing pendulums up."""
    sheet.judge("plans, hidden", 10, "plan + sigma noise, within ±1", partial(_proposes, student))
    sheet.judge("the next plan's beginning", 5, "a knot later", partial(_shifts, student))
    for case in (1, 2):
        sheet.judge(
            f"the plans' mean, hidden {case}",
            5,
            "weights exp(-cost / T) ± 1 %",
            partial(_combines, student, case),
        )
    sheet.judge(
        "the cost, hidden states", 15, "least upright and at rest", partial(_costs, student)
    )
    upright = f"upright ± {_NEAR:g} rad for {_HELD_SECONDS:g} s"
    sheet.judge(
        "swings up 1 kg with 2 N m",
        20,
        upright,
        partial(_swings_up, student, sheet, 0, 1.0, 2.0, 0.0),
    )
    for case in (1, 2, 3):
        mass, share, start = uniform(_LAB, 20 + case, (0.6, 2.0), (0.4, 0.5), (-1.0, 1.0))
        measure = partial(_swings_up, student, sheet, case, mass, 4.905 * mass * share, start)
        sheet.judge(f"hidden mass, motor and start {case}", 10, upright, measure)
    (impulse,) = uniform(_LAB, 30, (0.3, 0.5))
    push = {round((_SECONDS - 4.0) * RATE): Push("rod", (impulse / 0.1, 0.0, 0.0))}
    sheet.judge(
        "pushed when upright, hidden",
        10,
        upright,
        partial(_swings_up, student, sheet, 4, 1.0, 2.0, 0.0, push),
    )


def _proposes(student: Student) -> Measured:
    numbers = np.array(uniform(_LAB, 1, *[(-1.0, 1.0)] * (5 * _KNOTS + 1)))
    plan, noise = numbers[:_KNOTS], numbers[_KNOTS:-1].reshape(4, _KNOTS)
    sigma = 0.5 + 0.4 * float(numbers[-1])
    found = student.call("propose", plan, noise, sigma, shape=noise.shape)
    return _compare(found, np.clip(plan + sigma * noise, -1.0, 1.0))


def _shifts(student: Student) -> Measured:
    plan = np.array(uniform(_LAB, 2, *[(-1.0, 1.0)] * _KNOTS))
    return _compare(student.call("shift", plan, shape=plan.shape), np.append(plan[1:], plan[-1]))


def _combines(student: Student, case: int) -> Measured:
    numbers = np.array(uniform(_LAB, 2 + case, *[(0.0, 1.0)] * (8 * _KNOTS + 8)))
    plans, costs = 2.0 * numbers[:-8].reshape(8, _KNOTS) - 1.0, 1000.0 + 3.0 * numbers[-8:]
    weights = np.array([math.exp(-each / 0.7) for each in (costs - costs.min()).tolist()])
    exact = (weights[:, np.newaxis] * plans).sum(axis=0) / weights.sum()
    return _compare(student.call("combine", plans, costs, 0.7, shape=(_KNOTS,)), exact)


def _compare(found: FloatArray, exact: FloatArray) -> Measured:
    off = float(np.abs(found - exact).max() / np.abs(exact).max())
    return Measured(off <= _EXACT, f"{100.0 * off:.2f} % off")


def _costs(student: Student) -> Measured:
    """Of plans that are still in one state each, the upright one at rest costs least."""
    angles, speeds = np.array(uniform(_LAB, 5, *[(-2.5, 2.5)] * 8, *[(-6.0, 6.0)] * 8)).reshape(
        2, 8
    )
    angles[:3], speeds[:3] = (_UPRIGHT, -_UPRIGHT, 3.0 * _UPRIGHT), 0.0
    torques = np.zeros((8, _KNOTS))
    rows = (np.repeat(each[:, np.newaxis], _KNOTS, axis=1) for each in (angles, speeds))
    costs = student.call("cost", *rows, torques, shape=(8,), grid=_COST_GRID)
    if not costs[:3].max() < costs[3:].min():
        return Measured(False, "another state costs less")
    if not np.ptp(costs[:3]) < _EXACT * (costs[3:].min() - costs[0]):
        return Measured(False, "a whole turn more costs otherwise")
    return Measured(True, "it is")


def _swings_up(
    student: Student,
    sheet: Sheet,
    case: int,
    mass: float,
    limit: float,
    start: float,
    pushes: Mapping[int, Push] | None = None,
) -> Measured:
    """Plan again at each knot, and apply the first knot's torque until the next."""
    character = heavier(load_character("pendulum"), mass)
    plan, torque = np.zeros(_KNOTS), 0.0
    with _rollouts(character) as batch:

        def law(tick: int, state: StampedState, contacts: FloatArray | None) -> FloatArray:
            nonlocal plan, torque
            if tick % _KNOT_TICKS == 0:
                plan = _plan(student, batch, state, plan, limit, (case, tick))
                torque = limit * float(np.clip(plan[0], -1.0, 1.0))
                plan = student.call("shift", plan, shape=plan.shape)
            return np.array([torque])

        trace = simulate(
            sheet,
            character,
            round(_SECONDS * RATE),
            law,
            pushes=pushes or {},
            initial_position=[start],
        )
    if trace.has_diverged:
        return Measured(False, "it flies apart")
    turned = trace.position[-round(_HELD_SECONDS * RATE) :, 0] - _UPRIGHT
    off = float(np.abs(turned - 2.0 * _UPRIGHT * np.round(turned / (2.0 * _UPRIGHT))).max())
    return Measured(off <= _NEAR, f"± {off:.3f} rad")


def _rollouts(character: Character) -> Batch:
    return Batch(character, _SAMPLES, action="torques", simulator=dict(ENGINE))


def _plan(
    student: Student,
    batch: Batch,
    state: StampedState,
    plan: FloatArray,
    limit: float,
    draw: tuple[int, int],
) -> FloatArray:
    """A plan (knots,), in shares of the limit, from a state on."""
    case, tick = draw
    count = _SAMPLES * _KNOTS
    noise = np.array(uniform(_LAB, 10**6 * (case + 1) + tick, *[(-1.0, 1.0)] * count))
    plans = student.call(
        "propose", plan, noise.reshape(_SAMPLES, _KNOTS), _SIGMA, shape=(_SAMPLES, _KNOTS)
    )
    torques = limit * np.clip(plans, -1.0, 1.0)
    batch.reset(
        position=np.tile(state.position, (_SAMPLES, 1)),
        velocity=np.tile(state.velocity, (_SAMPLES, 1)),
    )
    motion = np.empty((2, _SAMPLES, _KNOTS))
    for knot in range(_KNOTS):
        batch.step(torques[:, knot, np.newaxis], ticks=_KNOT_TICKS)
        motion[0, :, knot], motion[1, :, knot] = batch.position[:, 0], batch.velocity[:, 0]
    costs = student.call("cost", *motion, torques / limit, shape=(_SAMPLES,), grid=_COST_GRID)
    return student.call("combine", plans, costs, _TEMPERATURE, shape=plan.shape)
