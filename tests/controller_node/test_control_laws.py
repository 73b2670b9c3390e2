"""The control laws against closed forms, and their stability bounds against the engine."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller_node.control_laws import anti_windup_mask, pd_effort, stable_pd_effort
from msgs_config.arrays import FloatArray
from msgs_config.errors import SimulationError
from sim_node.physics.simulation import Simulation
from tests.support.physics import DenseDynamics, character, simulation

MASS = 1.0  # kg, of the character `lift`
RATE = 240
PERIOD = 1.0 / RATE


Law = Callable[[FloatArray, FloatArray], FloatArray]
"""The effort (1,) on the mass at a height and a speed (1,)."""


def pd(stiffness: float, damping: float, target: float = 0.0) -> Law:
    """Explicit PD towards a height."""
    kp, kd = np.array([stiffness]), np.array([damping])
    return lambda height, speed: pd_effort(kp, kd, target - height, -speed)


def heights(run: Simulation, law: Law, ticks: int) -> FloatArray:
    """The height (ticks,) of the mass at each tick under a law."""
    result = np.empty(ticks)
    for tick in range(ticks):
        result[tick] = run.state.position[0]
        run.advance(law(run.state.position, run.state.velocity))
    return result


def is_stable(law: Law, substeps: int = 1) -> bool:
    """Whether a weightless mass off its target comes to it, rather than farther and farther."""
    with simulation(
        "lift", rate=RATE, substeps=substeps, gravity=0.0, initial_position=[0.01]
    ) as run:
        try:
            track = np.abs(heights(run, law, 400))
        except SimulationError:
            return False
    return bool(track[-40:].max() < track[:40].max())


def largest_stable(
    law_of: Callable[[float], Law], low: float, high: float, substeps: int = 1
) -> float:
    """The parameter between a stable and an unstable law at which stability ends."""
    assert is_stable(law_of(low), substeps)
    assert not is_stable(law_of(high), substeps)
    while high - low > 0.01 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_stable(law_of(middle), substeps) else (low, middle)
    return 0.5 * (low + high)


# --- closed forms --------------------------------------------------------------------------------


def test_pd_is_a_spring_and_a_damper() -> None:
    effort = pd_effort(
        np.array([100.0, 10.0]), np.array([20.0, 1.0]), np.array([0.5, -2.0]), np.array([1.0, 3.0])
    )

    np.testing.assert_array_equal(effort, [70.0, -17.0])


def test_stable_pd_on_one_mass_is_its_closed_form() -> None:
    # Arrange
    mass, weight, kp, kd, h = 2.0, 19.62, 300.0, 12.0, 0.01
    error, speed, reference_speed = 0.3, -0.7, 0.4

    # Act
    effort = stable_pd_effort(
        DenseDynamics(np.array([[mass]]), np.array([weight])),
        np.array([kp]),
        np.array([kd]),
        np.array([error]),
        np.array([speed]),
        np.array([reference_speed]),
        h,
    )

    # Assert
    spring_and_damper = kp * (error - h * speed) + kd * (reference_speed - speed)
    acceleration = (spring_and_damper - weight) / (mass + kd * h)
    assert effort[0] == pytest.approx(mass * acceleration + weight, rel=1e-12)


@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.floats(1e-4, 0.1))
def test_stable_pd_is_pd_at_the_state_that_it_leads_to(seed: int, size: int, period: float) -> None:
    # Arrange
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size))
    mass_matrix, bias = root @ root.T + 0.1 * np.eye(size), rng.normal(size=size)
    kp, kd = rng.uniform(0.0, 100.0, (2, size))
    error, velocity, reference_velocity = rng.normal(size=(3, size))

    # Act
    effort = stable_pd_effort(
        DenseDynamics(mass_matrix, bias), kp, kd, error, velocity, reference_velocity, period
    )

    # Assert: q + h v and v + h a are the state at the period's end, to the first order
    next_velocity = velocity + period * np.linalg.solve(mass_matrix, effort - bias)
    expected = pd_effort(kp, kd, error - period * velocity, reference_velocity - next_velocity)
    np.testing.assert_allclose(effort, expected, rtol=1e-6, atol=1e-6 * np.abs(effort).max())


def test_stable_pd_tends_to_pd_as_the_period_shrinks() -> None:
    rng = np.random.default_rng(1)
    kp, kd = rng.uniform(10.0, 100.0, (2, 3))
    error, velocity, reference_velocity, bias = rng.normal(size=(4, 3))

    model = DenseDynamics(np.diag([1.0, 2.0, 3.0]), bias)
    effort = stable_pd_effort(model, kp, kd, error, velocity, reference_velocity, 1e-9)

    np.testing.assert_allclose(
        effort, pd_effort(kp, kd, error, reference_velocity - velocity), rtol=1e-5
    )


def test_no_law_changes_its_inputs() -> None:
    # Arrange
    rng = np.random.default_rng(2)
    mass_matrix = np.diag([1.0, 2.0, 3.0])
    vectors = rng.normal(size=(6, 3))
    before = mass_matrix.copy(), vectors.copy()

    # Act
    pd_effort(*vectors[:4])
    stable_pd_effort(DenseDynamics(mass_matrix, vectors[0]), *vectors[1:], 0.01)

    # Assert
    np.testing.assert_array_equal(mass_matrix, before[0])
    np.testing.assert_array_equal(vectors, before[1])


# --- on the engine -------------------------------------------------------------------------------


def test_with_substeps_explicit_pd_needs_damping_too() -> None:
    """`kp H (n - 1) / (2 n) < kd`, since a held effort lags behind the substeps."""
    damping, substeps = 0.1 * MASS / PERIOD, 4
    bound = damping / PERIOD * 2.0 * substeps / (substeps - 1.0)

    stiffness = largest_stable(lambda kp: pd(kp, damping), 0.5 * bound, 2.0 * bound, substeps)

    assert stiffness == pytest.approx(bound, rel=0.05)


@pytest.mark.parametrize("excess", [1e-6, 0.5, 20.0])
def test_an_integral_waits_however_little_its_effort_is_beyond_the_limit(excess: float) -> None:
    layout, limit, error = character("lift").layout, np.array([10.0]), np.ones(1)

    assert anti_windup_mask(limit + excess, limit, error, layout).all()
    assert not anti_windup_mask(limit + excess, limit, -error, layout).any()
    assert not anti_windup_mask(limit, limit, error, layout).any()
