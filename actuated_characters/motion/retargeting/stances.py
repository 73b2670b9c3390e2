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
_LYING = 0.1  # of the hold of one that is not
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
        touching = [mask(contacts[f"{side}_{part}"], frames) for part in ("toe", "heel")]
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
    """Hold the corners of a sole where its toes and heel touch the ground."""
    frames, link, sole = len(touching[0]), target.map[ankle], target.soles(ankle)
    origins, turns = link_motion(target, loose, link)
    corners = np.stack([origins + rotations.rotate(turns, corner) for corner in sole], axis=1)
    places, weights = np.zeros((frames, 4, 3)), np.zeros((frames, 4, 3))
    for stance in joined(touching[0] | touching[1], frame_time):
        rows = stance.frames
        upright = rotations.rotate(turns[rows], target.foot_up(ankle))[:, 2].mean()
        lies = float(upright) < _FLAT  # as in a crawl, on its toes or its back
        held = (
            corners[rows].mean(axis=0)
            if lies
            else _on_ground(sole, corners[rows], [touches[rows] for touches in touching])
        )
        for part, pair in enumerate((slice(0, 2), slice(2, 4))):
            touches = np.zeros(frames, dtype=np.bool_)
            touches[rows] = touching[part][rows]
            hold = (_LYING if lies else 1.0) * _hold(touches, frame_time)
            stronger = hold > weights[:, pair.start, 0]
            places[stronger, pair] = held[pair]
            weights[stronger, pair] = hold[stronger, np.newaxis, np.newaxis]
    for number, corner in enumerate(sole):
        points.links.append(link)
        points.offsets.append(corner)
        points.places.append(places[:, number])
        points.weights.append(_STANDING * weights[:, number])


def _on_ground(
    sole: FloatArray, corners: FloatArray, touching: Sequence[BoolArray]
) -> FloatArray:
    """Where the corners (4, 3) of a sole stand flat, of where they were (f, 4, 3) in a stance."""
    flat = touching[0] & touching[1]
    some = flat if flat.any() else touching[0] | touching[1]
    ahead = (corners[:, :2].mean(axis=1) - corners[:, 2:].mean(axis=1))[some, :2].mean(axis=0)
    ahead /= max(float(np.linalg.norm(ahead)), 1e-9)
    length = float(np.linalg.norm(sole[:2].mean(axis=0) - sole[2:].mean(axis=0)))
    width = float(np.linalg.norm(sole[0] - sole[1]))
    ends = []  # where the toes would be, by themselves and by the heel
    for part, pair in enumerate((slice(0, 2), slice(2, 4))):
        rows = flat if flat.any() else touching[part]
        if rows.any():
            end = corners[rows, pair].mean(axis=(0, 1))[:2]
            ends.append(end + part * length * ahead)
    toes = np.mean(ends, axis=0)
    across = 0.5 * width * np.array((-ahead[1], ahead[0]))
    heel = toes - length * ahead
    flat_corners = np.full((4, 3), MARGIN)
    flat_corners[:, :2] = (toes + across, toes - across, heel + across, heel - across)
    return flat_corners


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
