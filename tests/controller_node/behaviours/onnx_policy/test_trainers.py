"""What trainers write beside their networks: metadata, and `deploy.yaml`."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller_node.behaviours.onnx_policy.description import Description
from controller_node.behaviours.onnx_policy.file import read_description
from controller_node.behaviours.onnx_policy.session import Network
from msgs_config.errors import ConfigurationError
from tests.support.networks import Mlp, describe

# Of whole_body_tracking and mjlab: texts, entries by commas, numbers with three digits.
METADATA = {
    "run_path": "someone/project/run",
    "joint_names": "left_hip,right_hip,left_knee",
    "joint_stiffness": "40.179,40.179,99.098",
    "joint_damping": "2.558,2.558,6.309",
    "default_joint_pos": "-0.312,-0.312,0.669",
    "command_names": "twist",
    "observation_names": "base_lin_vel,base_ang_vel,joint_pos,joint_vel,actions,command",
    "action_scale": "0.548,0.548,0.351",
}
# Of unitree_rl_lab: stiffness and damping by motor, all else in the policy's order.
DEPLOY: dict[str, Any] = {
    "joint_ids_map": [2, 0, 1],
    "step_dt": 0.02,
    "stiffness": [10.0, 20.0, 30.0],
    "damping": [1.0, 2.0, 3.0],
    "default_joint_pos": [0.1, 0.2, 0.3],
    "commands": {"base_velocity": {"ranges": {"lin_vel_x": [-0.5, 1.0]}}},
    "actions": {
        "JointPositionAction": {
            "clip": [[-1.0, 1.0], [-2.0, 2.0], [-3.0, 3.0]],
            "joint_names": [".*"],
            "scale": [0.25, 0.25, 0.25],
            "offset": [0.1, 0.2, 0.3],
            "joint_ids": None,
        }
    },
    "observations": {
        "base_ang_vel": {
            "params": {},
            "clip": [-100.0, 100.0],
            "scale": [0.2, 0.2, 0.2],
            "history_length": 5,
        },
        "velocity_commands": {
            "params": {"command_name": "base_velocity"},
            "clip": None,
            "scale": [1.0, 1.0, 1.0],
            "history_length": 1,
        },
        "gait_phase": {
            "params": {"period": 0.8},
            "clip": None,
            "scale": [1.0, 1.0],
            "history_length": 1,
        },
    },
}
MOTORS = {"motor_names": ["a", "b", "c"]}


def read(path: Path, metadata: dict[str, str], beside: dict[str, Any]) -> Description:
    """The description of a network with metadata, and with a file beside it if that has keys."""
    file = Mlp(4, 3).write(path / "policy.onnx", metadata)
    if beside:
        describe(file, beside)
    return read_description(Network(file))


def test_metadata_are_read(tmp_path: Path) -> None:
    policy = read(tmp_path, METADATA, {"step_dt": 0.02})
    assert policy.joints == ("left_hip", "right_hip", "left_knee")
    assert policy.stiffness.tolist() == [40.179, 40.179, 99.098]
    assert policy.damping.tolist() == [2.558, 2.558, 6.309]
    assert policy.action_scale.tolist() == [0.548, 0.548, 0.351]
    assert policy.default.tolist() == policy.action_offset.tolist() == [-0.312, -0.312, 0.669]
    terms = [used.term.name for used in policy.terms]
    assert terms[:4] == ["base_lin_vel", "base_ang_vel", "joint_pos_rel", "joint_vel_rel"]
    assert terms[4:] == ["last_action", "velocity_commands"]
    assert {used.history for used in policy.terms} == {1} and policy.step_s == 0.02


def test_a_command_is_a_motion_where_the_task_tracks_one(tmp_path: Path) -> None:
    metadata = METADATA | {"command_names": "motion", "observation_names": "command,joint_vel"}
    metadata["observation_history_lengths"] = "1,4"
    policy = read(tmp_path, metadata, {"step_dt": 0.02})
    assert [(each.term.name, each.size) for each in policy.terms] == [
        ("motion_command", 6),
        ("joint_vel_rel", 12),
    ]


def test_the_file_beside_counts_instead_of_metadata(tmp_path: Path) -> None:
    policy = read(
        tmp_path,
        METADATA,
        {
            "step_dt": 0.02,
            "joint_damping": {"left_hip": 1.0} | dict.fromkeys(("right_hip", "left_knee"), 2.0),
            "action_scale": 0.5,
        },
    )
    assert policy.damping.tolist() == [1.0, 2.0, 2.0]
    assert policy.action_scale.tolist() == [0.5] * 3
    assert policy.stiffness[2] == 99.098


def test_metadata_say_no_period(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigurationError, match=r"it has no 'step_dt'.*write it in .*policy\.yaml"
    ):
        read(tmp_path, METADATA, {})


def test_metadata_that_are_no_numbers_are_refused(tmp_path: Path) -> None:
    wrong = METADATA | {"joint_damping": "1.0,?,1.0"}
    with pytest.raises(ConfigurationError, match="joint_damping is a list; it must be a list of 3"):
        read(tmp_path, wrong, {"step_dt": 0.02})


def test_a_deploy_file_is_read_in_the_orders_that_it_has(tmp_path: Path) -> None:
    policy = read(tmp_path, {}, DEPLOY | MOTORS)
    assert policy.joints == ("c", "a", "b")
    assert policy.stiffness.tolist() == [30.0, 10.0, 20.0]
    assert policy.damping.tolist() == [3.0, 1.0, 2.0]
    assert policy.default.tolist() == policy.action_offset.tolist() == [0.1, 0.2, 0.3]
    assert policy.target_clip is not None and policy.target_clip[:, 1].tolist() == [1.0, 2.0, 3.0]
    angular, command, phase = policy.terms
    assert (angular.size, angular.clip, angular.history) == (15, (-100.0, 100.0), 5)
    np.testing.assert_array_equal(angular.scale, 0.2)
    assert command.clip is None and phase.options.period == 0.8


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "it names no joints; add 'motor_names'"),
        ({"motor_names": ["a", "b"]}, "motor_names is a list; it must be a list of 3 names"),
        (MOTORS | {"joint_ids_map": [0, 1, 1]}, "joint_ids_map is a list; it must be a list with"),
        (MOTORS | {"actions": {"JointVelocityAction": {}}}, "unknown key 'actions.JointVelocity"),
        (
            MOTORS | {"actions": {"JointPositionAction": {"joint_ids": [0]}}},
            "actions.JointPositionAction.joint_ids is a list; it must be null",
        ),
        (MOTORS | {"damping": [1.0]}, "damping is a list; it must be a list of 3 finite numbers"),
    ],
)
def test_a_malformed_deploy_file_is_one_line(
    given: dict[str, Any], said: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigurationError, match=said):
        read(tmp_path, {}, DEPLOY | given)


def test_a_deploy_file_with_a_slice_of_all_joints_is_read(tmp_path: Path) -> None:
    """As unitree_rl_lab has it for a policy of all joints (G1, 29 joints, velocity/v0)."""
    plain = read(tmp_path, {}, DEPLOY | MOTORS)
    file = tmp_path / "policy.yaml"
    slice_of_all = "joint_ids: !!python/object/apply:builtins.slice [null, null, null]"
    text = file.read_text("utf-8")
    assert "joint_ids: null" in text
    file.write_text(text.replace("joint_ids: null", slice_of_all), "utf-8")

    again = read_description(Network(tmp_path / "policy.onnx"))

    assert again.joints == plain.joints
    assert again.action_offset.tolist() == plain.action_offset.tolist()
    file.write_text(
        text.replace("joint_ids: null", slice_of_all.replace("null,", "1,", 1)), "utf-8"
    )
    with pytest.raises(ConfigurationError, match="joint_ids is a list; it must be null"):
        read_description(Network(tmp_path / "policy.onnx"))
