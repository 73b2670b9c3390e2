"""A character's motion with left and right exchanged.

Where its joints are at zero, a character that is the same on both sides is its own image in the
plane x, z. A turn `R` becomes `S R S` of the image, with S the reflection.
"""

from collections.abc import Sequence

import numpy as np

from character_motion.clips.motion_clip import MotionClip
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import still_model
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.model import Character
from msgs_config.errors import ClipError
from msgs_config.geometry import rotations

_WORDS = (("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT"), ("l_", "r_"), ("_l", "_r"))
_MAX_MIRROR_ERROR = 0.01  # m of places; what the cosine of axes may lack to one


def mirrored_motion(clip: MotionClip) -> GeneralizedPosition:
    """The motion (f, n) of a clip in the mirror y -> -y.

    Raises:
        ClipError: the character is not its own image.
    """
    character, layout = clip.character, clip.character.layout
    positions = clip.motion.position.copy()
    result = clip.motion.orientations_xyzw.copy()
    positions[:, layout.rotation_entries] = rotations.log(result)
    positions = mirrored_rates(character, positions)
    for k, entries in enumerate(layout.rotation_entries):
        result[:, k] = rotations.exp(positions[:, entries])
    if layout.has_floating_base:
        result[:, 0] = _mirrored_root(clip, _at_rest(character)[1][0])
        positions[:, 3:6] = rotations.log(result[:, 0])
    lower, upper = character.position_bounds()
    return GeneralizedPosition(np.clip(positions, lower, upper), result)


def mirrored_rates(character: Character, rates: FloatArray) -> FloatArray:
    """Velocities (f, n) in the mirror y -> -y; those of turns are in the child frame, or its log.

    Raises:
        ClipError: the character is not its own image.
    """
    origins, turns = _at_rest(character)
    rows = {link.joint.name: row for row, link in enumerate(character.links)}
    result = rates.copy()
    for joint in character.layout.joints:
        other = character.layout.joint(counterpart(character, joint.name))
        row, image = rows[joint.name], rows[other.name]
        if joint.type is not other.type or not _is_image(origins[row], origins[image]):
            raise _unequal(character, joint.name)
        if joint.rotation is not None:
            assert other.rotation is not None
            in_world = rotations.rotate(turns[image], rates[:, other.rotation])  # axial vectors
            mirrored = in_world * np.array((-1.0, 1.0, -1.0))
            back = rotations.rotate(rotations.conjugate(turns[row]), mirrored)
            result[:, joint.rotation] = back
        else:
            axis = rotations.rotate(turns[row], np.array(character.links[row].joint.axis_in_child))
            image_axis = rotations.rotate(
                turns[image], np.array(character.links[image].joint.axis_in_child)
            )
            along = float(image_axis * np.array((-1.0, 1.0, -1.0)) @ axis)
            if abs(abs(along) - 1.0) > _MAX_MIRROR_ERROR:
                raise _unequal(character, joint.name)
            result[:, joint.start] = np.sign(along) * rates[:, other.start]
    if character.layout.has_floating_base:
        result[:, :3] = rates[:, :3] * np.array((1.0, -1.0, 1.0))
    return result


def _mirrored_root(clip: MotionClip, at_rest: FloatArray) -> FloatArray:
    """The turns (f, 4) of the root: those since rest, reflected."""
    since = rotations.multiply(clip.motion.orientations_xyzw[:, 0], rotations.conjugate(at_rest))
    mirrored = rotations.exp(rotations.log(since) * np.array((-1.0, 1.0, -1.0)))
    return rotations.multiply(mirrored, at_rest)


def _at_rest(character: Character) -> tuple[FloatArray, FloatArray]:
    """Origins (l, 3) and turns (l, 4) of the links with all joints at zero, the base upright."""
    rest = np.zeros(character.layout.size)
    if character.layout.has_floating_base:
        rest[3:6] = character.rest_position[3:6]
    return still_model(character, rest).link_poses()


def _is_image(point: FloatArray, other: FloatArray) -> bool:
    return bool(np.abs(point * np.array((1.0, -1.0, 1.0)) - other).max() < _MAX_MIRROR_ERROR)


def counterpart(character: Character, name: str) -> str:
    """The name of a joint on the other side; its own where it has no side."""
    return counterpart_among(character.layout.joint_names, name)


def counterpart_among(names: Sequence[str], name: str) -> str:
    """The one of some names that is on the other side; the name itself where there is none."""
    for one, two in _WORDS:
        for word, other in ((one, two), (two, one)):
            if word in name and name.replace(word, other) in names:
                return name.replace(word, other)
    return name


def _unequal(character: Character, joint: str) -> ClipError:
    return ClipError(
        f"character '{character.name}' is not the same on both sides: joint '{joint}' has no "
        "counterpart in the mirror"
    )
