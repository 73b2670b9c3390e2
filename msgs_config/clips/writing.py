"""Writer of motion clips in the format of `clip.py`, with what is known of where they come from.

Beside `Loop` and `Frames`, which every reader of clips reads, a file may have `Source` (where the
motion comes from), `Contacts` (when points of the body stand on the ground, s) and `Quality` (what
was measured when it was made). Readers of the motion alone leave them out.
"""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointType
from msgs_config.character.model import Character, Placement
from msgs_config.geometry import rotations

_DECIMALS = 7  # a ten millionth of a metre, and of a quaternion


def clip_rows(character: Character, times: FloatArray, motion: GeneralizedPosition) -> FloatArray:
    """The frames (f, m) of a clip's file that shows a motion: what the reader undoes.

    Args:
        character: The character, not moved from where its file puts it.
        times: Of the frames (f,), s.
        motion: Positions (f, n), and rotations (f, k, 4), which alone count.
    """
    layout, clips = character.layout, character.clips
    durations = np.diff(times)
    columns = [np.append(durations, durations[-1:])[:, np.newaxis]]
    turns = {int(start): k for k, start in enumerate(layout.rotation_entries[:, 0])}
    columns += _root(character, motion)
    for name in clips.joints:
        joint = layout.joint(name)
        if joint.type is JointType.SPHERICAL:
            columns.append(_quaternions(character, motion.orientations_xyzw[:, turns[joint.start]]))
        else:
            angle = motion.position[:, joint.start] - clips.offsets.get(name, 0.0)
            columns.append((clips.signs.get(name, 1.0) * angle)[:, np.newaxis])
    return np.concatenate(columns, axis=1)


def clip_text(rows: FloatArray, *, wraps: bool, known: Mapping[str, Any]) -> str:
    """The text of a clip's file: frames (f, m), whether it goes on from its end, and the rest."""
    frames = (np.round(rows, _DECIMALS) + 0.0).tolist()
    head = json.dumps({"Loop": "wrap" if wraps else "none", **known}, indent=1)
    lines = ",\n".join(json.dumps(frame, separators=(",", ":")) for frame in frames)
    return f'{head[:-2]},\n "Frames": [\n{lines}\n ]\n}}\n'


def _root(character: Character, motion: GeneralizedPosition) -> list[FloatArray]:
    """Position (f, 3) and quaternion (f, 4) of the root in the axes of the character's clips."""
    clips = character.clips
    if not character.layout.has_floating_base:
        still = np.zeros((len(motion.position), 7))
        still[:, 3] = 1.0
        return [still]
    if character.placement != Placement():
        raise ValueError("a clip is written of a character that stands where its file puts it")
    position, turn = motion.position[:, :3], motion.orientations_xyzw[:, 0]
    if clips.up_axis == "y":
        back = rotations.conjugate(rotations.ABOUT_X_QUARTER_TURN_XYZW)
        position, turn = rotations.rotate(back, position), rotations.multiply(back, turn)
    if any(clips.base_rotation):
        undone = rotations.conjugate(rotations.exp(np.array(clips.base_rotation)))
        turn = rotations.multiply(turn, undone)
    return [position, _quaternions(character, turn)]


def _quaternions(character: Character, turns_xyzw: FloatArray) -> FloatArray:
    if character.clips.quaternion == "wxyz":
        return rotations.wxyz_from_xyzw(turns_xyzw)
    return turns_xyzw
