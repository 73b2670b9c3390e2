"""How good a clip is: feet in the ground, feet that slide, limits that are touched, speeds."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from character_motion.clips.motion_clip import MotionClip
from character_motion.retargeting.contacts import spans
from character_motion.retargeting.skeleton_map import SIDES
from character_motion.retargeting.target_body import TargetBody
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.geometry import rotations

_AT_LIMIT = 0.03  # rad from a limit
_SHORTEST_SWING = 0.2  # s
_BLOCK = 256  # frames that are measured at once
_OVERLAPS, _IN_GROUND, _CLEARANCE = 0.005, 0.01, 0.01  # m beyond which there is a remark
_REMARKED_SKATING, _MIN_SHARE = 0.05, 0.05  # m/s, and share of the frames, for a remark
_DIGITS = 4


@dataclass(frozen=True)
class ClipQuality:
    """What was measured of a clip."""

    feet_in_ground_m: float  # the deepest point of a sole
    deepest_m: float  # the deepest point of any link
    deepest_link: str
    skating_mean_m_s: float | None  # speed of the parts of soles that stand; None if none does
    skating_p95_m_s: float | None
    standing_share: float  # share of the time in which a foot stands
    swing_clearance_m: float | None  # least height in the middle of a swing; None without one
    overlap_m: float  # how deep two shapes are in each other at the most
    overlap_pair: str
    overlap_share: float  # share of the frames with an overlap that deserves a remark
    limits_touched: dict[str, float]  # share of frames at a limit by degree of freedom
    fastest_joint: str
    fastest_joint_rad_s: float

    def content(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            name: round(value, _DIGITS) if isinstance(value, float) else value
            for name, value in asdict(self).items()
        }


def measure_quality(target: TargetBody, clip: MotionClip) -> ClipQuality:
    """Measure a clip of a character.

    Skating is the horizontal speed of the middle of heel or toes from frame to frame while it
    touches the ground, in m/s; depths are in m.
    """
    character, layout = target.character, target.character.layout
    origins, turns = link_poses(target, clip)
    overlaps, overlapping = _overlaps(target, origins, turns)
    depths = _depths(target, origins, turns)
    deepest = int(np.argmax(depths))
    sink, speeds, stands = 0.0, [np.empty(0)], np.zeros(len(clip.times), dtype=np.bool_)
    clearances: list[float] = []
    durations = np.diff(clip.times)
    for side in SIDES:
        link = target.map[f"{side}_ankle"]
        corners = origins[:, link, np.newaxis] + rotations.rotate(
            turns[:, link, np.newaxis], target.soles(f"{side}_ankle")
        )
        sink = max(sink, float(-corners[..., 2].min()))
        clearances += _swing_clearances(clip, side, corners[..., 2].min(axis=1))
        for part, pair in (("toe", slice(0, 2)), ("heel", slice(2, 4))):
            touches = clip.touching(f"{side}_{part}")
            middle = corners[:, pair, :2].mean(axis=1)
            speed = np.linalg.norm(np.diff(middle, axis=0), axis=-1) / durations
            speeds.append(speed[touches[1:] & touches[:-1]])
            stands |= touches
    velocity = layout.difference(_part(clip, slice(-1)), _part(clip, slice(1, None)))
    fast = np.abs(velocity[:, 6:]) / durations[:, np.newaxis]
    fastest = int(np.argmax(fast.max(axis=0)))
    skating = np.concatenate(speeds)
    return ClipQuality(
        feet_in_ground_m=sink,
        deepest_m=max(float(depths[deepest]), 0.0),
        deepest_link=character.links[int(target.surface.links[deepest])].name,
        skating_mean_m_s=float(skating.mean()) if len(skating) else None,
        skating_p95_m_s=float(np.percentile(skating, 95)) if len(skating) else None,
        standing_share=float(stands.mean()),
        swing_clearance_m=min(clearances, default=None),
        overlap_m=float(overlaps.max()),
        overlap_pair=overlapping,
        overlap_share=float((overlaps > _OVERLAPS).mean()),
        limits_touched=_limits_touched(target, clip),
        fastest_joint=layout.dof_names[6 + fastest],
        fastest_joint_rad_s=float(fast[:, fastest].max()),
    )


def _depths(target: TargetBody, origins: FloatArray, turns: FloatArray) -> FloatArray:
    """How deep (p,) each point of the surface is in the ground at most, m; below 0 over it."""
    surface, deepest = target.surface, np.full(len(target.surface.links), -np.inf)
    for rows in _blocks(len(origins)):
        arms = rotations.rotate(turns[rows][:, surface.links], surface.offsets)
        depths = surface.radii - origins[rows][:, surface.links, 2] - arms[..., 2]
        deepest = np.maximum(deepest, depths.max(axis=0))
    return deepest


def _overlaps(target: TargetBody, origins: FloatArray, turns: FloatArray) -> tuple[FloatArray, str]:
    """The depth (f,) in m of the two shapes that are deepest in each other, and which these are."""
    capsules, links = target.capsules, target.character.links
    overlaps = np.zeros(len(origins))
    if not len(capsules.pairs):
        return overlaps, ""
    deepest = np.full(len(capsules.pairs), -np.inf)
    for rows in _blocks(len(origins)):
        depths = -capsules.nearest(origins[rows], rotations.matrix(turns[rows])).distance
        overlaps[rows] = np.maximum(depths.max(axis=1), 0.0)
        deepest = np.maximum(deepest, depths.max(axis=0))
    worst = capsules.pairs[int(np.argmax(deepest))]
    pair = " and ".join(links[int(capsules.links[each])].name for each in worst)
    return overlaps, pair


def _blocks(frames: int) -> Iterator[slice]:
    """The frames in parts, whose arrays fit into memory where a robot has thousands of points."""
    for first in range(0, frames, _BLOCK):
        yield slice(first, first + _BLOCK)


def _swing_clearances(clip: MotionClip, side: str, heights: FloatArray) -> list[float]:
    """The least height of a sole (f,) over the ground in the middle of each of its swings, m.

    A swing lies between two times in which the foot stands; its middle is half of it.
    """
    stands = clip.touching(f"{side}_heel") | clip.touching(f"{side}_toe")
    swings = [span for span in spans(~stands) if span[0] > 0 and span[1] < len(stands)]
    found = []
    for first, end in swings:
        quarter = (end - first) // 4
        if clip.times[end] - clip.times[first] > _SHORTEST_SWING:
            found.append(float(heights[first + quarter : end - quarter].min()))
    return found


def describe_shortcomings(quality: Mapping[str, Any]) -> list[str]:
    """Remarks on a clip's figures that are beyond their bounds, a sentence each."""
    bounds = (
        ("overlap_m", _OVERLAPS, "shapes overlap by up to {:.1f} mm", 1e3),
        ("feet_in_ground_m", _IN_GROUND, "soles are in the ground by up to {:.1f} mm", 1e3),
        ("skating_mean_m_s", _REMARKED_SKATING, "standing feet skate at {:.1f} cm/s", 1e2),
    )
    remarks = []
    for name, bound, text, factor in bounds:
        value = quality.get(name)
        if value is not None and value > bound:
            remarks.append(f"{text.format(factor * value)}, more than {factor * bound:g}")
    clearance = quality.get("swing_clearance_m")
    if clearance is not None and clearance < _CLEARANCE:
        remarks.append(
            f"a foot that swings clears the ground by {1e3 * clearance:.1f} mm, less than "
            f"{1e3 * _CLEARANCE:g}: it will scuff where the body hangs lower"
        )
    share = quality.get("standing_share")
    if share is not None and share < _MIN_SHARE:
        remarks.append(
            f"a foot stands in {100 * share:.0f} % of the frames, fewer than {100 * _MIN_SHARE:g} %"
        )
    return remarks


def link_poses(target: TargetBody, clip: MotionClip) -> tuple[FloatArray, FloatArray]:
    """Origins (f, l, 3) in m and turns (f, l, 4) of all links in the world."""
    model, still = DynamicsModel(target.character), np.zeros(target.character.layout.size)
    poses = []
    for position in _part(clip, slice(None)).position:
        model.update(position, still)
        poses.append(model.link_poses())
    return np.array([pose[0] for pose in poses]), np.array([pose[1] for pose in poses])


def _part(clip: MotionClip, rows: slice) -> Any:
    """Some frames, rotations also as vectors."""
    from msgs_config.character.layout import GeneralizedPosition

    positions, turns = clip.motion.position[rows].copy(), clip.motion.orientations_xyzw[rows]
    positions[:, clip.character.layout.rotation_entries] = rotations.log(turns)
    return GeneralizedPosition(positions, turns)


def _limits_touched(target: TargetBody, clip: MotionClip) -> dict[str, float]:
    """The degrees of freedom that are at a limit in some frames, and the share of these."""
    lower, upper = target.bounds
    positions = _part(clip, slice(None)).position
    at = (positions < lower + _AT_LIMIT) | (positions > upper - _AT_LIMIT)
    shares = at.mean(axis=0)
    names = target.character.layout.dof_names
    return {
        names[index]: round(float(shares[index]), _DIGITS) for index in np.flatnonzero(shares > 0)
    }
