"""An MJCF file as the URDF and the keys of a character's file that say the same."""

from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import ROOT, JointType
from msgs_config.character.mjcf.actuators import Drive, read_drives, remark_actuators
from msgs_config.character.mjcf.compiling import compile_mjcf
from msgs_config.character.mjcf.followers import read_followers, remark_equalities
from msgs_config.character.mjcf.left_out import remark_elements, remark_joints
from msgs_config.character.mjcf.robot import Robot, find_robot
from msgs_config.character.mjcf.sensors import read_sensors, remark_sensors
from msgs_config.character.mjcf.shapes import remark_shapes
from msgs_config.character.mjcf.urdf import write_urdf
from msgs_config.character.urdf.file_formats.vocabulary import LeftOut, listed
from msgs_config.geometry import rotations

HOME = "home"
"""The name of the keyframe that is the rest pose."""
_BALL = int(mujoco.mjtJoint.mjJNT_BALL)


class MjcfCharacter(NamedTuple):
    """A character's files, made of one of MuJoCo."""

    urdf_text: str
    content: dict[str, Any]
    """Of the YAML file."""
    remarks: tuple[LeftOut, ...]
    """A line for each kind of what does not count, or counts otherwise."""


def read_mjcf(path: Path) -> MjcfCharacter:
    """Read an MJCF file, with all that it includes.

    Raises:
        CharacterError: MuJoCo refuses it, or it has nothing that moves; names the file.
    """
    mjcf = compile_mjcf(path)
    robot = find_robot(mjcf)
    drives, followers = read_drives(mjcf, robot), read_followers(mjcf, robot)
    home, positions = _rest(mjcf.model)
    content = {
        "fixed_base": not robot.floats,
        "rest_pose": _rest_pose(mjcf.model, robot, positions, set(followers)),
        "joints": _joints(mjcf.model, robot, drives, set(followers)),
        "sensors": read_sensors(mjcf, robot),
        "root_armature": _root_armature(mjcf.model, robot),
    }
    remarks = (
        *mjcf.remarks,
        *robot.remarks,
        *remark_shapes(mjcf, robot),
        *remark_joints(mjcf, robot),
        *remark_equalities(mjcf, robot),
        *remark_actuators(mjcf, robot),
        *remark_sensors(mjcf, robot),
        *_remark_keys(mjcf.model, home),
        *remark_elements(mjcf),
    )
    return MjcfCharacter(
        write_urdf(mjcf, robot, drives, followers),
        {
            key: value
            for key, value in content.items()
            if value not in ({}, 0.0) or key == "fixed_base"
        },
        remarks,
    )


def _rest(model: mujoco.MjModel) -> tuple[int, FloatArray]:
    """The keyframe of the rest pose, and its positions (nq,); without one -1, and the file's."""
    for key in range(model.nkey):
        if model.key(key).name == HOME:
            return key, np.array(model.key_qpos[key])
    return -1, np.array(model.qpos0)


def _remark_keys(model: mujoco.MjModel, home: int) -> list[LeftOut]:
    others = [str(model.key(key).name) or f"key_{key}" for key in range(model.nkey) if key != home]
    lines = [f"left out: <key> ({len(others)}): {listed(others)}"] if others else []
    if home >= 0:
        lines.append(f"the rest pose is that of the key '{HOME}'")
    return [LeftOut("keyframe", line) for line in lines]


def _rest_pose(
    model: mujoco.MjModel, robot: Robot, positions: FloatArray, followers: set[int]
) -> dict[str, float]:
    """The content of the key `rest_pose`: what is not zero, within the joints' ranges.

    Followers rest where their leaders say.
    """
    pose: dict[str, float] = {}
    if robot.floats:
        (joint,) = [j for j in range(model.njnt) if model.jnt_bodyid[j] == robot.bodies[0]]
        start = int(model.jnt_qposadr[joint])
        numbers = [*positions[start : start + 3], *_vector(positions[start + 3 : start + 7])]
        pose |= _named(ROOT, JointType.FLOATING, numbers)
    for joint in robot.joints.keys() - followers:
        name = robot.joints[joint]
        start = int(model.jnt_qposadr[joint])
        if model.jnt_type[joint] == _BALL:
            pose |= _named(name, JointType.SPHERICAL, _vector(positions[start : start + 4]))
        else:
            value = float(positions[start])
            if model.jnt_limited[joint]:
                value = float(np.clip(value, *model.jnt_range[joint]))
            pose |= _named(name, JointType.REVOLUTE, [value])
    return pose


def _root_armature(model: mujoco.MjModel, robot: Robot) -> float:
    """The armature of a floating base, kg and kg m^2, which a default may have given it."""
    if not robot.floats:
        return 0.0
    return float(model.dof_armature[model.body_dofadr[robot.bodies[0]]])


def _vector(quaternion_wxyz: FloatArray) -> list[float]:
    turn = rotations.normalised(rotations.xyzw_from_wxyz(np.array(quaternion_wxyz)))
    return [float(each) for each in rotations.log(turn)]


def _named(name: str, kind: JointType, numbers: list[float]) -> dict[str, float]:
    pairs = zip(kind.suffixes, numbers, strict=True)
    return {name + suffix: float(number) for suffix, number in pairs if number}


def _joints(
    model: mujoco.MjModel, robot: Robot, drives: dict[int, Drive], followers: set[int]
) -> dict[str, dict[str, float]]:
    """The content of the key `joints`: gains of servos, and what a URDF does not have.

    Where the file has actuators, a joint without one is limp.
    """
    has_actuators = any(drive.is_driven for drive in drives.values())
    found: dict[str, dict[str, float]] = {}
    for joint in robot.joints.keys() - followers:
        own: dict[str, float] = {}
        drive = drives[joint]
        if drive.stiffness or drive.damping:
            own |= {"stiffness": drive.stiffness, "damping": drive.damping}
        elif has_actuators and not drive.is_driven:
            own |= {"stiffness": 0.0, "damping": 0.0, "effort_limit": 0.0}
        if model.jnt_type[joint] == _BALL and model.dof_damping[model.jnt_dofadr[joint]]:
            own["passive_damping"] = float(model.dof_damping[model.jnt_dofadr[joint]])
        if own:
            found[robot.joints[joint]] = own
    return found
