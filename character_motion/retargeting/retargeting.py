"""Captured motion made into motion of a character: the steps, one after another."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from character_motion.bvh.axes_and_units import UNITS
from character_motion.bvh.skeleton import POSITIONS, BvhMotion, Skeleton
from character_motion.retargeting.captured_body import CapturedBody, captured_body
from character_motion.retargeting.contacts import (
    Contact,
    find_contacts,
    flat_frames,
    ground_height,
    smoothed,
)
from character_motion.retargeting.conventions import (
    Conventions,
    feet_point_backwards,
    find_unit,
    find_up,
    first_heading,
    leading_poses,
    rest_name,
    to_upright,
)
from character_motion.retargeting.optimisation.goals import first_guess, free_goals
from character_motion.retargeting.optimisation.inverse_kinematics import InverseKinematics, Progress
from character_motion.retargeting.own_skeleton import own_motion
from character_motion.retargeting.plausibility import (
    describe_floating,
    doubts_of_human,
    ground_drift,
)
from character_motion.retargeting.segments import SegmentTurns, segment_turns
from character_motion.retargeting.skeleton_map import SIDES, ancestors, find_map
from character_motion.retargeting.stances import with_stances
from character_motion.retargeting.target_body import TargetBody
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.errors import ClipError
from msgs_config.geometry import rotations

_STILL_SHARE = 1e-4  # share of a leg's length; a root that moves less does not move
_HAND_HEIGHT = 0.05  # m of a wrist over the lowest joint of the feet, while the hand stands


@dataclass(frozen=True)
class RetargetingSettings:
    """What is told rather than found out."""

    joints: Mapping[str, str] | None = None  # the skeleton's joints, by role
    up: str | None = None  # an axis
    unit: str | None = None  # a key of `UNITS`
    ground: bool = False  # whether feet that float are put on the ground


@dataclass(frozen=True)
class RetargetedMotion:
    """A captured motion, and the same of a character."""

    source: CapturedBody  # the capture in the character's size and world, z up
    conventions: Conventions
    scale: float  # the character's lengths over the file's, in the file's unit
    contacts: Mapping[str, tuple[Contact, ...]]  # by point, such as `left_heel`
    turns: SegmentTurns  # the turns that were to be shown
    motion: GeneralizedPosition  # (f, n), (f, k, 4)
    remarks: tuple[str, ...] = ()  # a sentence each on the capture


def read_body(
    place: object, motion: BvhMotion, settings: RetargetingSettings
) -> tuple[CapturedBody, Conventions]:
    """The body of a BVH motion in m, z up, that faces along x at first; and how the file had it.

    Raises:
        ClipError: joints are missing, or the motion is too short.
    """
    skeleton = motion.skeleton
    joints = find_map(place, skeleton.names, skeleton.parents, settings.joints)
    body = captured_body(motion, joints)
    if not body.leg_length > 0.0:
        raise ClipError(f"{place}: the legs have no length; the offsets of the joints must say it")
    first = leading_poses(body)
    body = body.since(first)
    if body.frames < 2:
        raise ClipError(f"{place}: {body.frames} frame; a motion needs two or more")
    swapped = feet_point_backwards(body)
    if swapped:
        body = replace(body, map=body.map.swapped())
    up = settings.up or find_up(body)
    unit, length = (
        find_unit(body.leg_length)
        if settings.unit is None
        else (settings.unit, UNITS[settings.unit])
    )
    rest = rest_name(body)
    body = body.turned(to_upright(up)).scaled(length)
    heading = first_heading(body)
    body = body.turned(rotations.about_z(-heading))
    moves = _root_moves(body, skeleton)
    if not moves:
        body = _moved_by_feet(body)
    return body, Conventions(up, unit, length, heading, rest, first, swapped, moves)


def retarget(
    place: object,
    motion: BvhMotion,
    target: TargetBody,
    settings: RetargetingSettings | None = None,
    progress: Progress | None = None,
) -> RetargetedMotion:
    """The motion of a character that does what a BVH motion shows.

    Args:
        place: The file, for errors.
        motion: What was captured.
        target: The character.
        settings: What is told.
        progress: Is told how many of twice the frames are done.

    Raises:
        ClipError: joints are missing, or the motion is too short.
    """
    settings = settings or RetargetingSettings()
    body, conventions = read_body(place, motion, settings)
    remarks = _human_remarks(body)
    scale = target.leg_length / body.leg_length
    body = body.scaled(scale)
    if settings.ground:
        down = np.zeros((body.frames, 3))
        down[:, 2] = -ground_drift(body)
        body = body.moved(down)
    elif floating := describe_floating(body):
        remarks = (*remarks, floating)
    body = _on_ground(body, target)
    contacts = body_contacts(body)
    flat = {f"{side}_ankle": flat_frames(contacts, side, body.frames) for side in SIDES}
    turns = segment_turns(body, target, flat)
    own = own_motion(motion, target)
    if own is None:
        solver = InverseKinematics(target, body.frame_time)
        goals = free_goals(body, target, turns)
        guess = first_guess(body, target, turns)
        loose = solver.solve(guess, goals, _share(progress, 0, body.frames))
        clearance = foot_clearance(body)
        goals = with_stances(goals, target, loose, contacts, clearance, body.frame_time)
        shown = solver.solve(loose, goals, _share(progress, body.frames, body.frames))
    else:  # nothing is to be altered, not even where it stands
        rows = slice(conventions.first_frame, None)
        shown = GeneralizedPosition(own.position[rows], own.orientations_xyzw[rows])
        conventions = replace(conventions, is_own=True)
    unit = scale * conventions.unit_length
    return RetargetedMotion(body, conventions, unit, contacts, turns, shown, remarks)


def _human_remarks(body: CapturedBody) -> tuple[str, ...]:
    doubts = doubts_of_human(body)
    return (f"is this a human? {'; '.join(doubts)}",) if doubts else ()


def _on_ground(body: CapturedBody, target: TargetBody) -> CapturedBody:
    """A body of a character's size moved to the origin, its ankles to where the character's are."""
    heights = [smoothed(body.part(f"{side}_ankle"), body.frame_time)[:, 2] for side in SIDES]
    rise = target.ankle_height - ground_height(np.concatenate(heights))
    x, y, _ = body.middle("hip")[0]
    return body.moved(np.tile((-x, -y, rise), (body.frames, 1)))


def _root_moves(body: CapturedBody, skeleton: Skeleton) -> bool:
    """Whether the file says where the body is: its pelvis, or what that hangs on, is moved."""
    line = ancestors(body.map["pelvis"], skeleton.parents)
    has_channels = any(name in POSITIONS for joint in line for name in skeleton.channels[joint])
    spread = float(np.ptp(body.part("pelvis"), axis=0).max())
    return has_channels and spread > _STILL_SHARE * body.leg_length


def _share(progress: Progress | None, before: int, frames: int) -> Progress | None:
    """The progress of one of two passes over the frames, the first one of which has `before`."""
    if progress is None:
        return None
    return lambda done, total: progress(before + done, 2 * frames)


def body_contacts(body: CapturedBody) -> dict[str, tuple[Contact, ...]]:
    """The contacts of heels, toes and hands of a body in a character's size with the ground."""
    contacts, floor = {}, np.inf
    for part, role in (("heel", "ankle"), ("toe", "toe")):
        points = {side: _foot_point(body, side, role) for side in SIDES}
        heights = [smoothed(point, body.frame_time)[:, 2] for point in points.values()]
        ground = ground_height(np.concatenate(heights))
        floor = min(floor, ground)
        for side, point in points.items():
            contacts[f"{side}_{part}"] = find_contacts(point, ground, body.frame_time)
    for side in SIDES:
        wrist = f"{side}_wrist"
        contacts[f"{side}_hand"] = (
            find_contacts(body.part(wrist), floor + _HAND_HEIGHT, body.frame_time)
            if wrist in body.map
            else ()
        )
    return contacts


def foot_clearance(body: CapturedBody) -> dict[str, FloatArray]:
    """How far (f,) the lower of heel and toes is over where it is on the ground, by side, m."""
    clearance: dict[str, FloatArray] = {}
    for role in ("ankle", "toe"):
        heights = {
            side: smoothed(_foot_point(body, side, role), body.frame_time)[:, 2] for side in SIDES
        }
        ground = ground_height(np.concatenate([*heights.values()]))
        for side, height in heights.items():
            above = np.maximum(height - ground, 0.0)
            clearance[side] = np.minimum(clearance.get(side, above), above)
    return clearance


def _foot_point(body: CapturedBody, side: str, role: str) -> FloatArray:
    """Where the ankle (f, 3) of a foot is, or its toes, or what is at their place."""
    name = f"{side}_{role}"
    node = body.map[name] if name in body.map else body.tip(f"{side}_ankle")
    return body.part(f"{side}_ankle") if node is None else body.positions[:, node]


def _moved_by_feet(body: CapturedBody) -> CapturedBody:
    """A body whose root stands still, moved so that the lower foot does."""
    feet = [
        body.positions[:, body.map[f"{side}_{part}"]]
        for side in SIDES
        for part in ("ankle", "toe")
        if f"{side}_{part}" in body.map
    ]
    points = np.stack(feet, axis=1)  # (f, p, 3)
    heights = points[..., 2] - points[..., 2].min(axis=0)
    lowest = points[..., 2].min(axis=1)
    moved = -np.diff(points, axis=0)
    standing = np.argmin(heights[1:] + heights[:-1], axis=1)
    steps = moved[np.arange(len(standing)), standing]
    offsets = np.concatenate((np.zeros((1, 3)), np.cumsum(steps, axis=0)))
    offsets[:, 2] = -lowest
    return body.moved(offsets)
