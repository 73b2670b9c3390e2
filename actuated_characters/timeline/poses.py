"""Poses of a timeline as a character has them: by name and whole, and mirrored."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from actuated_characters.timeline.content import is_number
from character_motion.clips.mirroring import counterpart, mirrored_motion, mirrored_rates
from character_motion.clips.motion_clip import MotionClip
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.model import Character


def values_of(
    character: Character, pose: GeneralizedPosition, joints: Iterable[str]
) -> dict[str, float]:
    """The degrees of freedom of some joints in a pose, by name; rad and m."""
    layout = character.layout
    wanted = layout.mask(joints)
    return {
        name: float(value)
        for name, value, is_wanted in zip(
            layout.dof_names, pose.position.tolist(), wanted, strict=True
        )
        if is_wanted
    }


def joints_of(character: Character, pose: Mapping[str, Any]) -> list[str]:
    """The joints of which a pose names a degree of freedom, in the layout's order."""
    joints = character.layout.joints
    return [joint.name for joint in joints if any(name in pose for name in joint.dof_names)]


def whole_poses(
    character: Character, poses: Sequence[Mapping[str, Any]]
) -> list[GeneralizedPosition]:
    """The poses of a layer, whole: what one leaves out is that of the pose before, or of rest.

    Names that are none of the character's, and what is no number, are left out.
    """
    position, whole = np.array(character.rest_position), []
    index_of = {name: index for index, name in enumerate(character.layout.dof_names)}
    for each in poses:
        for name, value in each["pose"].items():
            if name in index_of and is_number(value):
                position[index_of[name]] = value
        whole.append(character.layout.configuration(position.copy()))
    return whole


def mirrored(character: Character, pose: GeneralizedPosition) -> GeneralizedPosition:
    """A pose with left and right exchanged, in the plane y = 0.

    Raises:
        ClipError: the character is not its own image.
    """
    frame = GeneralizedPosition(pose.position[np.newaxis], pose.orientations_xyzw[np.newaxis])
    motion = mirrored_motion(MotionClip(character, np.zeros(1), frame))
    return GeneralizedPosition(motion.position[0], motion.orientations_xyzw[0])


def mirrored_values(
    character: Character, poses: Sequence[Mapping[str, Any]], number: int
) -> dict[str, float]:
    """A layer's pose mirrored, of the joints on the other side of those that it names.

    Raises:
        ClipError: the character is not its own image.
    """
    image = mirrored(character, whole_poses(character, poses)[number])
    named = joints_of(character, poses[number]["pose"])
    return values_of(character, image, (counterpart(character, name) for name in named))


def mirrored_rate(character: Character, rate: Mapping[str, Any]) -> dict[str, float]:
    """A pose's velocity or acceleration mirrored, by name.

    Names that are none of the character's, and what is no number, are left out.

    Raises:
        ClipError: the character is not its own image.
    """
    names = character.layout.dof_names
    rates = [rate[name] if is_number(rate.get(name)) else np.nan for name in names]
    (image,) = mirrored_rates(character, np.array([rates]))
    return {
        name: float(value)
        for name, value in zip(names, image.tolist(), strict=True)
        if not np.isnan(value)
    }
