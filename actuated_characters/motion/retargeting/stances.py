"""Feet and hands that stand on the ground stay where they are, and feet that swing are clear of it.

A foot that stands has one place and heading on the ground, the mean of its time there; its heel,
its toes or both are held at it. While no part of it stands, its sole is lifted as far as it can be
in the time since it stood, so that it neither scuffs nor slides.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from actuated_characters.motion.retargeting.contacts import Contact, joined, mask
from actuated_characters.motion.retargeting.goals import MARGIN, link_motion
from actuated_characters.motion.retargeting.inverse_kinematics import Goals
from actuated_characters.motion.retargeting.skeleton_map import SIDES
from actuated_characters.motion.retargeting.target_body import TargetBody
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.geometry import rotations

_STANDING, _HAND = 1 / 0.001, 1 / 0.01  # 1/m, of points of soles and hands
_BLEND, _BLENDED = 0.06, 0.05  # s before and after it in which a stance takes hold, and how far
_FLAT = 0.7  # cosine of the tilt of a sole that is put flat on the ground
_ALONG = np.array((1.0, 1.0, 0.0))  # one that is not is held along the ground alone
_LIFT, _LIFT_SPEED = 0.02, 0.25  # m and m/s by which a foot that swings is clear of the ground


@dataclass
class _Points:
    """Points that are held, frame by frame."""

    links: list[int]
    offsets: list[FloatArray]
    places: list[FloatArray]  # (f, 3) each
    weights: list[FloatArray]  # (f, 3) each


def with_stances(
    goals: Goals,
    target: TargetBody,
    loose: GeneralizedPosition,
    contacts: Mapping[str, Sequence[Contact]],
    frame_time: float,
) -> Goals:
    """The goals with feet and hands that stand still while they touch the ground.

    Args:
        goals: Those without contacts.
        target: The character.
        loose: Its motion for those goals (f, n), which says where it stands.
        contacts: Of `left_heel`, `left_toe`, `left_hand` and their like.
        frame_time: s.
    """
    frames = len(loose.position)
    points, clearance = _Points([], [], [], []), goals.clearance.copy()
    for side in SIDES:
        touching = [mask(tuple(contacts[f"{side}_{part}"]), frames) for part in ("toe", "heel")]
        _hold_foot(points, target, loose, f"{side}_ankle", touching, frame_time)
        lift = _swing_clearance(touching[0] | touching[1], frame_time)
        foot = goals.surface.links == target.map[f"{side}_ankle"]
        clearance[:, foot] += lift[:, np.newaxis]
        if contacts[f"{side}_hand"]:
            _hold_hand(points, target, loose, f"{side}_wrist", contacts[f"{side}_hand"], frame_time)
    places, weights = np.stack(points.places, axis=1), np.stack(points.weights, axis=1)
    links: IntArray = np.array(points.links, dtype=np.intp)
    return replace(
        goals,
        point_links=np.concatenate((goals.point_links, links)),
        point_offsets=np.concatenate((goals.point_offsets, np.array(points.offsets))),
        places=np.concatenate((goals.places, places), axis=1),
        place_weights=np.concatenate((goals.place_weights, weights), axis=1),
        clearance=clearance,
    )


def _hold_foot(
    points: _Points,
    target: TargetBody,
    loose: GeneralizedPosition,
    ankle: str,
    touching: Sequence[BoolArray],  # toes and heel, (f,) each
    frame_time: float,
) -> None:
    """Hold the middles of toes and heel where they touch the ground; on one the foot can pivot."""
    frames, link = len(touching[0]), target.map[ankle]
    ends = target.soles(ankle).reshape(2, 2, 3).mean(axis=1)  # the middles of toes and heel
    origins, turns = link_motion(target, loose, link)
    moving = np.stack([origins + rotations.rotate(turns, end) for end in ends], axis=1)
    places, weights = np.zeros((frames, 2, 3)), np.zeros((frames, 2, 3))
    for stance in joined(touching[0] | touching[1], frame_time):
        rows = stance.frames
        upright = rotations.rotate(turns[rows], target.foot_up(ankle))[:, 2].mean()
        lies = float(upright) < _FLAT  # as in a crawl, on its toes or its back
        length = float(np.linalg.norm(ends[0] - ends[1]))
        standing = _on_ground(length, moving[rows], [touches[rows] for touches in touching])
        for part in range(2):
            touches = np.zeros(frames, dtype=np.bool_)
            touches[rows] = touching[part][rows]
            if not touches.any():
                continue
            hold = _hold(touches, frame_time)
            stronger = hold > weights[:, part, 0]
            places[stronger, part] = moving[touches, part].mean(axis=0) if lies else standing[part]
            weights[stronger, part] = hold[stronger, np.newaxis] * (_ALONG if lies else 1.0)
    for part, end in enumerate(ends):
        points.links.append(link)
        points.offsets.append(end)
        points.places.append(places[:, part])
        points.weights.append(_STANDING * weights[:, part])


def _on_ground(length: float, ends: FloatArray, touching: Sequence[BoolArray]) -> FloatArray:
    """Where the middles (2, 3) of toes and heel stand flat, of where they were (f, 2, 3)."""
    flat = touching[0] & touching[1]
    some = flat if flat.any() else touching[0] | touching[1]
    ahead = (ends[some, 0, :2] - ends[some, 1, :2]).mean(axis=0)
    ahead /= max(float(np.linalg.norm(ahead)), 1e-9)
    toes = []  # where the toes are, by themselves and by the heel
    for part in range(2):
        rows = flat if flat.any() else touching[part]
        if rows.any():
            toes.append(ends[rows, part, :2].mean(axis=0) + part * length * ahead)
    toe = np.mean(toes, axis=0)
    standing = np.full((2, 3), MARGIN)
    standing[:, :2] = toe, toe - length * ahead
    return standing


def _hold_hand(
    points: _Points,
    target: TargetBody,
    loose: GeneralizedPosition,
    wrist: str,
    contacts: Sequence[Contact],
    frame_time: float,
) -> None:
    """Hold a hand where it touches the ground."""
    frames, link = len(loose.position), target.map[wrist]
    origins, _ = link_motion(target, loose, link)
    radius = max(target.surface.radii[target.surface.links == link], default=0.0)
    places, weights = np.zeros((frames, 3)), np.zeros((frames, 3))
    for contact in contacts:
        hold = _hold(mask((contact,), frames), frame_time)
        stronger = hold > weights[:, 0]
        places[stronger] = origins[contact.frames].mean(axis=0)
        places[stronger, 2] = radius + MARGIN
        weights[stronger] = hold[stronger, np.newaxis]
    points.links.append(link)
    points.offsets.append(np.zeros(3))
    points.places.append(places)
    points.weights.append(_HAND * weights)


def _hold(touches: BoolArray, frame_time: float) -> FloatArray:
    """How firmly (f,) a point is held that touches in some frames: less and less beside them."""
    away = _time_from(touches, frame_time)
    return np.where(touches, 1.0, _BLENDED * np.maximum(1.0 - away / _BLEND, 0.0) ** 2)


def _swing_clearance(stands: BoolArray, frame_time: float) -> FloatArray:
    """How far (f,) a sole is over the ground while nothing of the foot stands, m."""
    return np.minimum(_LIFT, _LIFT_SPEED * _time_from(stands, frame_time))


def _time_from(touches: BoolArray, frame_time: float) -> FloatArray:
    """Time (f,) in s from each frame to the nearest one that touches; long if there is none."""
    rows, at = np.arange(len(touches)), np.flatnonzero(touches)
    if not len(at):
        return np.full(len(touches), 1e3)
    after = np.searchsorted(at, rows).clip(0, len(at) - 1)
    before = (after - 1).clip(0)
    apart = np.minimum(np.abs(at[after] - rows), np.abs(at[before] - rows))
    away: FloatArray = apart * frame_time
    return away
