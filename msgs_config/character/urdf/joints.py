"""Joints of a URDF whose limits leave them one position."""

from xml.etree import ElementTree

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Pose
from msgs_config.character.urdf.limits import WITH_BOUNDS, read_bounds
from msgs_config.character.urdf.origin import read_origin, write_origin
from msgs_config.character.urdf.reading import DEFAULT_AXIS
from msgs_config.geometry import rotations


def fix_locked_joints(robot: ElementTree.Element) -> dict[str, float]:
    """Fix hinges and sliders whose limits leave one position; each one's name with that, rad or m.

    Such a joint's origin becomes that of its child in this position.
    """
    fixed = {}
    for joint in robot.findall("joint"):
        limit = joint.find("limit") if joint.get("type") in WITH_BOUNDS else None
        if limit is None:
            continue
        lower, upper = read_bounds(limit)
        if lower == upper:
            _fix_at(joint, lower)
            fixed[joint.get("name", "")] = lower
    return fixed


def _fix_at(joint: ElementTree.Element, position: float) -> None:
    """Make a hinge or slider a fixed joint, its child where it is in a position, rad or m."""
    if position:
        pose, along = read_origin(joint), position * _axis(joint)
        turn = np.array(pose.orientation_xyzw)
        moved = Pose.of_arrays(np.array(pose.position) + rotations.rotate(turn, along), turn)
        if joint.get("type") == "revolute":
            turned = rotations.multiply(turn, rotations.exp(along))
            moved = Pose.of_arrays(np.array(pose.position), turned)
        axes = rotations.matrix(np.array(moved.orientation_xyzw))
        write_origin(joint, np.array(moved.position), axes)
    joint.set("type", "fixed")


def _axis(joint: ElementTree.Element) -> FloatArray:
    """The axis (3,) of a joint, of length 1."""
    axis = joint.find("axis")
    text = DEFAULT_AXIS if axis is None else axis.get("xyz", DEFAULT_AXIS)
    return np.array([float(piece) for piece in text.split()])
