"""Joints that MuJoCo couples to others, by equality constraints, where they can follow these."""

from collections.abc import Iterator
from typing import NamedTuple

import mujoco

from msgs_config.character.mjcf.compiling import CompiledMjcf
from msgs_config.character.mjcf.robot import Robot
from msgs_config.character.urdf.file_formats.vocabulary import LeftOut, listed

_BALL = int(mujoco.mjtJoint.mjJNT_BALL)
_JOINT = int(mujoco.mjtEq.mjEQ_JOINT)
_POWERS = slice(2, 5)  # of the polynomial: what is not linear


class Follower(NamedTuple):
    """A joint's position as `multiplier` times its leader's plus `offset`."""

    leader: int
    multiplier: float
    offset: float  # rad or m


def read_followers(mjcf: CompiledMjcf, robot: Robot) -> dict[int, Follower]:
    """What each joint follows, by numbers.

    MuJoCo's polynomial is of positions from those of the references: `q_1 - r_1 = a_0 + a_1 (q_2 -
    r_2)`.
    """
    model, found = mjcf.model, dict[int, Follower]()
    for constraint in range(model.neq):
        if not _is_coupling(model, robot, constraint):
            continue
        joint, leader = int(model.eq_obj1id[constraint]), int(model.eq_obj2id[constraint])
        own, other = (float(model.qpos0[model.jnt_qposadr[each]]) for each in (joint, leader))
        constant, factor = model.eq_data[constraint, :2].tolist()
        if joint not in found:
            found[joint] = Follower(leader, factor, own + constant - factor * other)
    return found


def remark_equalities(mjcf: CompiledMjcf, robot: Robot) -> Iterator[LeftOut]:
    """A line for the constraints that do not count."""
    model = mjcf.model
    others = [
        mjcf.name("equality", constraint)
        for constraint in range(model.neq)
        if not _is_coupling(model, robot, constraint)
    ]
    if others:
        yield LeftOut("equality", f"left out: <equality> ({len(others)}): {listed(others)}")


def _is_coupling(model: mujoco.MjModel, robot: Robot, constraint: int) -> bool:
    """Whether a constraint has one hinge or slider follow another linearly."""
    pair = int(model.eq_obj1id[constraint]), int(model.eq_obj2id[constraint])
    return bool(
        model.eq_type[constraint] == _JOINT
        and model.eq_active0[constraint]
        and all(each in robot.joints and model.jnt_type[each] != _BALL for each in pair)
        and model.eq_data[constraint, 1]
        and not model.eq_data[constraint, _POWERS].any()
    )
