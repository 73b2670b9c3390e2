"""The studies of tracking: their measures against theory, and what the lecture expects of runs."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from actuated_characters.bags.recording import Recording
from controller_node.control_laws import stable_pd_effort
from lecture import assistance, clips, delay, gains
from lecture.framework.result import StudyResult
from lecture.framework.study import RunResult, RunSpec
from lecture.framework.tracking import (
    delayed_spectral_radius,
    inertialess_response,
    joint_errors,
    lag,
    overshoot,
)
from lecture.gains import step
from lecture.theory import second_order
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations
from sim_node.physics.settings import WorldSettings
from tests.support.engines import need_engine, pybullet
from tests.support.in_process import InProcessRunner
from tests.support.physics import LoneWorld, character

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

PERIOD = 1.0 / 240  # s
LEGS = [name.replace(" ", "_") for name in gains.FACTORS]


# The measures


@pytest.fixture(scope="module")
def few_ticks(runner: InProcessRunner) -> Recording:
    return runner.run(RunSpec("short", "humanoid", 0.02)).recording


def test_a_joints_error_is_the_angle_of_the_turn_between(few_ticks: Recording) -> None:
    layout, rng = few_ticks.layout, np.random.default_rng(4)
    position, angles = rng.uniform(-1.0, 1.0, few_ticks.position.shape), []
    desired = position.copy()
    for joint in layout.joints[1:]:
        angle = rng.uniform(0.1, 3.0)
        axis = rng.normal(size=3)
        if joint.rotation is None:
            desired[:, joint.start] -= angle
        else:
            turn = rotations.exp(angle * axis / np.linalg.norm(axis))
            turned = rotations.multiply(rotations.exp(position[:, joint.rotation]), turn)
            desired[:, joint.rotation] = rotations.log(turned)
        angles.append(angle)
    desired[:, :6] += 1.0  # the root is no joint

    errors = joint_errors(replace(few_ticks, position=position), desired)

    np.testing.assert_allclose(errors, np.tile(angles, (len(position), 1)), atol=1e-12)


@pytest.mark.parametrize("ratio", [0.1, 0.4, 0.7])
def test_overshoot_of_a_step_is_that_of_a_second_order_system(ratio: float) -> None:
    """exp(-pi z / sqrt(1 - z^2)) at damping ratio z (Ogata, Modern Control Engineering)."""
    damped = np.sqrt(1.0 - ratio**2)
    phase = np.linspace(0.0, 40.0, 100_000)
    decay = np.exp(-ratio * phase)
    response = 1.0 - decay * (np.cos(damped * phase) + ratio / damped * np.sin(damped * phase))
    step = np.ones_like(phase)
    step[0] = 0.0

    assert overshoot(response, step) == pytest.approx(np.exp(-np.pi * ratio / damped), rel=1e-6)
    assert overshoot(-response, -step) == pytest.approx(np.exp(-np.pi * ratio / damped), rel=1e-6)


def test_overshoot_is_negative_within_the_reference() -> None:
    reference = np.array([0.0, 2.0, 0.0, 2.0])

    assert overshoot(0.5 * reference + 0.5, reference) == pytest.approx(-0.25)


@pytest.mark.parametrize("late", [-0.0613, 0.0, 0.0021, 0.1, 0.2501])
def test_lag_of_a_signal_that_comes_late(late: float) -> None:
    """Also by a part of a sample, smaller, and about another mean."""
    times = np.linspace(0.0, 960 * PERIOD, 960, endpoint=False)

    def signal(time: FloatArray) -> FloatArray:
        return np.sin(5.0 * time) + 0.4 * np.sin(10.0 * time + 1.0)

    assert lag(0.3 * signal(times - late) - 2.0, signal(times), PERIOD, 0.4) == pytest.approx(
        late, abs=1e-4
    )


@pytest.mark.parametrize("time_constant", [0.01, 0.1, 1.0])
@pytest.mark.parametrize("follows", [True, False])
def test_a_joint_without_inertia_lags_as_a_first_order_filter(
    time_constant: float, follows: bool
) -> None:
    """T (q(k) - q(k-1)) / h + q(k) = r(k), and T r'(k) on the right if the velocity is followed."""
    speed = 5.0  # rad/s
    times = np.arange(0.0, 30.0, PERIOD)
    reference, velocity = np.sin(speed * times), speed * np.cos(speed * times)

    angle = inertialess_response(
        reference, velocity if follows else 0.0 * velocity, 500.0, 500.0 * time_constant, PERIOD
    )

    settled = times > 15.0
    measured = lag(angle[settled], reference[settled], PERIOD, 0.4)
    filtered = 1.0 + time_constant * (1.0 - np.exp(-1j * speed * PERIOD)) / PERIOD
    desired = 1.0 + 1j * speed * time_constant * follows
    late = (np.angle(filtered) - np.angle(desired)) / speed
    assert measured == pytest.approx(late, abs=1e-4)  # s; samples are 4 ms apart


@pytest.mark.parametrize("delay_ticks", [1, 2, 3, 4])
def test_delayed_damping_is_stable_up_to_the_bound_of_levin_and_may(delay_ticks: int) -> None:
    """v(k+1) = v(k) - a v(k-d) is stable for 0 < a < 2 cos(d pi / (2 d + 1)) (1976)."""
    bound = 2.0 * np.cos(delay_ticks * np.pi / (2 * delay_ticks + 1))
    for factor in (0.97, 1.03):
        share = factor * bound  # of a = kd h / (m + kd h), which is below 1
        if share >= 1.0:
            continue
        damping = share / (1.0 - share) / PERIOD
        radius = delayed_spectral_radius(
            np.eye(1), np.zeros(1), np.array([damping]), PERIOD, delay_ticks=delay_ticks
        )
        assert (radius > 1.0 + 1e-9) == (factor > 1.0)  # 1: where it stands is free


@pytest.mark.parametrize(("delay_ticks", "substeps"), [(0, 1), (1, 1), (2, 4), (4, 3)])
def test_growth_is_that_of_the_controllers_own_law_stepped_with_delay(
    delay_ticks: int, substeps: int
) -> None:
    rng = np.random.default_rng(7)
    root = rng.normal(size=(3, 3))
    mass = root @ root.T + 0.1 * np.eye(3)
    stiffness, damping = np.array([500.0, 100.0, 900.0]), np.array([50.0, 5.0, 20.0])
    # position, velocity, and the efforts that have still to act, the next one first
    state = np.zeros((2 + delay_ticks, 3))
    state[0] = rng.normal(size=3)
    sizes = np.zeros(3000)

    class Model:
        """The mass matrix alone."""

        def solve(self, force: FloatArray, added: FloatArray, period: float) -> FloatArray:
            return np.array(np.linalg.solve(mass + np.diag(added), force), dtype=float)

        def bias_force(self) -> FloatArray:
            return np.zeros(3)

    for tick in range(len(sizes)):
        position, velocity, *queued = state
        gains = stiffness, damping
        effort = stable_pd_effort(Model(), *gains, -position, velocity, np.zeros(3), PERIOD)
        acting, *queued = *queued, effort
        for _ in range(substeps):
            velocity = velocity + np.linalg.solve(mass, acting) * PERIOD / substeps
            position = position + velocity * PERIOD / substeps
        size = np.linalg.norm([position, velocity])
        state = np.array([position, velocity, *queued]) / size
        sizes[tick] = np.log(size)

    radius = delayed_spectral_radius(
        mass, stiffness, damping, PERIOD, delay_ticks=delay_ticks, substeps=substeps
    )

    assert np.log(radius) == pytest.approx(sizes[1000:].mean(), abs=2e-3)


def test_clearances_are_the_engines_distances_to_the_ground() -> None:
    need_engine("bullet")
    whole = character("humanoid")
    rng = np.random.default_rng(2)
    position = np.array(whole.rest_position)
    position[2:] += rng.uniform(-0.3, 0.3, whole.layout.size - 2)
    position[2] = 2.0
    heights = clips.clearances(whole, position[np.newaxis])

    world = LoneWorld(whole, WorldSettings())
    with world:
        world.body.set_state(position, np.zeros(whole.layout.size))
        client, body = world.body._client, world.body._body
        ground = 0  # the plane, which was loaded first
        pybullet.performCollisionDetection(physicsClientId=client)
        count = pybullet.getNumJoints(body, physicsClientId=client)
        infos = [pybullet.getJointInfo(body, k, physicsClientId=client) for k in range(count)]
        numbers = {info[12].decode(): info[0] for info in infos}
        for name, height in heights.items():
            found = pybullet.getClosestPoints(
                body, ground, 10.0, linkIndexA=numbers[name], physicsClientId=client
            )
            assert height[0] == pytest.approx(min(point[8] for point in found), abs=1e-4)


# What the lecture expects of runs


def by_key(result: StudyResult, keys: int) -> Mapping[tuple[Any, ...], dict[str, Any]]:
    """The table's rows by their first cells, each by the names of its columns."""
    return {tuple(row.values())[:keys]: dict(row) for row in result.rows}


@pytest.mark.nightly
def test_gains(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gains, "_DURATION", 2.5)
    monkeypatch.setattr(gains, "_PICTURES", 1)
    monkeypatch.setattr(step, "_POSES", (0.5,))
    runner = InProcessRunner(tmp_path)

    result = runner.study("gains")

    table = by_key(result, 2)
    error, late, theory = "joint error (rad)", "knee lag (ms)", "by theory (ms)"
    following = {name: table[name, "clip"] for name, _ in table}
    normal = following["normal stiffness"]
    assert following["small stiffness"][error] > 2.0 * normal[error]
    assert following["large stiffness"][error] < 0.5 * normal[error]
    assert following["large damping"][error] > 2.0 * normal[error]
    # efforts at their limits are not those that stable PD counts on: stiff legs that bear the
    # weight then come to nothing
    ended = {name for name, row in following.items() if row[late] is None}
    assert ended <= {"large stiffness"}
    assert all("diverged" in remark for remark in result.remarks[2:])
    assert all(abs(row[late]) < 30.0 for name, row in following.items() if name not in ended)
    # without the reference's velocity it lags by what the damping holds back, and by the weight
    light, heavy = table["small damping", "zero"], table["normal stiffness", "zero"]
    assert light[late] == pytest.approx(light[theory], abs=15.0)
    assert heavy[theory] < heavy[late] < 2.0 * heavy[theory]
    assert heavy[error] > following["normal stiffness"][error]
    assert heavy[late] > 60.0
    assert len(runner.cases) == gains.RUNS
    assert set(result.figures) == {"gains", "gains_poses", "gains_step", "gains_step_poses"}
    # at once: the softest sags, the least damped swings, the most damped creeps
    curves = result.curves["gains_step"]
    times, angle = curves["time_s"], {name: curves[f"{name}_rad"] for name in LEGS}
    late = times > 2.5
    assert angle["small_stiffness"][late].mean() < 0.8 * angle["normal_stiffness"][late].mean()
    assert angle["small_damping"].max() > 1.35 * angle["small_damping"][late].mean()
    assert angle["normal_damping"].max() < 1.1 * angle["normal_damping"][late].mean()
    reached = {name: times[each > 0.5 * each[late].mean()][0] for name, each in angle.items()}
    assert reached["large_stiffness"] < 0.5 * reached["normal_stiffness"]
    assert reached["large_damping"] > 3.0 * reached["normal_damping"]


@pytest.mark.parametrize("damping", [0.1, 0.3, 1.0])
def test_the_linear_response_of_one_mass_is_that_of_stable_pd(damping: float) -> None:
    mass = character("lift")
    ratio = second_order.stable_pd_damping_ratio(100.0, 20.0 * damping, 1.0, PERIOD)

    path = step.linear_response(mass, np.ones(1), np.zeros(1), (1.0, damping), 700)[:, 0]

    # the recurrence is of first order in h, so it is damped a little more than the equation
    assert second_order.identify(path, PERIOD).damping_ratio == pytest.approx(ratio, rel=0.1)
    beyond = second_order.measured_overshoot(path, 1.0)
    assert beyond == pytest.approx(second_order.overshoot(ratio), abs=0.03)


def test_a_step_overshoots_as_the_linear_whole_body_does(tmp_path: Path) -> None:
    every = [(1.0, 1.0), (10.0, 1.0), (1.0, 0.1)]
    runs = step.run_steps(InProcessRunner(tmp_path), every)

    for factors, run in runs.items():
        found = step.measure(run, factors)
        expected = found.overshoot(found.theory)
        assert found.overshoot(found.angle) == pytest.approx(expected, abs=0.05)
        assert (expected > 0.4) == (factors == (1.0, 0.1))


@pytest.mark.nightly
def test_delay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(delay, "_DURATION", 1.0)
    monkeypatch.setattr(delay, "_RATES", (240, 960))
    monkeypatch.setattr(delay, "_DELAYS", (0, 1, 4))

    result = InProcessRunner(tmp_path).study("delay")

    table = by_key(result, 2)
    error, growth = "mean joint error (rad)", "growth a tick by theory"
    stable = {key for key, row in table.items() if row[growth] < 1.0}
    assert stable == {(240, 0), (960, 0), (960, 1)}
    assert all(table[key][error] < 0.1 for key in stable)
    for rate, late in set(table) - stable:
        assert table[rate, late][error] > 1.3 * table[rate, 0][error]
    assert [key for key, row in table.items() if row["diverged"]] == [(240, 4), (960, 4)]
    assert table[240, 4]["delay (ms)"] == pytest.approx(1000.0 / 60.0)


def test_assistance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(assistance, "_DURATION", 1.5)
    monkeypatch.setattr(assistance, "_STRENGTHS", (1.0, 0.01, 0.0))
    monkeypatch.setattr(assistance, "_PICTURES", 1)
    runner = InProcessRunner(tmp_path)

    result = runner.study("assistance")

    table = by_key(result, 1)
    falls, force = "falls at (s)", "root force / weight until then"
    assert table["x 1",][falls] is None
    assert 0.5 < table["none",][falls] <= table["x 0.01",][falls] < 1.2
    assert table["x 1",][force] > table["x 0.01",][force] > 0.0
    assert table["none",][force] == 0.0
    # a root that is commanded, by nothing, and one that may not be
    assert list(table["x 0",].values())[1:] == list(table["none",].values())[1:]
    assert any("the same states" in note for note in result.remarks)


def test_weaker_assistance_keeps_its_damping_ratio() -> None:
    whole = character("humanoid")
    full, weak = (assistance.weakened(whole, strength) for strength in (1.0, 0.04))

    for name in ("root", "root_r"):
        p, d = f"gains.{name}.p", f"gains.{name}.d"
        assert full[p] == whole.gains[name].stiffness
        assert weak[p] == pytest.approx(0.04 * full[p])
        # kd^2 / kp
        assert weak[d] ** 2 / weak[p] == pytest.approx(full[d] ** 2 / full[p])


def test_clips(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clips, "_DURATION", 3.0)
    monkeypatch.setattr(clips, "_PICTURES", 1)
    monkeypatch.setattr(clips, "available_clips", lambda _: ["crawl", "kick", "walk"])

    result = InProcessRunner(tmp_path).study("clips")

    table = by_key(result, 1)
    for row in table.values():
        assert 0.01 < row["mean joint error (rad)"] <= row["bound (rad)"]
        assert row["largest joint error (rad)"] > row["mean joint error (rad)"]
        assert row["fell"] is False
    assert {clip for (clip,), row in table.items() if row["down in the capture"]} == {"crawl"}
    assert {clip for (clip,), row in table.items() if row["loops"]} == {"crawl", "walk"}


def test_a_clip_without_assistance_is_told_to_fall(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = character("humanoid")
    runner = InProcessRunner(tmp_path)
    run = runner.run

    def unassisted(case: RunSpec) -> RunResult:
        return run(replace(case, duration=1.5, controller={"root_assistance": False}))

    monkeypatch.setattr(runner, "run", unassisted)

    assert clips._row(whole, "walk", clips._track(runner, "walk"))["fell"]
