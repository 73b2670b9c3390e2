"""Terms of an observation against MuJoCo's own sensors, and against their definitions."""

from typing import Any

import mujoco
import numpy as np
import pytest

from controller_node.behaviours.onnx_policy.motion import Pose, TrackedMotion
from controller_node.behaviours.onnx_policy.terms import TERMS, Situation, TermOptions
from tests.support.rotation_matrices import matrices

BODY = """
<mujoco><worldbody><body><freejoint/><geom size="0.1"/><site name="s"/></body></worldbody>
<sensor><velocimeter site="s"/><gyro site="s"/><framequat objtype="site" objname="s"/></sensor>
</mujoco>
"""
JOINTS = np.array([7, 6])  # entries of two hinges, in the policy's own order


def pose(rng: np.random.Generator) -> Pose:
    turn = rng.normal(size=4)
    return Pose(rng.normal(size=3), turn / np.linalg.norm(turn))


def situation(**changed: Any) -> Situation:
    """One with random numbers."""
    rng = np.random.default_rng(3)
    given = {
        "time": 0.7,
        "position": rng.normal(size=8),
        "velocity": rng.normal(size=8),
        "entries": JOINTS,
        "default": rng.normal(size=2),
        "last_action": rng.normal(size=2),
        "command": (0.5, -0.1, 0.3),
        "motion": TrackedMotion(rng.normal(size=2), rng.normal(size=2), pose(rng)),
        "anchor": pose(rng),
    }
    return Situation(**(given | changed))


def computed(name: str, seen: Situation, **options: Any) -> Any:
    return TERMS[name].compute(seen, TermOptions(**options))


def sensors(seen: Situation) -> Any:
    """What MuJoCo measures on a free body in that state: velocities (3,), (3,), and wxyz (4,)."""
    model = mujoco.MjModel.from_xml_string(BODY)
    data = mujoco.MjData(model)
    data.qpos[:3] = seen.position[:3]
    angle = np.linalg.norm(seen.position[3:6])
    mujoco.mju_axisAngle2Quat(data.qpos[3:7], seen.position[3:6] / angle, angle)
    data.qvel[:] = seen.velocity[:6]
    mujoco.mj_forward(model, data)
    return np.split(data.sensordata, (3, 6))


def test_velocities_and_orientation_of_the_base_are_those_of_sensors() -> None:
    seen = situation()
    linear, angular, wxyz = sensors(seen)
    np.testing.assert_allclose(computed("base_lin_vel", seen), linear, atol=1e-12)
    np.testing.assert_allclose(computed("base_ang_vel", seen), angular, atol=1e-12)
    found = computed("base_quat", seen, quaternion="wxyz")
    np.testing.assert_allclose(found, wxyz, atol=1e-12)
    np.testing.assert_array_equal(
        computed("base_quat", seen, quaternion="xyzw"), found[[1, 2, 3, 0]]
    )
    down = matrices(found[[1, 2, 3, 0]]).T @ (0.0, 0.0, -1.0)
    np.testing.assert_allclose(computed("projected_gravity", seen), down, atol=1e-12)
    assert computed("base_height", seen) == seen.position[2:3]


def test_joints_are_in_the_policys_order() -> None:
    seen = situation()
    position = seen.position[[7, 6]]
    np.testing.assert_array_equal(computed("joint_pos_abs", seen), position)
    np.testing.assert_array_equal(computed("joint_pos_rel", seen), position - seen.default)
    np.testing.assert_array_equal(computed("joint_vel_rel", seen), seen.velocity[[7, 6]])
    np.testing.assert_array_equal(computed("last_action", seen), seen.last_action)
    both = np.concatenate((seen.motion.position, seen.motion.velocity))
    np.testing.assert_array_equal(computed("motion_command", seen), both)


def test_a_motions_anchor_is_seen_from_that_of_the_character() -> None:
    seen = situation()
    assert seen.motion.anchor is not None and seen.anchor is not None
    wanted, own = matrices(seen.motion.anchor.xyzw), matrices(seen.anchor.xyzw)
    place = own.T @ (seen.motion.anchor.position - seen.anchor.position)
    np.testing.assert_allclose(computed("motion_anchor_pos_b", seen), place, atol=1e-12)
    columns = (own.T @ wanted)[:, :2]
    found = computed("motion_anchor_ori_b", seen).reshape(3, 2)
    np.testing.assert_allclose(found, columns, atol=1e-12)


@pytest.mark.parametrize(("time", "angle"), [(0.0, 0.0), (0.2, 90.0), (1.2, 180.0), (1.4, -90.0)])
def test_the_phase_of_a_gait_goes_round_once_a_period(time: float, angle: float) -> None:
    found = computed("gait_phase", situation(time=time), period=0.8)
    np.testing.assert_allclose(
        found, (np.sin(np.deg2rad(angle)), np.cos(np.deg2rad(angle))), atol=1e-12
    )


@pytest.mark.parametrize("name", TERMS)
def test_each_entry_of_a_term_has_a_label(name: str) -> None:
    options = TermOptions(period=1.0, quaternion="xyzw")
    labels = TERMS[name].labels(("b", "a"), options)
    assert len(labels) == len(TERMS[name].compute(situation(), options)) == len(set(labels))
