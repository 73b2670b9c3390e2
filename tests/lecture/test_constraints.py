"""The study `constraints`: its joint against MuJoCo's, its steps against the continuous motion."""

import mujoco
import numpy as np
import pytest

from lecture import constraints
from lecture.framework.result import StudyResult
from lecture.theory.euler import order_of
from lecture.theory.maximal import (
    JointedBody,
    PairState,
    cross_matrix,
    gaps,
    joint_force,
    make_equations,
    move_pair,
    step_pair,
)
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations
from tests.support.in_process import InProcessRunner

pytestmark = pytest.mark.slow

GRAVITY = 9.81
BODIES = [
    JointedBody(2.0, np.array([0.3, 0.2, 0.1]), (0.1, 0.0, -0.4)),
    JointedBody(1.5, np.array([0.15, 0.2, 0.3]), (0.0, 0.05, 0.3)),
]
MUJOCO_WORDS = """
<mujoco>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="first">
      <freejoint/>
      <inertial pos="0 0 0" mass="2" diaginertia="0.3 0.2 0.1"/>
      <body name="second" pos="0.1 0 -0.4">
        <joint type="ball"/>
        <inertial pos="0 -0.05 -0.3" mass="1.5" diaginertia="0.15 0.2 0.3"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def result(runner: InProcessRunner) -> StudyResult:
    return runner.study("constraints")


def moving(seed: int) -> tuple[PairState, FloatArray]:
    """Both bodies in a random state of MuJoCo's model, and the force that its joint transmits."""
    rng = np.random.default_rng(seed)
    model = mujoco.MjModel.from_xml_string(MUJOCO_WORDS)
    data = mujoco.MjData(model)
    data.qpos[:3] = rng.normal(size=3)
    for start in (3, 7):
        turn = rng.normal(size=4)
        data.qpos[start : start + 4] = turn / np.linalg.norm(turn)
    data.qvel[:] = 2.0 * rng.normal(size=9)
    mujoco.mj_forward(model, data)
    mujoco.mj_rnePostConstraint(model, data)
    velocity = np.zeros((2, 6))
    for row in range(2):
        own = np.zeros((6, 9))
        mujoco.mj_jacBodyCom(model, data, own[:3], own[3:], row + 1)
        velocity[row] = own @ data.qvel
    turns = rotations.xyzw_from_wxyz(data.xquat[1:])
    # `cfrc_int` is what the parent does to the child: the joint's force on the parent is opposite
    return PairState(data.xipos[1:].copy(), turns, velocity), -data.cfrc_int[2, 3:]


def numbers_of(motion: PairState) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Momentum (t, 3), angular momentum (t, 3) about the origin and energy (t,) of both bodies."""
    masses = np.array([body.mass for body in BODIES])
    moments = np.array([body.inertia for body in BODIES])
    linear = masses[:, np.newaxis] * motion.velocity[:, :, :3]
    spins = motion.velocity[:, :, 3:]
    in_body = rotations.rotate(rotations.conjugate(motion.turn_xyzw), spins)
    own = rotations.rotate(motion.turn_xyzw, moments * in_body)
    angular = np.cross(motion.centre, linear) + own
    energy = 0.5 * (linear * motion.velocity[:, :, :3] + own * spins).sum(axis=(1, 2))
    height = (masses * motion.centre[:, :, 2]).sum(axis=1)
    return linear.sum(axis=1), angular.sum(axis=1), energy + GRAVITY * height


# The maths


def test_the_cross_matrix_is_that_of_the_product() -> None:
    r, u = np.random.default_rng(1).normal(size=(2, 3))

    np.testing.assert_allclose(cross_matrix(r) @ u, np.cross(r, u), rtol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_the_joints_force_is_the_one_that_mujocos_joint_transmits(seed: int) -> None:
    state, transmitted = moving(seed)

    np.testing.assert_allclose(joint_force(BODIES, state, GRAVITY), transmitted, atol=1e-10)


def test_the_continuous_motion_keeps_joint_momentum_and_energy() -> None:
    start, _ = moving(3)
    times = np.linspace(0.0, 1.0, 1001)

    motion = move_pair(BODIES, start, times, GRAVITY)

    assert gaps(BODIES, motion).max() < 1e-9
    linear, angular, energy = numbers_of(motion)
    fallen = np.outer(times, (0.0, 0.0, -3.5 * GRAVITY))
    np.testing.assert_allclose(linear - linear[0], fallen, atol=1e-9)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)
    weights = np.array([[0.0, 0.0, -2.0 * GRAVITY], [0.0, 0.0, -1.5 * GRAVITY]])
    torque = np.cross(motion.centre, weights).sum(axis=1)
    gained = np.trapezoid(torque, times, axis=0)
    np.testing.assert_allclose(angular[-1] - angular[0], gained, atol=1e-4)


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_a_step_obeys_the_lectures_equations(share: float) -> None:
    # Arrange: a joint that has come apart already
    start, _ = moving(5)
    centre = start.centre + np.array([[0.0, 0.0, 0.01], [0.0, 0.0, 0.0]])
    start = PairState(centre, start.turn_xyzw, start.velocity)
    step = 0.002

    # Act
    motion, forces = step_pair(BODIES, start, np.array([0.0, step]), GRAVITY, share)

    # Assert
    equations = make_equations(BODIES, start, GRAVITY)
    changed = equations.mass @ (motion.velocity[1] - motion.velocity[0]).reshape(-1) / step
    right = equations.force + equations.jacobian.T @ forces[0]
    np.testing.assert_allclose(changed + equations.bias, right, atol=1e-9)
    opening = equations.jacobian @ motion.velocity[1].reshape(-1)
    np.testing.assert_allclose(opening, [0.0, 0.0, -share * 0.01 / step], atol=1e-12)
    moved = motion.centre[0] + step * motion.velocity[1, :, :3]
    np.testing.assert_allclose(motion.centre[1], moved, atol=1e-12)
    turned = rotations.multiply(motion.turn_xyzw[1], rotations.conjugate(motion.turn_xyzw[0]))
    by = rotations.log(turned)
    np.testing.assert_allclose(by, step * motion.velocity[1, :, 3:], atol=1e-6)


# The study


def of(result: StudyResult, way: str, column: str) -> list[float]:
    return [row[column] for row in result.rows if row["coordinates"] == way]


def test_each_way_comes_to_the_continuous_motion_with_first_order(result: StudyResult) -> None:
    steps = 1.0 / np.array(constraints._RATES[2:])
    ways = dict.fromkeys(result.column("coordinates"))

    assert {"maximal, c = 0", "maximal, stabilised", "reduced, mujoco"} <= ways.keys()
    for way in ways:
        off = of(result, way, "centres off theory at 1 s (m)")
        assert order_of(steps, off[2:]) == pytest.approx(1.0, abs=0.15), way
        force = of(result, way, "joint's force off theory / largest")
        assert order_of(steps, force[2:]) == pytest.approx(1.0, abs=0.25), way


def test_a_gap_is_of_first_order_stabilised_of_second_and_reduced_there_is_none(
    result: StudyResult,
) -> None:
    steps = 1.0 / np.array(constraints._RATES)

    assert order_of(steps, of(result, "maximal, c = 0", "largest gap (m)")) == pytest.approx(
        1.0, abs=0.1
    )
    assert order_of(steps, of(result, "maximal, stabilised", "largest gap (m)")) == pytest.approx(
        2.0, abs=0.15
    )
    for way in dict.fromkeys(result.column("coordinates")):
        if way.startswith("reduced"):
            assert max(of(result, way, "largest gap (m)")) < 1e-14


def test_the_study_asks_for_as_many_runs_as_it_says(
    result: StudyResult, runner: InProcessRunner
) -> None:
    assert len({case.label for case in runner.cases}) == len(runner.cases) == constraints.RUNS
    assert set(result.figures) == {"constraints", "constraints_poses"}
