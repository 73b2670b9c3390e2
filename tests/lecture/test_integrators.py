"""The study `integrators`: its steps against closed forms, and the engines against its steps."""

import numpy as np
import pytest

from lecture import integrators
from lecture.framework.result import StudyResult
from lecture.theory.euler import RigidBodyMotion, order_of
from lecture.theory.integrators import (
    TURN_RULES,
    energy_and_momentum,
    fall_off,
    swing,
    swing_energy,
    ticks_off,
    tumble,
)
from msgs_config.geometry import rotations
from sim_node.physics.engine import INSTALLED_ENGINES
from tests.support.in_process import InProcessRunner

pytestmark = pytest.mark.slow

FREQUENCY, STEP = 10.0, 1.0 / 60.0
INERTIA = np.array([0.3, 0.5, 0.7])
NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def result(runner: InProcessRunner) -> StudyResult:
    return runner.study("integrators")


# The maths


def test_explicit_eulers_energy_grows_and_that_of_the_semi_implicit_one_wavers() -> None:
    explicit = swing(FREQUENCY, (1.0, 0.5), STEP, 200, explicit=True)
    other = swing(FREQUENCY, (1.0, 0.5), STEP, 200, explicit=False)

    energy = swing_energy(FREQUENCY, explicit)
    np.testing.assert_allclose(energy[1:] / energy[:-1], 1.0 + (STEP * FREQUENCY) ** 2)
    x, v = other.T
    kept = v**2 + (FREQUENCY * x) ** 2 - STEP * FREQUENCY**2 * x * v
    np.testing.assert_allclose(kept, kept[0], rtol=1e-12)
    share = swing_energy(FREQUENCY, other) / (0.5 * kept)
    assert share.max() < 1.0 / (1.0 - STEP * FREQUENCY / 2.0)
    assert share.min() > 1.0 / (1.0 + STEP * FREQUENCY / 2.0)


@pytest.mark.parametrize("explicit", [True, False])
def test_a_falling_point_is_off_its_parabola_by_half_a_steps_speed(explicit: bool) -> None:
    height, speed, heights = 0.0, 0.0, [0.0]
    for _ in range(30):
        after = speed - 9.81 * STEP
        height += STEP * (speed if explicit else after)
        speed = after
        heights.append(height)

    times = STEP * np.arange(31)
    above = fall_off(9.81, STEP, times, explicit=explicit)
    np.testing.assert_allclose(heights, above - 0.5 * 9.81 * times**2, atol=1e-12)


def test_not_normalised_a_quaternion_grows_and_turns_the_same() -> None:
    times = STEP * np.arange(121)
    spin = np.array([1.0, 4.0, 2.0])

    grown, spins = tumble(INERTIA, NO_TURN, spin, times, TURN_RULES["not normalised"])
    kept, others = tumble(INERTIA, NO_TURN, spin, times, TURN_RULES["normalised"])

    speeds = np.linalg.norm(spins[1:], axis=1)
    factors = np.sqrt(1.0 + (0.5 * STEP * speeds) ** 2)
    lengths = np.linalg.norm(grown, axis=1)
    np.testing.assert_allclose(lengths[1:], np.cumprod(factors), rtol=1e-12)
    assert lengths[-1] > 1.05
    assert rotations.angle_between(rotations.normalised(grown), kept).max() < 1e-9
    np.testing.assert_allclose(spins, others, atol=1e-9)


def test_about_a_principal_axis_the_exponential_map_is_exact_and_the_other_one_late() -> None:
    times, speed = STEP * np.arange(61), 5.0
    spin = np.array([0.0, 0.0, speed])

    exact, _ = tumble(INERTIA, NO_TURN, spin, times, TURN_RULES["exponential map"])
    late, _ = tumble(INERTIA, NO_TURN, spin, times, TURN_RULES["normalised"])

    turned = np.array([rotations.about_z(speed * time) for time in times])
    assert rotations.angle_between(exact, turned).max() < 1e-12
    angles = 2.0 * np.arctan(0.5 * STEP * speed) * np.arange(61)
    turned = np.array([rotations.about_z(angle) for angle in angles])
    assert rotations.angle_between(late, turned).max() < 1e-12


@pytest.mark.parametrize("name", TURN_RULES)
def test_a_rules_own_ticks_are_not_off_it(name: str) -> None:
    times = STEP * np.arange(31)
    rule = TURN_RULES[name]
    turns, spins = tumble(INERTIA, NO_TURN, np.array([1.0, 4.0, 2.0]), times, rule)
    turns = rotations.normalised(turns)
    nowhere = np.zeros((31, 3))
    in_body = rotations.rotate(rotations.conjugate(turns), spins)
    motion = RigidBodyMotion(nowhere, turns, nowhere, in_body)

    off = {other: float(ticks_off(each, motion, STEP).max()) for other, each in TURN_RULES.items()}

    same = {"not normalised", "normalised"}  # of a tick, apart from the length
    assert all(
        (angle < 1e-12) == (other == name or {other, name} == same) for other, angle in off.items()
    )


def test_energy_and_momentum_are_those_of_each_axis() -> None:
    turn = rotations.exp(np.array([[0.0, 0.0, 0.5 * np.pi]]))  # the body's x is the world's y

    energy, momentum = energy_and_momentum(INERTIA, 2.0 * turn, np.array([[0.0, 3.0, 0.0]]))

    assert energy[0] == pytest.approx(0.5 * 0.3 * 9.0)
    np.testing.assert_allclose(momentum[0], [0.0, 0.9, 0.0], atol=1e-12)


# The study


def test_the_engines_do_the_semi_implicit_step_with_the_exponential_map(
    result: StudyResult,
) -> None:
    for engine in INSTALLED_ENGINES:
        column = f"{engine} off (rad)"
        for row in result.rows:
            if row["step"] == "exponential map":
                assert row[column] < 1e-12
            elif row[column] is not None:
                assert row[column] > 1e-9


def test_each_step_is_of_first_order(result: StudyResult) -> None:
    steps = 1.0 / np.array(integrators._RATES[1:])

    assert {*TURN_RULES, *INSTALLED_ENGINES} == set(result.column("step"))
    for name in dict.fromkeys(result.column("step")):
        off = [row["turn off (rad)"] for row in result.rows if row["step"] == name]
        assert order_of(steps, off[1:]) == pytest.approx(1.0, abs=0.1), name


def test_a_point_in_an_engine_moves_by_the_semi_implicit_step(result: StudyResult) -> None:
    spring, fall, *_ = result.figures["integrators"].axes
    for axes in (spring, fall):
        lines = {str(line.get_label()).partition(":")[0]: line for line in axes.lines}
        theory = np.asarray(lines["semi-implicit"].get_ydata())
        for engine in INSTALLED_ENGINES:
            np.testing.assert_allclose(np.asarray(lines[engine].get_ydata()), theory, atol=1e-9)


def test_the_study_asks_for_as_many_runs_as_it_says(
    result: StudyResult, runner: InProcessRunner
) -> None:
    assert len({case.label for case in runner.cases}) == len(runner.cases) == integrators.RUNS
    assert set(result.figures) == {"integrators"}
