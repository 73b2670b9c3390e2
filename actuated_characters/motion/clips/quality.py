"""How good a clip is: feet in the ground, feet that slide, limits that are touched, speeds."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from actuated_characters.motion.clips.motion_clip import MotionClip
from actuated_characters.motion.retargeting.skeleton_map import SIDES
from actuated_characters.motion.retargeting.target_body import TargetBody
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.geometry import rotations

_AT_LIMIT = 0.03  # rad
_DIGITS = 4


@dataclass(frozen=True)
class ClipQuality:
    """What was measured of a clip."""

    feet_in_ground_m: float  # the deepest point of a sole
    deepest_m: float  # the deepest point of any link
    deepest_link: str
    skating_mean_m_s: float | None  # of the parts of soles that stand; None if none does
    skating_p95_m_s: float | None
    standing_share: float  # of the time in which a foot stands
    limits_touched: dict[str, float]  # by degree of freedom, the share of frames at a limit
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
    surface = target.surface
    arms = rotations.rotate(turns[:, surface.links], surface.offsets)
    depths = surface.radii - origins[:, surface.links, 2] - arms[..., 2]
    deepest = int(np.argmax(depths.max(axis=0)))
    sink, speeds, stands = 0.0, [np.empty(0)], np.zeros(len(clip.times), dtype=np.bool_)
    durations = np.diff(clip.times)
    for side in SIDES:
        link = target.map[f"{side}_ankle"]
        corners = origins[:, link, np.newaxis] + rotations.rotate(
            turns[:, link, np.newaxis], target.soles(f"{side}_ankle")
        )
        sink = max(sink, float(-corners[..., 2].min()))
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
        deepest_m=max(float(depths[:, deepest].max()), 0.0),
        deepest_link=character.links[int(surface.links[deepest])].name,
        skating_mean_m_s=float(skating.mean()) if len(skating) else None,
        skating_p95_m_s=float(np.percentile(skating, 95)) if len(skating) else None,
        standing_share=float(stands.mean()),
        limits_touched=_limits_touched(target, clip),
        fastest_joint=layout.dof_names[6 + fastest],
        fastest_joint_rad_s=float(fast[:, fastest].max()),
    )


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
