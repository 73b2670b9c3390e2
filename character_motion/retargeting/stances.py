"""Feet and hands that stand on the ground stay where they are, and feet that swing are clear of it.

Toes or a heel that stand have one place on the ground, the mean of their time there, or that which
the other part of the foot, where it stands, leaves them. While no part of a foot stands, its sole
is lifted, so that it neither scuffs nor slides.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from character_motion.retargeting.contacts import Contact, mask, spans
from character_motion.retargeting.optimisation.goals import MARGIN, Goals, link_motion
from character_motion.retargeting.skeleton_map import SIDES
from character_motion.retargeting.target_body import TargetBody
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.geometry import rotations

_SOLE_WEIGHT, _HAND_WEIGHT = 1 / 0.001, 1 / 0.01  # 1/m, of points of soles and hands
_BLEND_TIME = 0.06  # s beside a stance in which it takes hold
_MAX_BLEND_SHARE = 0.05  # share by which it takes hold in that time
_FLAT_COSINE = 0.7  # cosine of the tilt of a sole that is put flat on the ground
# A sole that is not put flat is held along the ground alone.
_ALONG_GROUND = np.array((1.0, 1.0, 0.0))
_SWING_LIFT = 0.02  # m that a foot in the middle of its swing is lifted over the captured one
_LEAST_LIFT, _USUAL_LIFT, _MOST_LIFT = 0.02, 0.03, 0.08  # m; usual where the capture allows it
_LIFT_SPEED = 0.4  # m/s


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
    clearance: Mapping[str, FloatArray],
    frame_time: float,
) -> Goals:
    """The goals with feet and hands that stand still while they touch the ground.

    Args:
        goals: Those without contacts.
        target: The character.
        loose: Its motion for those goals (f, n), which says where it stands.
        contacts: Of `left_heel`, `left_toe`, `left_hand` and their like.
        clearance: By side, how far (f,) the lower of heel and toes is over the ground, m.
        frame_time: s.
    """
    frames = len(loose.position)
    points, lifted = _Points([], [], [], []), goals.clearance.copy()
    for side in SIDES:
        parts = [contacts[f"{side}_{part}"] for part in ("toe", "heel")]
        touching = [mask(tuple(each), frames) for each in parts]
        _hold_foot(points, target, loose, f"{side}_ankle", parts, frame_time)
        lift = _swing_clearance(touching[0] | touching[1], clearance[side], frame_time)
        foot = np.isin(goals.surface.links, target.below(f"{side}_ankle"))
        lifted[:, foot] += lift[:, np.newaxis]
        if contacts[f"{side}_hand"] and f"{side}_wrist" in target.map:
            _hold_hand(points, target, loose, f"{side}_wrist", contacts[f"{side}_hand"], frame_time)
    places, weights = np.stack(points.places, axis=1), np.stack(points.weights, axis=1)
    links: IntArray = np.array(points.links, dtype=np.intp)
    return replace(
        goals,
        point_links=np.concatenate((goals.point_links, links)),
        point_offsets=np.concatenate((goals.point_offsets, np.array(points.offsets))),
        places=np.concatenate((goals.places, places), axis=1),
        place_weights=np.concatenate((goals.place_weights, weights), axis=1),
        clearance=lifted,
    )


def _hold_foot(
    points: _Points,
    target: TargetBody,
    loose: GeneralizedPosition,
    ankle: str,
    contacts: Sequence[Sequence[Contact]],  # the contacts of toes and of heel
    frame_time: float,
) -> None:
    """Hold the middles of toes and heel where they touch the ground; on one the foot can pivot."""
    frames, link = len(loose.position), target.map[ankle]
    ends = target.soles(ankle).reshape(2, 2, 3).mean(axis=1)
    origins, turns = link_motion(target, loose, link)
    moving = np.stack([origins + rotations.rotate(turns, end) for end in ends], axis=1)
    upright = rotations.rotate(turns, target.foot_up(ankle))[:, 2]
    places, weights = np.zeros((frames, 2, 3)), np.zeros((frames, 2, 3))
    in_order = sorted(
        ((part, contact) for part in range(2) for contact in contacts[part]),
        key=lambda each: (each[1].first, each[0]),
    )
    placed: list[_Placed] = []
    for part, contact in in_order:
        # In a crawl a foot lies on its toes or on its back.
        lies = float(upright[contact.frames].mean()) < _FLAT_COSINE
        place = moving[contact.frames, part].mean(axis=0)
        if not lies:
            place = _beside(place, part, contact, placed, moving)
            placed.append(_Placed(part, contact, place))
        hold = _hold(mask((contact,), frames), frame_time)
        stronger = hold > weights[:, part, 0]
        places[stronger, part] = place
        weights[stronger, part] = hold[stronger, np.newaxis] * (_ALONG_GROUND if lies else 1.0)
    for part, end in enumerate(ends):
        points.links.append(link)
        points.offsets.append(end)
        points.places.append(places[:, part])
        points.weights.append(_SOLE_WEIGHT * weights[:, part])


@dataclass(frozen=True)
class _Placed:
    """Where toes (part 0) or a heel (part 1) stand during a contact."""

    part: int
    contact: Contact
    place: FloatArray  # (3,) m


def _beside(
    place: FloatArray,
    part: int,
    contact: Contact,
    placed: Sequence[_Placed],
    moving: FloatArray,
) -> FloatArray:
    """Where a part (3,) stands on the ground: as far from the other part as the foot is long.

    That is where the other part stands at the same time; by itself, it stands where it is.
    """
    overlaps = [
        (min(contact.last, other.contact.last) - max(contact.first, other.contact.first), other)
        for other in placed
        if other.part != part
    ]
    common, other = max(overlaps, key=lambda each: each[0], default=(-1, None))
    standing = np.array((place[0], place[1], MARGIN))
    if other is None or common < 0:
        return standing
    first = max(contact.first, other.contact.first)
    rows = slice(first, first + common + 1)
    ahead = (moving[rows, 0, :2] - moving[rows, 1, :2]).mean(axis=0)
    ahead /= max(float(np.linalg.norm(ahead)), 1e-9)
    length = float(np.linalg.norm(moving[0, 0] - moving[0, 1]))
    standing[:2] = other.place[:2] + (length if part == 0 else -length) * ahead
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
    points.weights.append(_HAND_WEIGHT * weights)


def _hold(touches: BoolArray, frame_time: float) -> FloatArray:
    """How firmly (f,) a point is held that touches in some frames: less and less beside them."""
    away = _time_from(touches, frame_time)
    return np.where(touches, 1.0, _MAX_BLEND_SHARE * np.maximum(1.0 - away / _BLEND_TIME, 0.0) ** 2)


def _swing_clearance(stands: BoolArray, captured: FloatArray, frame_time: float) -> FloatArray:
    """How far (f,) a sole is over the ground at least while nothing of the foot stands, m.

    A body that is tracked hangs lower by some centimetres, so it is what the captured foot (f,)
    clears in the middle of its swing, and more; but no more than it clears at most, and as far as
    it can be lifted in the time since it stood.
    """
    wanted = np.zeros(len(stands))
    for first, end in spans(~stands):
        quarter = (end - first) // 4
        lowest = captured[first + quarter : end - quarter].min()
        raised = max(lowest + _SWING_LIFT, _USUAL_LIFT)
        wanted[first:end] = min(raised, captured[first:end].max())
    in_time = _LIFT_SPEED * _time_from(stands, frame_time)
    lifted: FloatArray = np.minimum(np.clip(wanted, _LEAST_LIFT, _MOST_LIFT), in_time)
    return lifted


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
