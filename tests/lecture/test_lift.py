"""The study `lift`: its closed forms against one another, and its runs against them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lecture import lift
from lecture.framework.result import StudyResult
from lecture.theory import second_order
from lecture.theory.lift_responses import LiftLaw, Response, find_bound
from msgs_config.arrays import FloatArray
from tests.support.in_process import InProcessRunner

pytestmark = pytest.mark.slow

PERIOD, STEP = 1.0 / 240.0, 1e-3
TIMES = np.arange(0.0, 3.0, STEP)


@pytest.fixture(scope="module")
def result(runner: InProcessRunner) -> StudyResult:
    return runner.study("lift")


# The maths


@given(st.floats(10.0, 1000.0), st.floats(0.0, 3.0), st.floats(0.5, 5.0), st.floats(0.0, 20.0))
def test_a_step_response_obeys_its_differential_equation(
    stiffness: float, ratio: float, mass: float, load: float
) -> None:
    # Arrange
    damping = ratio * second_order.critical_damping(stiffness, mass)

    # Act
    x = second_order.step_response(TIMES, stiffness, damping, mass, load)

    # Assert: m a = kp (1 - x) - kd v - load, by central differences; it begins at rest at 0
    speed, acceleration = (x[2:] - x[:-2]) / (2 * STEP), np.diff(x, 2) / STEP**2
    force = stiffness * (1.0 - x[1:-1]) - damping * speed - load
    np.testing.assert_allclose(mass * acceleration, force, atol=0.03 * (stiffness + load))
    assert x[0] == pytest.approx(0.0, abs=1e-9)
    assert abs(x[1]) < 2.0 * (stiffness + load) / mass * STEP**2


@pytest.mark.parametrize("ratio", [0.0, 0.05, 0.3, 0.8, 1.5, 3.0])
def test_what_is_identified_is_what_the_oscillation_was_made_of(ratio: float) -> None:
    x = second_order.step_response(TIMES, 100.0, ratio * 20.0, 1.0, 9.81)

    found = second_order.identify(x, STEP)

    assert found.damping_ratio == pytest.approx(ratio, abs=1e-4)
    assert found.frequency == pytest.approx(10.0, rel=1e-4)
    assert found.rest == pytest.approx(1.0 - 0.0981, rel=1e-4)


@pytest.mark.parametrize("ratio", [0.05, 0.3, 0.6, 1.0, 2.0])
def test_a_step_response_overshoots_as_theory_says(ratio: float) -> None:
    x = second_order.step_response(TIMES, 100.0, ratio * 20.0, 1.0, 9.81)

    measured = second_order.measured_overshoot(x, 1.0 - 0.0981)

    assert measured == pytest.approx(second_order.overshoot(ratio), abs=1e-3)


def test_the_settling_time_is_when_the_band_is_left_for_the_last_time() -> None:
    times = np.arange(6.0)

    assert second_order.settling_time(times, np.array([0, 1, 1.5, 1, 1.01, 1.0]), 1.0) == 3.0
    assert second_order.settling_time(times, np.array([0, 1, 1, 1, 1, 1.5]), 1.0) is None


def spectral_radius(matrix: list[list[float]]) -> float:
    return float(np.abs(np.linalg.eigvals(np.array(matrix))).max())


def explicit_radius(kp: float, kd: float, h: float) -> float:
    """Of a tick of semi-implicit Euler on 1 kg, (x, v) before to (x, v) after."""
    a, b = -h * kp, 1.0 - h * kd
    return spectral_radius([[1.0 + h * a, h * b], [a, b]])


def stable_pd_radius(kp: float, kd: float, h: float) -> float:
    """Likewise, with the acceleration `(-kp (x + h v) - kd v) / (1 + kd h)`."""
    implicit = 1.0 + kd * h
    return explicit_radius(kp / implicit, (kp * h + kd) / implicit, h)


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_the_bounds_for_critical_damping_are_those_of_its_gains(share: float) -> None:
    for largest, is_stable in (
        (second_order.largest_explicit_stiffness, second_order.explicit_is_stable),
        (second_order.largest_stable_pd_stiffness, second_order.stable_pd_is_stable),
    ):
        stiffness = share * largest(1.0, PERIOD)
        damping = second_order.critical_damping(stiffness, 1.0)
        assert is_stable(stiffness, damping, 1.0, PERIOD) == (share < 1.0)


@given(st.floats(0.01, 10.0), st.floats(0.01, 5.0))
def test_the_bounds_are_those_of_the_recurrences(stiffness: float, damping: float) -> None:
    """In units of m / h^2 and m / h."""
    kp, kd = stiffness / PERIOD**2, damping / PERIOD
    for is_stable, radius in (
        (second_order.explicit_is_stable, explicit_radius),
        (second_order.stable_pd_is_stable, stable_pd_radius),
    ):
        largest = radius(kp, kd, PERIOD)
        if abs(largest - 1.0) > 1e-6:
            assert is_stable(kp, kd, 1.0, PERIOD) == (largest < 1.0)


def test_pid_is_unstable_where_a_root_has_a_positive_real_part() -> None:
    limit = second_order.largest_integral_gain(100.0, 20.0, 2.0)

    for share in (0.99, 1.01):
        roots = np.roots([2.0, 20.0, 100.0, share * limit])
        assert (roots.real.max() < 0.0) == (share < 1.0)


def test_a_bound_is_found_between_the_stable_and_the_unstable() -> None:
    """By responses that grow or decay as `share - 1` says of a bound that is not theory's."""

    def respond(gains: LiftLaw) -> Response:
        growth = gains.stiffness / 1100.0 - 1.0
        height: FloatArray = 1.0 + np.exp(5.0 * growth * TIMES) * np.cos(20.0 * TIMES)
        return Response(gains, TIMES, height, diverged=False)

    bound = find_bound(respond, "pd_gravity", 1000.0)

    assert bound.found == pytest.approx(1100.0, rel=0.05)
    assert bound.below.gains.stiffness < 1100.0 < bound.above.gains.stiffness


# The runs


def test_every_row_is_what_theory_says(result: StudyResult) -> None:
    for row in result.rows:
        stable, _, by_theory = str(row["stable / by theory"]).partition(" / ")
        assert stable == by_theory, row
        if stable == "yes" and row["law"] != "pid":
            theory = row["error by theory (m)"]
            assert row["steady-state error (m)"] == pytest.approx(theory, rel=0.01, abs=1e-6)
        if row["damping ratio"] is not None:  # explicit PD at 240 Hz is no continuous time
            share = 0.03 + row["kd (N s/m)"] * PERIOD / 2.0
            theory = pytest.approx(row["ratio by theory"], rel=share, abs=1e-9)
            assert row["damping ratio"] == theory


def test_the_table_has_what_the_lecture_shows(result: StudyResult) -> None:
    columns = ("law", "kp (N/m)", "kd (N s/m)", "ki (N/(m s))")
    by_gains = {tuple(row[column] for column in columns): row for row in result.rows}
    overshoot = {gains: row["overshoot (%)"] for gains, row in by_gains.items()}

    assert overshoot["p", 100, 0, 0] == pytest.approx(100.0, abs=0.1)
    assert by_gains["p", 100, 0, 0]["settling time (s)"] is None
    assert overshoot["pd", 100, 4, 0] == pytest.approx(100.0 * second_order.overshoot(0.2), abs=1.0)
    assert overshoot["pd", 100, 20, 0] < 0.5
    assert overshoot["pd", 100, 60, 0] == 0.0
    assert by_gains["pid", 100, 20, 200]["steady-state error (m)"] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("law", "bound"), [("pd", (2 * math.sqrt(2) - 2) ** 2), ("stable_pd", 4.0)]
)
def test_the_bounds_are_found_within_five_percent(
    result: StudyResult, law: str, bound: float
) -> None:
    """For critical damping, in units of m / h^2; just below it is stable, just above it is not."""
    stiff = [r for r in result.rows if r["law"] == law and r["overshoot (%)"] is None]
    below, above = (float(str(r["kp (N/m)"])) * PERIOD**2 for r in stiff)

    assert below < bound < above
    assert above / below < 1.06
    assert math.sqrt(below * above) == pytest.approx(bound, rel=0.05)


def test_the_study_asks_for_as_many_runs_as_it_says_each_with_its_own_label(
    result: StudyResult, runner: InProcessRunner
) -> None:
    labels = [case.label for case in runner.cases]

    assert len(labels) == len(set(labels)) == lift.RUNS
    assert all(case.simulator["initial_position"] == [0.0] for case in runner.cases)
    assert set(result.figures) == {"lift_laws", "lift_error", "lift_stability"}


def test_the_figures_draw_what_was_simulated(result: StudyResult) -> None:
    figure = result.figures["lift_error"]
    (axes,) = figure.axes
    lines = {str(line.get_label()): np.asarray(line.get_xydata()) for line in axes.lines}
    for law in ("pd", "stable_pd"):
        np.testing.assert_allclose(lines[law][:, 0] * lines[law][:, 1], 9.81, rtol=0.01)
    np.testing.assert_allclose(lines["m g / kp"].prod(axis=1), 9.81)

    assert {curve[0] for curve in result.curves["lift_heights"].values()} == {0.0}
