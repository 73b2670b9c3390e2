"""Joint coordinates of a character whose links are turned in given ways."""

from collections.abc import Mapping

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointType
from msgs_config.character.model import Character
from msgs_config.geometry import elementary, rotations

_ITERATIONS, _DAMPING, _MAX_STEP = 30, 1e-3, 0.5  # the last one is in rad, of a step


def joint_angles(
    character: Character, base: tuple[FloatArray, FloatArray], turns: Mapping[int, FloatArray]
) -> GeneralizedPosition:
    """Positions (f, n) in which links have turns, joint by joint from the base on.

    A hinge takes the part of the turn that is about its axis, within its limits; hinges that follow
    each other, of which the last link alone has a turn, share it. A joint whose link has no turn,
    and no such link below, stays at zero.

    Args:
        character: With a floating base.
        base: Origin (f, 3) in m and turn (f, 4) of the base link in the world.
        turns: Of links in the world (f, 4), by index.
    """
    layout = character.layout
    positions = np.zeros((len(base[0]), layout.size))
    positions[:, :3], positions[:, 3:6] = base[0], rotations.log(base[1])
    lower, upper = character.position_bounds()
    world = [base[1]]
    for index, link in enumerate(character.links[1:], start=1):
        joint, wanted = link.joint, turns.get(index)
        own = np.array(joint.pose_in_parent.orientation_xyzw)
        frame = rotations.multiply(world[link.parent], own)
        row = _row_of_hinges(character, index, turns)
        if wanted is not None and len(row) > 1:
            frame = _shared(character, row, world, wanted, positions)
        elif wanted is not None and joint.type is not JointType.FIXED:
            entries = layout.joint(joint.name).entries
            relative = rotations.multiply(rotations.conjugate(frame), wanted)
            if joint.type is JointType.SPHERICAL:
                positions[:, entries] = rotations.log(relative)
                frame = wanted
            elif joint.type is JointType.REVOLUTE:
                axis = np.array(joint.axis_in_child)
                angle = _angle_about(axis, relative)
                angle = np.clip(angle, lower[entries.start], upper[entries.start])
                positions[:, entries.start] = angle
                frame = rotations.multiply(frame, rotations.exp(angle[:, np.newaxis] * axis))
        world.append(frame)
    return layout.configuration(positions)


def _row_of_hinges(character: Character, index: int, turns: Mapping[int, FloatArray]) -> list[int]:
    """The links with hinges from a link upwards, until one that has a turn; from above on."""
    row, links = [], character.links
    while index > 0:
        joint = links[index].joint
        if joint.type is JointType.REVOLUTE:
            row.append(index)
        elif joint.type is not JointType.FIXED:
            break
        index = links[index].parent
        if index in turns:
            break
    return row[::-1]


def _shared(
    character: Character,
    row: list[int],
    world: list[FloatArray],
    wanted: FloatArray,
    positions: FloatArray,
) -> FloatArray:
    """The turn (f, 4) that a row of hinges reaches of a wanted one; sets their positions.

    By damped Gauss-Newton from the middle of their ranges nearest to zero.
    """
    lower, upper = character.position_bounds()
    entries = [character.layout.joint(character.links[k].joint.name).start for k in row]
    low, high = lower[entries], upper[entries]
    angles = np.tile(np.clip(0.0, low, high), (len(wanted), 1))
    above = world[character.links[row[0]].parent]
    for _ in range(_ITERATIONS):
        turn, axes = _turned_by(character, row, above, angles)
        missing = rotations.log(rotations.multiply(wanted, rotations.conjugate(turn)))
        normal = np.matmul(axes, axes.swapaxes(-1, -2)) + _DAMPING * np.eye(len(row))
        gradient = np.matmul(axes, missing[..., np.newaxis])
        step = np.linalg.solve(normal, gradient)[..., 0]
        angles = np.clip(angles + np.clip(step, -_MAX_STEP, _MAX_STEP), low, high)
    positions[:, entries] = angles
    return _turned_by(character, row, above, angles)[0]


def _turned_by(
    character: Character, row: list[int], above: FloatArray, angles: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The turn (f, 4) of the last link of a row of hinges, and their axes (f, k, 3), world."""
    turn, axes = above, []
    line = [row[-1]]
    while line[0] != row[0]:
        line.insert(0, character.links[line[0]].parent)
    for index in line:
        joint = character.links[index].joint
        turn = rotations.multiply(turn, np.array(joint.pose_in_parent.orientation_xyzw))
        if index in row:
            axis = np.array(joint.axis_in_child)
            axes.append(rotations.rotate(turn, axis))
            angle = angles[:, len(axes) - 1, np.newaxis]
            turn = rotations.multiply(turn, rotations.exp(angle * axis))
    return turn, np.stack(axes, axis=1)


def _angle_about(axis: FloatArray, turns_xyzw: FloatArray) -> FloatArray:
    """The angle (f,) in rad, -pi to pi, of the part of turns (f, 4) that is about an axis (3,)."""
    twice: FloatArray = 2.0 * elementary.arctan2(turns_xyzw[:, :3] @ axis, turns_xyzw[:, 3])
    angle: FloatArray = (twice + np.pi) % (2.0 * np.pi) - np.pi
    return angle
