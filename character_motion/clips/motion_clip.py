"""A motion clip with what is known of it: its source, contacts with the ground, quality."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.model import Character
from msgs_config.clips.reading import ClipFile, ClipFrames
from msgs_config.clips.writing import clip_rows, clip_text
from msgs_config.errors import ClipError
from msgs_config.whole_files import write_whole

SOURCE, CONTACTS, QUALITY = "Source", "Contacts", "Quality"
_FIGURES = ("_m", "_m_s", "_rad", "_rad_s")  # names of figures end in their units
_EPSILON = 1e-6  # s

Spans = tuple[tuple[float, float], ...]
"""Times in s from when to when."""


@dataclass(frozen=True)
class MotionClip:
    """A motion of a character in f frames."""

    character: Character
    times: FloatArray  # (f,) s, rising from 0
    motion: GeneralizedPosition  # (f, n), (f, k, 4)
    wraps: bool = False  # whether it goes on from its end
    contacts: Mapping[str, Spans] = field(default_factory=dict)
    """By point, such as `left_heel`, `left_toe` and `left_hand`."""
    source: Mapping[str, Any] = field(default_factory=dict)
    """Where it comes from: file, its hash, licence, and what was done with it."""
    quality: Mapping[str, Any] = field(default_factory=dict)

    @property
    def duration(self) -> float:
        """Length in s."""
        return float(self.times[-1])

    @property
    def rate(self) -> float:
        """Frames a second, Hz, on the average."""
        return (len(self.times) - 1) / self.duration

    def touching(self, point: str) -> BoolArray:
        """The frames (f,) in which a point touches the ground."""
        touches = np.zeros(len(self.times), dtype=np.bool_)
        for start, end in self.contacts.get(point, ()):
            touches |= (self.times >= start - _EPSILON) & (self.times <= end + _EPSILON)
        return touches

    def edited(self, how: str, **changes: Any) -> "MotionClip":
        """The clip with changes, and a line in its source that says so; its quality is unknown."""
        history = [*self.source.get("edits", []), how]
        source = {**self.source, "edits": history}
        return replace(self, **changes, source=source, quality=changes.get("quality", {}))

    def text(self) -> str:
        """The text of a clip's file."""
        rows = clip_rows(self.character, self.times, self.motion)
        known: dict[str, Any] = {}
        if self.source:
            known[SOURCE] = dict(self.source)
        if self.contacts:
            known[CONTACTS] = {
                point: [[round(t, 6) for t in span] for span in spans]
                for point, spans in self.contacts.items()
            }
        if self.quality:
            known[QUALITY] = dict(self.quality)
        return clip_text(rows, wraps=self.wraps, known=known)

    def write(self, path: Path) -> None:
        """Write it as a file, whole or not at all. Raises RecordingError if that fails."""
        write_whole(path, self.text())


def read_motion_clip(character: Character, name_or_path: str) -> MotionClip:
    """A clip by name or path, with what its file says of it.

    Raises:
        ClipError: there is no such clip, it is malformed, or it does not fit the character.
    """
    file = ClipFile(character, name_or_path)
    frames: ClipFrames = file.frames
    source = _mapping(file, SOURCE)
    if not isinstance(source.get("edits", []), list):
        raise ClipError(f"{file.path}: {SOURCE}: edits must be a list")
    return MotionClip(
        character=character,
        times=frames.times,
        motion=GeneralizedPosition(frames.positions, frames.orientations_xyzw),
        wraps=frames.wraps,
        contacts=_contacts(file, float(frames.times[-1])),
        source=source or {"clip": file.path.name},
        quality=_quality(file),
    )


def _mapping(file: ClipFile, key: str) -> dict[str, Any]:
    content = file.content.get(key, {})
    if not isinstance(content, dict):
        raise ClipError(
            f"{file.path}: {key} is {json.dumps(content)[:60]}; it must be a JSON object"
        )
    return content


def _quality(file: ClipFile) -> dict[str, Any]:
    quality = _mapping(file, QUALITY)
    for name, value in quality.items():
        is_number = isinstance(value, int | float) or value is None
        if name.endswith(_FIGURES) and not is_number:
            shown = json.dumps(value)[:60]
            raise ClipError(f"{file.path}: {QUALITY}: {name} is {shown}; it must be a number")
    return quality


def _contacts(file: ClipFile, duration: float) -> dict[str, Spans]:
    contacts = {}
    for point, spans in _mapping(file, CONTACTS).items():
        try:
            found = tuple((float(start), float(end)) for start, end in spans)
        except (TypeError, ValueError) as error:
            raise _wrong_contacts(file, point, duration) from error
        flat = [time for span in found for time in span]
        if not all(0.0 <= time <= duration + 1e-3 for time in flat) or sorted(flat) != flat:
            raise _wrong_contacts(file, point, duration)
        contacts[point] = found
    return contacts


def _wrong_contacts(file: ClipFile, point: str, duration: float) -> ClipError:
    shown = json.dumps(file.content[CONTACTS][point])[:60]
    return ClipError(
        f"{file.path}: {CONTACTS}: {point} is {shown}; it must be a list of [start, end] in s, "
        f"rising from 0 to {math.ceil(duration * 1e3) / 1e3:g}"
    )
