"""What the actuators of an MJCF file make of its joints: effort limits and gains.

A motor's force is `gain u + bias`, at most its `forcerange`; `gear` times that acts on the joint. A
servo is a motor with a bias `-kp q - kv q'` (`biasprm`), whose gains on the joint are those times
the gear's square. Its control is what a target is here.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from msgs_config.character.mjcf.compiling import CompiledMjcf
from msgs_config.character.mjcf.robot import Robot
from msgs_config.character.urdf.file_formats.vocabulary import LeftOut, listed
from msgs_config.geometry import fixed_order

_OF_JOINTS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
_FIXED_GAIN = int(mujoco.mjtGain.mjGAIN_FIXED)
_AFFINE = int(mujoco.mjtBias.mjBIAS_AFFINE)
_BIASES = (int(mujoco.mjtBias.mjBIAS_NONE), _AFFINE)
_AT_ONCE = int(mujoco.mjtDyn.mjDYN_NONE)
_BALL = int(mujoco.mjtJoint.mjJNT_BALL)


@dataclass
class Drive:
    """What drives a joint; without a motor nothing does."""

    is_driven: bool = False
    effort_limit: float = 0.0  # N m or N; infinite where there is none
    stiffness: float = 0.0  # N m/rad or N/m
    damping: float = 0.0  # N m s/rad or N s/m
    armature: float = 0.0  # kg m^2 or kg, of the rotors beside the joint's own


def read_drives(mjcf: CompiledMjcf, robot: Robot) -> dict[int, Drive]:
    """The drive of each joint of the character; none at all where no actuator is known."""
    model = mjcf.model
    drives = {joint: Drive() for joint in robot.joints}
    for actuator in range(model.nactuator):
        joint = _joint_of(model, actuator)
        if joint not in drives:
            continue
        drive, gear = drives[joint], float(fixed_order.norm(model.actuator_gear[actuator, :3]))
        if model.jnt_type[joint] != _BALL:
            gear = abs(float(model.actuator_gear[actuator, 0]))
        drive.is_driven = True
        drive.armature += float(model.actuator_armature[actuator]) * gear * gear
        own = math.inf
        if _is_known(model, actuator):
            own = gear * _largest_force(model, actuator)
            bias = model.actuator_biasprm[actuator] * gear * gear
            if model.actuator_biastype[actuator] == _AFFINE:
                drive.stiffness += max(-float(bias[1]), 0.0)
                drive.damping += max(-float(bias[2]), 0.0)
        # three motors of a ball joint act at right angles
        before, is_ball = drive.effort_limit, model.jnt_type[joint] == _BALL
        drive.effort_limit = math.sqrt(before * before + own * own) if is_ball else before + own
    for joint, drive in drives.items():
        if model.jnt_actfrclimited[joint]:
            bound = float(np.abs(model.jnt_actfrcrange[joint]).max())
            drive.effort_limit = min(drive.effort_limit, bound) if drive.is_driven else 0.0
    return drives


def remark_actuators(mjcf: CompiledMjcf, robot: Robot) -> Iterator[LeftOut]:
    """A line for each kind of what does not count of the actuators, or counts otherwise."""
    model, kinds = mjcf.model, dict[str, list[str]]()
    for actuator in range(model.nactuator):
        name = mjcf.name("actuator", actuator)
        for kind in _kinds(model, actuator, _joint_of(model, actuator) in robot.joints):
            kinds.setdefault(kind, []).append(name)
    for what, names in kinds.items():
        yield LeftOut("actuator", f"{what} ({len(names)}): {listed(names)}")


def _kinds(model: mujoco.MjModel, actuator: int, has_joint: bool) -> Iterator[str]:
    if not has_joint:
        yield "left out: actuators of tendons, sites or bodies, or of joints beside the character"
        return
    if not _is_known(model, actuator):
        yield "left out: what an actuator does that is no motor or servo; its joint is driven"
        return
    if model.actuator_dyntype[actuator] != _AT_ONCE:
        yield "left out: 'dyntype' of actuators: efforts act at once"
    bias = model.actuator_biasprm[actuator]
    if bias[0] or bias[1] > 0.0 or bias[2] > 0.0:
        yield "left out: a bias of actuators that no gain of a servo has"
    ranges = [_control_range(model, actuator), _force_range(model, actuator)]
    if any(
        each is not None and each[0] != -each[1] for each in ranges[_is_servo(model, actuator) :]
    ):
        yield "effort limits of actuators with other ranges to both sides are the larger of both"
    if model.actuator_damping[actuator]:
        yield "left out: 'damping' of actuators"


def _joint_of(model: mujoco.MjModel, actuator: int) -> int:
    """The number of the joint that an actuator drives; -1 if it drives none."""
    return (
        int(model.actuator_trnid[actuator, 0])
        if (model.actuator_trntype[actuator] in _OF_JOINTS)
        else -1
    )


def _is_known(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator's force is one of its control, position and velocity that we have."""
    return bool(
        model.actuator_gaintype[actuator] == _FIXED_GAIN
        and model.actuator_biastype[actuator] in _BIASES
    )


def _is_servo(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator's control is a target, whose range says nothing of its force."""
    affine = model.actuator_biastype[actuator] == _AFFINE
    return bool(affine and np.any(model.actuator_biasprm[actuator, 1:3]))


def _largest_force(model: mujoco.MjModel, actuator: int) -> float:
    """The largest force of a motor before its gear, N m or N; infinite where nothing bounds it."""
    control, force = _control_range(model, actuator), _force_range(model, actuator)
    largest = math.inf
    if control is not None and not _is_servo(model, actuator):
        gain = abs(float(model.actuator_gainprm[actuator, 0]))
        largest = gain * max(map(abs, control))
    return largest if force is None else min(largest, max(map(abs, force)))


def _control_range(model: mujoco.MjModel, actuator: int) -> tuple[float, float] | None:
    control = int(model.actuator_ctrladr[actuator])
    if control < 0 or not model.actuator_ctrllimited[control]:
        return None
    lower, upper = model.actuator_ctrlrange[control].tolist()
    return lower, upper


def _force_range(model: mujoco.MjModel, actuator: int) -> tuple[float, float] | None:
    output = int(model.actuator_outadr[actuator])
    if output < 0 or not model.actuator_forcelimited[output]:
        return None
    lower, upper = model.actuator_forcerange[output].tolist()
    return lower, upper
