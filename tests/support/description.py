"""A `robot_description` as ROS' own parser reads it, and where URDF puts its links."""

import math
from contextlib import redirect_stderr
from io import StringIO

import numpy as np
from urdf_parser_py import urdf

from msgs_config.arrays import FloatArray


def parse(text: str) -> urdf.Robot:
    """The robot of a description."""
    with redirect_stderr(StringIO()):  # it names what is PyBullet's own, such as <contact>
        return urdf.URDF.from_xml_string(text)


def link_frames(robot: urdf.Robot, positions: dict[str, float]) -> dict[str, FloatArray]:
    """Homogeneous matrix (4, 4) of each link in the root, with the joints at positions by name."""
    frames = {robot.get_root(): np.eye(4)}
    pending = [robot.get_root()]
    while pending:
        parent = pending.pop()
        for name, child in robot.child_map.get(parent, []):
            joint = robot.joint_map[name]
            moved = _motion(joint, positions[name]) if joint.type != "fixed" else np.eye(4)
            frames[child] = frames[parent] @ origin_matrix(joint.origin) @ moved
            pending.append(child)
    return frames


def origin_matrix(origin: urdf.Pose | None) -> FloatArray:
    """The matrix (4, 4) of an `<origin>`: turns about the fixed x, y and z, in this order."""
    matrix = np.eye(4)
    if origin is None:
        return matrix
    roll, pitch, yaw = origin.rpy or (0.0, 0.0, 0.0)
    matrix[:3, :3] = about((0, 0, 1), yaw) @ about((0, 1, 0), pitch) @ about((1, 0, 0), roll)
    matrix[:3, 3] = origin.xyz or (0.0, 0.0, 0.0)
    return matrix


def about(axis: tuple[float, ...], angle: float) -> FloatArray:
    """The rotation matrix (3, 3) about an axis, by Rodrigues' formula."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned: FloatArray = (
        np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross
    )
    return turned


def _motion(joint: urdf.Joint, position: float) -> FloatArray:
    matrix = np.eye(4)
    axis = tuple(joint.axis or (1.0, 0.0, 0.0))
    if joint.type == "prismatic":
        matrix[:3, 3] = np.array(axis) / np.linalg.norm(axis) * position
    else:
        matrix[:3, :3] = about(axis, position)
    return matrix
