"""Motion clips in the format of DeepMimic (Peng et al. 2018): JSON with `Loop` and `Frames`.

A frame is: its duration in s, the root's position in m, the root's quaternion (wxyz), and for each
joint of the character's list an angle in rad or, for a ball joint, a quaternion (wxyz). The
character's file may say otherwise of quaternions, of the base's axes, and of angles.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.errors import ClipError, one_of
from msgs_config.file_kinds import refuse_other_kind
from msgs_config.files import read_text
from msgs_config.geometry import fixed_order, rotations

_SUFFIXES = (".txt", ".json")
_BEGINNING_BYTES = 256  # bytes of a file, in which a JSON object begins
_ROOT_COLUMNS = 8  # 1 for the duration, 3 for the position, 4 for the quaternion
_SHORTEST_QUATERNION = 0.1
_LARGEST_NUMBER = 1e6  # m or s


@dataclass(frozen=True)
class ClipFrames:
    """The frames of a clip in a character's layout, z-up, where it stands, in its joint limits."""

    times: FloatArray  # (f,) s, rising from 0
    positions: FloatArray  # (f, n) message form, except that rotations are in `orientations_xyzw`
    orientations_xyzw: FloatArray  # (f, k, 4)
    wraps: bool  # whether the clip goes on from its end
    bounds: tuple[FloatArray, FloatArray]  # (n,) each, the joint limits
    clamped: tuple[str, ...]  # degrees of freedom that had to be kept within their limits


def available_clips(character: Character) -> list[str]:
    """Names of the clips that the character's file points at."""
    if not character.clips.pattern:
        return []
    pattern = Path(character.clips.pattern)
    prefix, suffix = pattern.name.split("*")
    found = pattern.parent.glob(pattern.name)
    return sorted(path.name.removeprefix(prefix).removesuffix(suffix) for path in found)


class ClipFile:
    """The content of a clip's file, which is read once."""

    def __init__(self, character: Character, name_or_path: str) -> None:
        """Read a clip by name, or by the path of a `.txt` or `.json` file.

        Raises:
            ClipError: there is no such clip, or it is no JSON object.
        """
        self.character = character
        self.path = clip_path(character, name_or_path)
        try:
            content = json.loads(read_text(self.path, ClipError))
        except (ValueError, RecursionError) as error:
            raise self._malformed() from error
        if not isinstance(content, dict):
            raise self._malformed()
        self.content: dict[str, Any] = content

    @cached_property
    def frames(self) -> ClipFrames:
        """The motion. Raises ClipError if it is malformed, or does not fit the character."""
        try:
            loop, frames = self.content["Loop"], np.array(self.content["Frames"], dtype=float)
        except (ValueError, KeyError, TypeError, OverflowError) as error:
            raise self._malformed() from error
        if loop not in ("wrap", "none"):
            raise ClipError(f"{self.path}: Loop is {loop!r}; it must be 'wrap' or 'none'")
        _check_frames(self.path, frames)
        return _in_layout(self.character, self.path, loop, frames)

    def _malformed(self) -> ClipError:
        return ClipError(
            f"{self.path}: not a motion clip; it must be JSON with 'Loop' and with 'Frames' of "
            "equal length"
        )


def read_clip(character: Character, name_or_path: str) -> ClipFrames:
    """The motion of a clip, by name, or by the path of a `.txt` or `.json` file.

    Raises:
        ClipError: there is no such clip, it is malformed, or it does not fit the character.
    """
    return ClipFile(character, name_or_path).frames


def clip_path(character: Character, name_or_path: str) -> Path:
    """The file of a clip given by name or path. Raises ClipError if there is no such clip."""
    path = Path(name_or_path)
    if path.suffix.lower() in _SUFFIXES:
        return path
    refuse_other_kind(path, "a clip", _SUFFIXES, ClipError)
    if not character.clips.pattern:
        raise ClipError(
            f"character '{character.name}' has no clips by name: its file has no key 'clips'; give "
            "the path of a .json or .txt file"
        )
    clips = available_clips(character)
    if name_or_path not in clips:
        raise ClipError(
            f"{one_of('clip', name_or_path, clips)}, or the path of a .json or .txt file"
        )
    return Path(character.clips.pattern.replace("*", name_or_path))


def expand_clips(character: Character, names: Sequence[str]) -> list[str]:
    """Clips by name or path, those of a folder in its place, in the order of their paths.

    Raises:
        ClipError: a clip does not exist, or a folder has none.
    """
    clips: list[str] = []
    for name in names:
        folder = Path(name)
        if folder.is_dir() and name not in available_clips(character):
            found = (p for p in folder.rglob("*") if p.suffix in _SUFFIXES and not is_note(p))
            files = sorted(map(str, found))
            if not files:
                raise ClipError(f"{folder}: there is no .json or .txt file of motion in it")
            clips += files
        else:
            path = clip_path(character, name)
            if not path.is_file():
                raise ClipError(f"{path}: No such file or directory")
            clips.append(name)
    return list(dict.fromkeys(clips))


def is_note(path: Path) -> bool:
    """Whether a file among clips is a .txt file that has no JSON object: a licence, say."""
    if path.suffix.lower() != ".txt":
        return False
    try:
        with path.open("rb") as file:
            return not file.read(_BEGINNING_BYTES).lstrip().startswith(b"{")
    except OSError:
        return False  # reading it as a clip tells why


def _check_frames(path: Path, frames: FloatArray) -> None:
    if frames.ndim != 2 or len(frames) < 2:
        raise ClipError(f"{path}: needs two frames or more")
    sound = np.abs(frames) <= _LARGEST_NUMBER  # NaN is not sound
    if not sound.all():
        bad = int(np.argmin(sound.all(axis=1)))
        raise ClipError(f"{path}: frame {bad} holds a number that is not finite, or over 1e6")
    if not (frames[:-1, 0] > 0.0).all():
        bad = int(np.argmax(frames[:-1, 0] <= 0.0))
        raise ClipError(f"{path}: frame {bad} lasts {frames[bad, 0]} s; it must last some time")


def _in_layout(character: Character, path: Path, loop: str, frames: FloatArray) -> ClipFrames:
    layout, column = character.layout, _ROOT_COLUMNS
    if frames.shape[1] != _width(character):
        raise ClipError(
            f"{path}: frames have {frames.shape[1]} numbers; "
            f"character '{character.name}' needs {_width(character)}"
        )
    positions = np.tile(np.array(character.rest_position), (len(frames), 1))
    orientations = rotations.exp(positions[:, layout.rotation_entries])
    rotation_of = {int(start): k for k, start in enumerate(layout.rotation_entries[:, 0])}
    if layout.has_floating_base:
        root = character.placement.moved(*_root_upright(character, path, frames))
        positions[:, :3], orientations[:, 0] = root
    for name in character.clips.joints:
        joint = layout.joint(name)
        width = 4 if joint.type is JointType.SPHERICAL else 1
        values = frames[:, column : column + width]
        column += width
        if width == 4:
            turns = _quaternions(character, path, name, values)
            orientations[:, rotation_of[joint.start]] = turns
        else:
            signs, offsets = character.clips.signs, character.clips.offsets
            positions[:, joint.start] = signs.get(name, 1.0) * values[:, 0] + offsets.get(name, 0.0)
    bounds = character.position_bounds()
    within = np.clip(positions, *bounds)
    beyond = np.any(within != positions, axis=0)
    clamped = tuple(layout.dof_names[index] for index in np.flatnonzero(beyond))
    times = np.concatenate(([0.0], np.cumsum(frames[:-1, 0])))
    return ClipFrames(times, within, orientations, loop == "wrap", bounds, clamped)


def _width(character: Character) -> int:
    balls = [character.layout.joint(n).type is JointType.SPHERICAL for n in character.clips.joints]
    return _ROOT_COLUMNS + sum(4 if ball else 1 for ball in balls)


def _root_upright(
    character: Character, path: Path, frames: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Positions and orientations of the root in the character's own world, z up."""
    clips = character.clips
    position, turn = frames[:, 1:4], _quaternions(character, path, "root", frames[:, 4:8])
    if any(clips.base_rotation):
        turn = rotations.multiply(turn, rotations.exp(np.array(clips.base_rotation)))
    if clips.up_axis == "y":
        upright = rotations.ABOUT_X_QUARTER_TURN_XYZW
        return rotations.rotate(upright, position), rotations.multiply(upright, turn)
    return position, turn


def _quaternions(character: Character, path: Path, joint: str, values: FloatArray) -> FloatArray:
    """Unit quaternions xyzw; captured ones are rounded, and some shipped ones badly so."""
    lengths = fixed_order.norm(values)
    if lengths.min() < _SHORTEST_QUATERNION:
        raise ClipError(
            f"{path}: frame {lengths.argmin()}: the quaternion of '{joint}' has length "
            f"{lengths.min():.3g}; it must be 1"
        )
    if character.clips.quaternion == "wxyz":
        values = rotations.xyzw_from_wxyz(values)
    return rotations.normalised(values)
