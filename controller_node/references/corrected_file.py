"""The project's own format for a corrected motion: a clip with its corrections, as JSON.

`Loop` and `Frames` are those of the clip (`clip_file.py`), so that whatever reads clips reads the
motion. `Corrections` has the names of the degrees of freedom corrected (`dofs`), the ends of the
windows in s (`ends`) and a row of offsets for each of them, rad or m (`offsets`). `Feedback` has
gains by name (`feedback_gains.py`), `WindowFeedback` those of each window of a cycle
(`window_gains.py`). What made the file stands in `Reconstruction`; what is tracked
does not depend on it, but a run takes its length, its parameters and its pushes from there.
"""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from controller_node.feedback_gains import checked_gains
from controller_node.references.clip_file import clip_path
from controller_node.references.corrected import Corrections
from controller_node.window_gains import WindowGains, window_gains
from msgs_config.arrays import FloatArray
from msgs_config.character import Character
from msgs_config.errors import ClipError, ConfigurationError, LayoutError
from msgs_config.files import read_text
from msgs_config.joint_layout import ROOT, JointLayout

CORRECTIONS, FEEDBACK, RECONSTRUCTION = "Corrections", "Feedback", "Reconstruction"
WINDOW_FEEDBACK = "WindowFeedback"
SUFFIX = ".json"

_LARGEST_OFFSET = 1e3  # rad or m; more is a mistake


def read_corrections(character: Character, name_or_path: str) -> Corrections | None:
    """The corrections in a clip's file, None if it has none.

    Raises:
        ClipError: there is no such clip, or its corrections are malformed or of other joints.
    """
    if not name_or_path.endswith(SUFFIX):
        return None
    path = clip_path(character, name_or_path)
    content = _content(path)
    if CORRECTIONS not in content:
        return None
    return _corrections(path, character.layout, content[CORRECTIONS])


def read_feedback(character: Character, name_or_path: str) -> dict[str, float]:
    """The gains of the feedback in a clip's file, by name; none if it has none.

    Raises:
        ClipError: there is no such clip, or a gain is unknown or no number.
    """
    if not name_or_path.endswith(SUFFIX):
        return {}
    path = clip_path(character, name_or_path)
    gains = _content(path).get(FEEDBACK, {})
    if not isinstance(gains, dict):
        raise ClipError(f"{path}: {FEEDBACK} must have gains by name")
    try:
        return checked_gains(gains)
    except ConfigurationError as error:
        raise ClipError(f"{path}: {FEEDBACK}: {error}") from error


def read_window_feedback(character: Character, name_or_path: str) -> WindowGains | None:
    """The window feedback in a clip's file, None if it has none.

    Raises:
        ClipError: there is no such clip, or the feedback is malformed.
    """
    if not name_or_path.endswith(SUFFIX):
        return None
    path = clip_path(character, name_or_path)
    content = _content(path).get(WINDOW_FEEDBACK)
    if content is None:
        return None
    try:
        return window_gains(content)
    except ConfigurationError as error:
        raise ClipError(f"{path}: {WINDOW_FEEDBACK}: {error}") from error


@dataclass(frozen=True)
class FoundWith:
    """The run in which a corrected motion was found; in any other one it is another motion."""

    duration: float  # s, as far as it was found
    simulator: Mapping[str, object]  # parameters of `sim_node`, by name
    controller: Mapping[str, object]  # of `controller_node`
    pushes: tuple[str, ...]  # LINK:FX,FY,FZ@S, which the search knew beforehand


def read_found_with(character: Character, name_or_path: str) -> FoundWith | None:
    """The run that a clip's file was found with, None if it does not say.

    Raises:
        ClipError: there is no such clip, or what it says is malformed.
    """
    if not name_or_path.endswith(SUFFIX):
        return None
    path = clip_path(character, name_or_path)
    content = _content(path)
    made = content.get(RECONSTRUCTION)
    if made is None:
        return None
    try:
        sides = made["parameters"]
        duration = float(made["duration"])
        if not made["complete"]:
            duration = min(duration, float(max(content[CORRECTIONS]["ends"], default=0.0)))
        pushes = made.get("pushes", [])
        if not isinstance(pushes, list) or not all(isinstance(push, str) for push in pushes):
            raise TypeError
        found = FoundWith(
            duration, dict(sides["sim_node"]), dict(sides["controller_node"]), tuple(pushes)
        )
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ClipError(
            f"{path}: {RECONSTRUCTION} must have 'duration', 'complete', 'parameters' of sim_node "
            "and of controller_node, and 'pushes' as texts, if any"
        ) from error
    return found


def read_reconstruction(path: Path) -> dict[str, Any]:
    """What made a corrected motion, as its file says.

    Raises:
        ClipError: the file is no corrected motion.
    """
    made = _content(path).get(RECONSTRUCTION)
    if not isinstance(made, dict):
        raise ClipError(f"{path}: not a corrected motion; it has no '{RECONSTRUCTION}'")
    return made


def write_corrected(
    path: Path,
    clip: Path,
    layout: JointLayout,
    corrections: Corrections,
    reconstruction: Mapping[str, object],
    feedback: Mapping[str, float] | None = None,
    by_window: WindowGains | None = None,
) -> None:
    """Write a clip's content with corrections; the file is there at once, or as it was before.

    Raises:
        ClipError: the clip cannot be read, or the file cannot be written.
    """
    motion = _content(clip)
    corrected = np.flatnonzero(corrections.offsets.any(axis=0))
    owners = [joint for joint in layout.joints if np.isin(corrected, np.r_[joint.entries]).any()]
    dofs = tuple(name for joint in owners for name in joint.dof_names)
    content = {
        "Loop": motion.get("Loop"),
        CORRECTIONS: {
            "dofs": dofs,
            "ends": corrections.ends,
            "offsets": corrections.offsets[:, layout.indices(dofs)].tolist(),
        },
        FEEDBACK: dict(feedback or {}),
        **({} if by_window is None else {WINDOW_FEEDBACK: by_window.content()}),
        RECONSTRUCTION: dict(reconstruction),
        "Frames": motion.get("Frames"),
    }
    write_whole(path, json.dumps(content, allow_nan=False) + "\n")


def write_whole(path: Path, text: str) -> None:
    """Write a text file so that nobody ever sees a part of it. Raises ClipError if it cannot be."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except OSError as error:
        raise ClipError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)


def _content(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(read_text(path, ClipError))
    except (ValueError, RecursionError) as error:
        raise ClipError(f"{path}: not a motion clip; it must be JSON") from error
    if not isinstance(content, dict):
        raise ClipError(f"{path}: not a motion clip; it must be a JSON object")
    return content


def _corrections(path: Path, layout: JointLayout, content: Any) -> Corrections:
    place = f"{path}: {CORRECTIONS}"
    try:
        dofs = tuple(str(name) for name in content["dofs"])
        ends = np.array(content["ends"], dtype=float)
        rows = np.array(content["offsets"], dtype=float)
    except (ValueError, KeyError, TypeError, OverflowError) as error:
        raise ClipError(f"{place} must have 'dofs', 'ends' and 'offsets' of numbers") from error
    try:
        indices = layout.indices(dofs)
    except LayoutError as error:
        raise ClipError(f"{place}: {error}") from error
    if rows.size == 0:
        rows = rows.reshape(len(ends), len(dofs))
    if ends.ndim != 1 or rows.shape != (len(ends), len(dofs)):
        raise ClipError(
            f"{place}: offsets are {rows.shape}; they must be a row a window and a column a degree "
            f"of freedom: {(*ends.shape, len(dofs))}"
        )
    if layout.has_floating_base and np.isin(indices, np.r_[layout.joint(ROOT).entries]).any():
        raise ClipError(f"{place}: '{ROOT}' is corrected; only joints with a motor can be")
    if not (np.diff(ends, prepend=0.0) > 0.0).all():  # NaN is not
        raise ClipError(f"{place}: ends must rise from above 0 s")
    if not (np.abs(rows) <= _LARGEST_OFFSET).all():
        raise ClipError(f"{place}: an offset is not finite, or over {_LARGEST_OFFSET:g}")
    offsets: FloatArray = np.zeros((len(ends), layout.size))
    offsets[:, indices] = rows
    return Corrections(tuple(ends.tolist()), offsets)
