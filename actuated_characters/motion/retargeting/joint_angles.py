"""Joint coordinates of a character whose links are turned in given ways."""

from collections.abc import Mapping

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointType
from msgs_config.character.model import Character
from msgs_config.geometry import elementary, rotations


def joint_angles(
    character: Character, base: tuple[FloatArray, FloatArray], turns: Mapping[int, FloatArray]
) -> GeneralizedPosition:
    """Positions (f, n) in which links have turns, joint by joint from the base on.

    A hinge takes the part of the turn that is about its axis, within its limits; a joint whose link
    has no turn stays at zero.

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
        if wanted is not None and joint.type is not JointType.FIXED:
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


def _angle_about(axis: FloatArray, turns_xyzw: FloatArray) -> FloatArray:
    """The angle (f,) in rad, -pi to pi, of the part of turns (f, 4) that is about an axis (3,)."""
    twice: FloatArray = 2.0 * elementary.arctan2(turns_xyzw[:, :3] @ axis, turns_xyzw[:, 3])
    angle: FloatArray = (twice + np.pi) % (2.0 * np.pi) - np.pi
    return angle
