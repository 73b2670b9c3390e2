"""BVH files made into clips of a character."""

import hashlib
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from character_motion.bvh.reading import read_bvh
from character_motion.bvh.skeleton import BvhMotion
from character_motion.clips.motion_clip import MotionClip
from character_motion.clips.quality import (
    ClipQuality,
    describe_shortcomings,
    link_poses,
    measure_quality,
)
from character_motion.retargeting.optimisation.inverse_kinematics import Progress
from character_motion.retargeting.retargeting import (
    RetargetedMotion,
    RetargetingSettings,
    retarget,
)
from character_motion.retargeting.target_body import TargetBody
from msgs_config.arrays import FloatArray
from msgs_config.errors import ClipError
from msgs_config.geometry import rotations

_MOST_FRAMES = 30_000  # frames of a clip: its file can still be read


@dataclass(frozen=True)
class ImportedClip:
    """A clip, what it was made from, and how well it shows that."""

    clip: MotionClip
    retargeted: RetargetedMotion
    quality: ClipQuality
    worst_joint: str  # a role, such as `left_elbow`
    worst_mean_rad: float  # mean angle between the segment and the captured one
    worst_max_rad: float
    remarks: tuple[str, ...]  # a sentence each on the capture and on the clip


def import_bvh(
    path: Path,
    target: TargetBody,
    settings: RetargetingSettings | None = None,
    *,
    part: tuple[float, float | None] = (0.0, None),
    licence: str = "",
    progress: Progress | None = None,
) -> ImportedClip:
    """Make a clip of a BVH file.

    Args:
        path: The file.
        target: The character.
        settings: What is told rather than found out.
        part: From when to when in s of the file; None is its end.
        licence: Of the file; empty if it is not known.
        progress: Is told how many of twice the frames are done.

    Raises:
        ClipError: the file is no sound BVH, or its skeleton is none of a body.
    """
    motion = _part_of(path, read_bvh(path), *part)
    made = retarget(path, motion, target, settings, progress)
    times: FloatArray = motion.frame_time * np.arange(made.source.frames, dtype=float)
    source = _source(path, motion, made, licence)
    contacts = {
        point: tuple((float(times[each.first]), float(times[each.last])) for each in found)
        for point, found in made.contacts.items()
    }
    clip = MotionClip(target.character, times, made.motion, False, contacts, source)
    quality = measure_quality(target, clip)
    worst, mean, most = _worst_joint(target, clip, made)
    content = {
        **quality.content(),
        "worst_joint": worst,
        "worst_joint_mean_rad": round(mean, 4),
        "worst_joint_max_rad": round(most, 4),
    }
    remarks = (*made.remarks, *describe_shortcomings(content))
    whole = replace(clip, quality=content | ({"remarks": remarks} if remarks else {}))
    return ImportedClip(whole, made, quality, worst, mean, most, remarks)


def _source(path: Path, motion: BvhMotion, made: RetargetedMotion, licence: str) -> dict[str, Any]:
    """Where a clip comes from, as its file has it."""
    conventions, joints = made.conventions, made.source.map.joints
    source: dict[str, Any] = {
        "file": path.name,
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "frames": len(motion.values),
        "rate_hz": round(1.0 / motion.frame_time, 3),
        "up": conventions.up,
        "unit_m": round(conventions.unit_length, 6),
        "rest_pose": conventions.rest,
        "first_frame": conventions.first_frame,
        "scale": round(made.scale, 6),
        "joints": {role: made.source.names[index] for role, index in joints.items()},
    }
    return source | ({"licence": licence} if licence else {})


def _part_of(path: Path, motion: BvhMotion, start: float, end: float | None) -> BvhMotion:
    """The frames of a motion from a time to another one, s."""
    if not (math.isfinite(start) and (end is None or math.isfinite(end))):
        raise ClipError(f"{path}: from {start:g} s to {end:g} s: both must be finite")
    frames = len(motion.values)
    last = frames - 1 if end is None else round(end / motion.frame_time)
    first = round(start / motion.frame_time)
    if not 0 <= first < last < frames:
        raise ClipError(
            f"{path}: from {start:g} s to {'its end' if end is None else f'{end:g} s'} is no part "
            f"of two frames or more; it lasts {(frames - 1) * motion.frame_time:.3f} s"
        )
    if last - first >= _MOST_FRAMES:
        raise ClipError(
            f"{path}: {last - first + 1} frames; a clip has at most {_MOST_FRAMES}, so choose a "
            "part by --from and --to"
        )
    return replace(motion, values=motion.values[first : last + 1])


def _worst_joint(
    target: TargetBody, clip: MotionClip, made: RetargetedMotion
) -> tuple[str, float, float]:
    """The segment that is turned worst: its role, mean and largest angle in rad to the captured.

    Of a limb it is the angle between the bones, as a turn about a bone is uncertain.
    """
    _, turns = link_poses(target, clip)
    errors = {}
    for role, wanted in made.turns.turns_xyzw.items():
        own = turns[:, target.map[role]]
        if role in made.turns.bones:
            apart = rotations.multiply(own, rotations.conjugate(wanted))
            bone = made.turns.bones[role]
            cosine = (rotations.rotate(apart, bone) * bone).sum(axis=-1)
            errors[role] = np.arccos(np.clip(cosine, -1.0, 1.0))
        else:
            errors[role] = rotations.angle_between(own, wanted)
    worst = max(errors, key=lambda role: float(errors[role].mean()))
    return worst, float(errors[worst].mean()), float(errors[worst].max())
