"""The control laws by name against the closed forms of theory, through the controller's ticks."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from controller_node.controller import Controller
from controller_node.effort_series import write_effort_series
from lecture.theory import second_order
from lecture.theory.second_order import critical_damping, identify
from msgs_config.arrays import FloatArray
from msgs_config.errors import SimulationError
from msgs_config.messages.state import StampedState
from tests.support.physics import LoneSimulation, character, controller, run_together, simulation

MASS, GRAVITY, RATE, FAST = 1.0, 9.81, 240, 2000  # kg, m/s^2, Hz, Hz
WEIGHT, PERIOD = MASS * GRAVITY, 1.0 / RATE
ARM = [f"panda_joint{number}" for number in range(1, 8)]
ARMS = ["franka_panda", "kuka"]


def driver(
    law: str, kp: float, kd: float, ki: float = 0.0, *, rate: int = RATE, **more: object
) -> Controller:
    """A controller of the lift with these gains, whose target is 1 m."""
    gains = {"gains.height.p": kp, "gains.height.d": kd, "gains.height.i": ki}
    return controller("lift", law=law, rate=rate, **gains, **more)


def heights(
    by: Controller, seconds: float, *, rate: int = RATE, start: float = 0.0, gravity: float = 9.81
) -> FloatArray:
    """The height (t,) of the mass at each tick, from rest at `start`."""
    with simulation("lift", rate=rate, initial_position=[start], gravity=gravity) as run:
        ticks = run_together(run, by, round(seconds * rate))
        return np.array([state.position[0] for state, _, _ in ticks])


def is_stable(by: Controller, seconds: float = 1.5, *, rate: int = RATE) -> bool:
    """Whether the mass comes nearer to its rest, rather than farther from it."""
    try:
        track = heights(by, seconds, rate=rate, start=0.9)
    except SimulationError:
        return False
    return not second_order.swings_wider(track, float(track.mean()))


def largest_stable(by: Callable[[float], Controller], low: float, high: float) -> float:
    """The stiffness between a stable and an unstable one at which stability ends."""
    assert is_stable(by(low))
    assert not is_stable(by(high))
    while high - low > 0.02 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_stable(by(middle)) else (low, middle)
    return 0.5 * (low + high)


# PD: steady-state error, damping, stability


@pytest.mark.parametrize("law", ["pd", "stable_pd"])
@pytest.mark.parametrize("stiffness", [25.0, 100.0, 1600.0])
def test_pd_hangs_below_its_target_by_weight_over_stiffness(law: str, stiffness: float) -> None:
    track = heights(driver(law, stiffness, critical_damping(stiffness, MASS)), 4.0)

    assert 1.0 - track[-1] == pytest.approx(WEIGHT / stiffness, rel=0.01)


def test_gravity_compensation_leaves_no_steady_state_error() -> None:
    track = heights(driver("pd_gravity", 100.0, 20.0), 3.0)

    assert track[-1] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("law", ["pd", "stable_pd"])
def test_critical_damping_does_not_overshoot_and_less_does(law: str) -> None:
    def overshoot(damping: float) -> float:
        track = heights(driver(law, 100.0, damping, rate=FAST), 2.0, rate=FAST)
        return second_order.measured_overshoot(track, 1.0 - WEIGHT / 100.0)

    assert overshoot(20.0) < 0.005
    assert overshoot(10.0) == pytest.approx(second_order.overshoot(0.5), rel=0.03)


@pytest.mark.parametrize("damping", [2.0, 6.0, 12.0])
def test_explicit_pd_has_the_damping_ratio_of_theory(damping: float) -> None:
    track = heights(driver("pd", 100.0, damping, rate=FAST), 1.0, rate=FAST)

    found = identify(track, 1.0 / FAST)

    assert found.damping_ratio == pytest.approx(damping / 20.0, rel=0.03)
    assert found.frequency == pytest.approx(10.0, rel=0.03)


@pytest.mark.parametrize("damping", [2.0, 4.0, 6.0])
def test_stable_pd_has_the_damping_ratio_of_its_closed_form(damping: float) -> None:
    track = heights(driver("stable_pd", 100.0, damping), 1.0)

    ratio = (damping + 100.0 * PERIOD) / (2.0 * np.sqrt(100.0 * (MASS + damping * PERIOD)))
    assert identify(track, PERIOD).damping_ratio == pytest.approx(ratio, rel=0.03)
    assert abs(ratio / (damping / 20.0) - 1.0) > 0.03  # it is not that of continuous time


@pytest.mark.parametrize("damping", [20.0, 240.0])
def test_explicit_pd_is_stable_up_to_its_bound(damping: float) -> None:
    """`kp h^2 + 2 kd h < 4 m`."""
    bound = (4.0 * MASS - 2.0 * damping * PERIOD) / PERIOD**2

    found = largest_stable(lambda kp: driver("pd", kp, damping), 0.7 * bound, 1.4 * bound)

    assert found == pytest.approx(bound, rel=0.05)


@pytest.mark.parametrize("damping", [20.0, 240.0])
def test_stable_pd_is_stable_up_to_its_bound(damping: float) -> None:
    """`3 kp h^2 < 4 m + 2 kd h`."""
    bound = (4.0 * MASS + 2.0 * damping * PERIOD) / (3.0 * PERIOD**2)

    found = largest_stable(lambda kp: driver("stable_pd", kp, damping), 0.7 * bound, 1.4 * bound)

    assert found == pytest.approx(bound, rel=0.05)


def test_p_swings_forever() -> None:
    track = heights(driver("p", 100.0, 20.0), 30.0)

    way = 1.0 - WEIGHT / 100.0
    for part in (track[: 2 * RATE], track[-2 * RATE :]):
        assert part.max() == pytest.approx(2.0 * way, rel=0.002)
        assert part.min() == pytest.approx(0.0, abs=0.002 * way)


def test_nothing_drives_a_ragdoll() -> None:
    with simulation("kuka", rate=RATE) as run:
        efforts = [effort for _, effort, _ in run_together(run, controller("kuka", law="zero"), 60)]
        fallen = run.state

    np.testing.assert_array_equal(efforts, np.zeros((60, 7)))
    assert np.abs(fallen.velocity).max() > 0.5


# PID


def test_pid_leaves_no_steady_state_error() -> None:
    track = heights(driver("pid", 100.0, 20.0, 200.0), 6.0)

    assert track[-1] == pytest.approx(1.0, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "stable"), [(0.95, True), (1.05, False)])
def test_pid_is_stable_up_to_its_bound(share: float, stable: bool) -> None:
    """`0 < ki < kp kd / m`."""
    by = driver("pid", 100.0, 20.0, share * 100.0 * 20.0 / MASS, rate=FAST)

    assert is_stable(by, 8.0, rate=FAST) is stable


def test_the_integral_does_not_wind_up_against_an_effort_limit() -> None:
    """A limit just above the weight: the way up takes seconds, in which the error adds up."""
    kp, kd, ki, limit = 100.0, 20.0, 200.0, 1.05 * WEIGHT
    limited = {"effort_limit.height": limit}
    with_it = heights(driver("pid", kp, kd, ki, **limited), 12.0)

    def naive(seconds: float) -> FloatArray:
        track, integral = [], 0.0
        with simulation("lift", rate=RATE, initial_position=[0.0]) as run:
            for _ in range(round(seconds * RATE)):
                height, speed = run.state.position[0], run.state.velocity[0]
                track.append(height)
                integral += (1.0 - height) * PERIOD
                effort = kp * (1.0 - height) - kd * speed + ki * integral
                run.advance(np.clip([effort], -limit, limit))
        return np.array(track)

    beyond, naively = with_it.max() - 1.0, naive(12.0).max() - 1.0
    assert naively > 1.0
    assert beyond < 0.2 * naively
    assert with_it[-1] == pytest.approx(1.0, abs=0.01)


def state_at(stamp_ns: int, height: float) -> StampedState:
    return StampedState(stamp_ns, np.array([height]), np.zeros(1), None)


def test_the_integral_begins_at_zero_with_an_episode() -> None:
    by = driver("pid", 0.0, 0.0, 10.0)
    stamps = [by.clock.stamp_ns(tick) for tick in range(1, 20)]
    for stamp in stamps[:10]:
        effort, _ = by.compute_effort(state_at(stamp, 0.0), stamps[0])
    assert effort[0] == pytest.approx(10.0 * 9 * PERIOD, rel=1e-6)

    first, _ = by.compute_effort(state_at(stamps[10], 0.0), stamps[10])
    second, _ = by.compute_effort(state_at(stamps[11], 0.0), stamps[10])

    assert first[0] == 0.0
    assert second[0] == pytest.approx(10.0 * PERIOD, rel=1e-6)


def test_the_integral_begins_at_zero_though_the_first_states_of_the_episode_were_not_seen() -> None:
    """As in real time, where some are overtaken."""
    driver = controller("pendulum", law="pid", **{"gains.hinge.i": 100.0})
    clock, rest = driver.clock, np.array(character("pendulum").rest_position)

    def compute(position: FloatArray, tick: int, episode: int) -> float:
        state = StampedState(clock.stamp_ns(tick), position, np.zeros(1), np.zeros(1))
        return float(driver.compute_effort(state, clock.stamp_ns(episode))[0][0])

    for tick in range(1, 13):
        compute(rest - 0.5, tick, episode=1)

    assert compute(rest, 13, episode=1) > 1.0
    assert compute(rest, 13 + 15, episode=13) == 0.0


def test_the_same_state_twice_does_not_advance_the_integral() -> None:
    by = driver("pid", 0.0, 0.0, 10.0)
    stamps = [by.clock.stamp_ns(tick) for tick in range(1, 4)]
    efforts = [
        by.compute_effort(state_at(stamp, 0.0), stamps[0])[0][0]
        for stamp in (stamps[0], stamps[1], stamps[1], stamps[1], stamps[2])
    ]

    assert efforts[1] == efforts[2] == efforts[3]
    assert efforts[4] == pytest.approx(2.0 * efforts[1], rel=1e-6)


# Laws that know the dynamics


def moving_arm(name: str, by: Controller, rate: int) -> LoneSimulation:
    """An arm in the state that the controller's reference begins with."""
    first = by._own_reference.sample(0.0)
    return simulation(
        name,
        rate=rate,
        initial_position=first.configuration.position.tolist(),
        initial_velocity=first.velocity.tolist(),
    )


def test_computed_torque_tracks_a_sine_to_a_milliradian() -> None:
    # Arrange
    rate = 1000
    sine = {"signal.dofs": ARM, "sine.amplitude": 0.3, "sine.frequency": 0.5}
    by = controller("franka_panda", law="computed_torque", reference="sine", rate=rate, **sine)
    entries = character("franka_panda").layout.indices(tuple(ARM))

    # Act
    with moving_arm("franka_panda", by, rate) as run:
        errors = [
            np.abs(reference.position - state.position)[entries].max()
            for state, _, reference in run_together(run, by, 2 * rate)
        ]

    # Assert
    assert max(errors[rate // 5 :]) < 1e-3


@pytest.mark.parametrize("name", ARMS)
def test_gravity_compensation_alone_holds_an_arm_for_a_second(name: str) -> None:
    # Arrange
    alone = {"gain_scale.p": 0.0, "gain_scale.d": 0.0}
    by = controller(name, law="pd_gravity", rate=RATE, **alone)

    # Act
    with simulation(name, rate=RATE) as run:
        start = run.state.position
        for _ in run_together(run, by, RATE):
            pass
        moved = np.abs(run.state.position - start)

    # Assert
    assert moved.max() < 1e-3


def test_explicit_damping_is_too_much_for_a_light_wrist_and_implicit_is_not() -> None:
    """`2 kd h < 4 I`: 0.001 kg m^2 bear 0.5 N m s/rad at 240 Hz; the character has ten times it."""
    by = {law: controller("kuka", law=law, rate=RATE) for law in ("pd_gravity", "stable_pd")}

    for law, diverges in (("pd_gravity", True), ("stable_pd", False)):
        with simulation("kuka", rate=RATE, initial_velocity=[*(6 * [0.0]), 1e-3]) as run:
            try:
                for _ in run_together(run, by[law], RATE):
                    pass
            except SimulationError as error:
                assert diverges and "lbr_iiwa_joint_7" in str(error)
            else:
                assert not diverges


@pytest.mark.parametrize("name", ["kuka", "pendulum"])
def test_feedforward_plays_a_recorded_run_back_to_the_bit(name: str, tmp_path: Path) -> None:
    # Arrange
    sine = {"reference": "sine", "sine.amplitude": 0.3, "sine.frequency": 1.0}
    by = controller(name, law="computed_torque", rate=RATE, **sine)

    def run_with(by_which: Controller) -> tuple[FloatArray, FloatArray, FloatArray]:
        with moving_arm(name, by, RATE) as run:
            first_ns = run.state.stamp_ns
            ticks = list(run_together(run, by_which, 2 * RATE))
        times = np.array([state.stamp_ns - first_ns for state, _, _ in ticks]) / 1e9
        states = [np.concatenate([state.position, state.velocity]) for state, _, _ in ticks]
        return times, np.array(states), np.array([effort for _, effort, _ in ticks])

    times, states, efforts = run_with(by)
    file = tmp_path / "efforts.csv"
    write_effort_series(file, character(name).layout, times, efforts)

    # Act
    opened = controller(name, law="feedforward", feedforward=str(file), rate=RATE)
    _, states_again, efforts_again = run_with(opened)

    # Assert
    assert efforts_again.tobytes() == efforts.tobytes()
    assert states_again.tobytes() == states.tobytes()
    assert np.abs(np.diff(states, axis=0)).max() > 1e-3
