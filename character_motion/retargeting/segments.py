"""How the segments of a captured body are turned, as those of a character would be.

A segment's turn is that of two directions that body and character both have: a bone and the axis
about which the joint below it bends, or left and up of pelvis and chest. So neither the pose of
zero rotations nor the axes of the joints matter, which differ from maker to maker.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from character_motion.retargeting.captured_body import CapturedBody
from character_motion.retargeting.conventions import quaternion, rest_up
from character_motion.retargeting.skeleton_map import SIDES
from character_motion.retargeting.target_body import BELOW, TargetBody
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.geometry import rotations

_UP, _LEFT, _AHEAD = np.eye(3)[2], np.eye(3)[1], np.eye(3)[0]
_BENT = (0.15, 0.45)  # sines of the angle of knee or elbow between which its own axis takes over
_MIN_FRAMES = 5  # frames on the ground that tell how a sole lies
_SOLE_TILT_COSINE = np.cos(np.radians(50.0))  # a foot that is tilted more at rest has no sole

Across = Callable[[FloatArray], FloatArray]
"""The axis (f, 3) about which a limb usually bends whose upper bone is (f, 3)."""

Frame = tuple[FloatArray, FloatArray]
"""Two directions (..., 3) each: the first one is kept, the second one as far as it is across."""


@dataclass(frozen=True)
class SegmentTurns:
    """Turns (f, 4) of a character's links in the world that show what a captured body does."""

    turns_xyzw: Mapping[str, FloatArray]  # by role
    bones: Mapping[str, FloatArray]  # (f, 3) by role: the axis about which a turn is uncertain


def segment_turns(
    body: CapturedBody, target: TargetBody, flat: Mapping[str, BoolArray]
) -> SegmentTurns:
    """The turns of all segments of a body whose world's z is up.

    Args:
        body: What was captured, in f frames.
        target: The character.
        flat: By ankle's role, the frames (f,) in which the foot stands flat on the ground.
    """
    frames, bones = {}, {}
    up_at_rest = rest_up(body)
    frames["pelvis"] = pelvis = _pelvis(body, up_at_rest)
    frames["chest"] = chest = _chest(body, up_at_rest)
    if "head" in body.map:
        frames["head"] = _head(body, chest, up_at_rest)
    for side in SIDES:
        hip, knee, ankle = (f"{side}_{part}" for part in ("hip", "knee", "ankle"))
        shoulder, elbow = f"{side}_shoulder", f"{side}_elbow"
        limb = _limb(body, (hip, knee, ankle), _usual_knee(pelvis))
        frames[hip], frames[knee] = limb
        frames[ankle] = _foot(body, ankle, limb[1], flat[ankle], up_at_rest)
        limb = _limb(body, (shoulder, elbow, f"{side}_wrist"), _usual_elbow(chest))
        frames[shoulder], frames[elbow] = limb
        for role in (hip, knee, shoulder, elbow):
            bones[role] = frames[role][0]
    turns = {
        role: _turn_of_link(target, role, frame)
        for role, frame in frames.items()
        if role in target.map
    }
    return SegmentTurns(turns, {role: bone for role, bone in bones.items() if role in turns})


def _turn_of_link(target: TargetBody, role: str, frame: Frame) -> FloatArray:
    """The turn (f, 4) of a character's link whose directions at rest have become a frame."""
    side = role.partition("_")[0]
    part = role.removeprefix(f"{side}_") if side in SIDES else role
    if part in BELOW:
        first, second = target.bone(role), _bend_axis(target, side, part)
    else:
        first = {"pelvis": _LEFT, "chest": _UP, "head": _UP}.get(part, _AHEAD)
        second = {"pelvis": _UP, "ankle": _UP}.get(part, _LEFT)
    at_rest = _axes((first, second))
    turn = quaternion(_axes(frame) @ at_rest.swapaxes(-1, -2))
    return rotations.normalised(rotations.multiply(turn, target.turns_xyzw[target.map[role]]))


def _bend_axis(target: TargetBody, side: str, part: str) -> FloatArray:
    """The axis (3,) at rest about which a character's knee or elbow bends, of a leg or an arm.

    A knee bends backwards and an elbow to the front, as far as the hinge's axis leaves it open.
    """
    upper, middle = ("hip", "knee") if part in ("hip", "knee") else ("shoulder", "elbow")
    bone = target.bone(f"{side}_{upper}")
    usual = np.cross(bone, -_AHEAD if middle == "knee" else _AHEAD)
    axis = target.bend_axis(side, middle)
    if axis is None:
        return _unit(usual)
    along = float(_unit(usual) @ axis)
    return axis if along >= 0.0 else -axis


def _pelvis(body: CapturedBody, up_at_rest: FloatArray | None) -> Frame:
    """Left and up of the pelvis: across the hips, and as at rest or along the spine."""
    left = _mean_in_joint(body, "pelvis", body.part("left_hip") - body.part("right_hip"))
    along = body.middle_of_spine() - body.middle("hip")
    up = _mean_in_joint(body, "pelvis", along) if up_at_rest is None else up_at_rest
    turn = body.orientation("pelvis")
    return rotations.rotate(turn, left), rotations.rotate(turn, up)


def _chest(body: CapturedBody, up_at_rest: FloatArray | None) -> Frame:
    """Up and left of the chest: as at rest or along the spine, and across the shoulders."""
    left = _mean_in_joint(body, "chest", body.part("left_shoulder") - body.part("right_shoulder"))
    along = body.neck_base() - body.middle_of_spine()
    up = _mean_in_joint(body, "chest", along) if up_at_rest is None else up_at_rest
    turn = body.orientation("chest")
    return rotations.rotate(turn, up), rotations.rotate(turn, left)


def _head(body: CapturedBody, chest: Frame, up_at_rest: FloatArray | None) -> Frame:
    """Up and left of the head, which on the average are those of the chest, or so at rest."""
    up, left = (_mean_in_joint(body, "head", direction) for direction in chest)
    if up_at_rest is not None:
        up = up_at_rest
        left = _mean_in_joint(body, "chest", chest[1])  # all joints are parallel at rest
    turn = body.orientation("head")
    return rotations.rotate(turn, up), rotations.rotate(turn, left)


def _usual_knee(pelvis: Frame) -> Across:
    """Knees bend backwards, seen from the pelvis."""
    ahead = np.cross(pelvis[0], pelvis[1])
    return lambda bone: np.cross(ahead, bone)


def _usual_elbow(chest: Frame) -> Across:
    """Elbows bend to the front, seen from the chest."""
    ahead = np.cross(chest[1], chest[0])
    return lambda bone: np.cross(bone, ahead)


def _limb(body: CapturedBody, roles: tuple[str, str, str], usual: Across) -> tuple[Frame, Frame]:
    """Both bones of a limb, each with the axis about which the joint between them bends.

    Of a limb that is straight it is the axis that the upper joint has carried all the time.
    """
    upper, middle, lower = roles
    end = body.map[lower] if lower in body.map else body.tip(middle)
    first = _unit(body.part(middle) - body.part(upper))
    second = first if end is None else _unit(body.positions[:, end] - body.part(middle))
    across = np.cross(first, second)
    sine = np.linalg.norm(across, axis=-1)
    weight = np.where((across * usual(first)).sum(axis=-1) > -0.5 * sine, sine**2, 0.0)
    weight = np.where(sine > _BENT[0], weight, 0.0)
    local = body.in_joint(upper, _unit(across))
    carried = (weight[:, None] * local).sum(axis=0)
    carried = carried + 0.05 * body.in_joint(upper, _unit(usual(first))).mean(axis=0)
    axis = rotations.rotate(body.orientation(upper), _unit(carried))
    bent = np.clip((sine - _BENT[0]) / (_BENT[1] - _BENT[0]), 0.0, 1.0)[:, None]
    bent = bent * bent * (3.0 - 2.0 * bent)
    forwards = (across * axis).sum(axis=-1, keepdims=True) > 0.0
    axis = _unit(np.where(forwards, bent * _unit(across), 0.0) + (1.0 - bent) * axis + 1e-9)
    return (first, axis), (second, axis)


def _foot(
    body: CapturedBody,
    ankle: str,
    shank: Frame,
    flat: BoolArray,
    up_at_rest: FloatArray | None,
) -> Frame:
    """Where the toes point, and up of the sole: as it lies on the ground, or at rest."""
    toe = ankle.replace("ankle", "toe")
    tip = body.map[toe] if toe in body.map else body.tip(ankle)
    shown_up = body.in_joint(ankle, np.broadcast_to(_UP, shank[0].shape))
    up = _unit(-body.in_joint(ankle, shank[0]).mean(axis=0)) if up_at_rest is None else up_at_rest
    if flat.sum() >= _MIN_FRAMES:
        lying = _unit(shown_up[flat].mean(axis=0))
        if up_at_rest is None or float(lying @ up_at_rest) > _SOLE_TILT_COSINE:
            up = lying
    if tip is None:
        ahead = body.in_joint(ankle, np.cross(shank[1], -shank[0])).mean(axis=0)
    else:
        ahead = _mean_in_joint(body, ankle, body.positions[:, tip] - body.part(ankle))
    ahead = _unit(ahead - (ahead @ up) * up)
    turn = body.orientation(ankle)
    return rotations.rotate(turn, ahead), rotations.rotate(turn, up)


def _mean_in_joint(body: CapturedBody, role: str, vectors: FloatArray) -> FloatArray:
    """The direction (3,) that vectors (f, 3) have in a joint's frame on the average."""
    return _unit(body.in_joint(role, _unit(vectors)).mean(axis=0))


def _axes(frame: Frame) -> FloatArray:
    """The rotation matrices (..., 3, 3) with a frame's first direction as their first column."""
    first = _unit(frame[0])
    third = _unit(np.cross(first, frame[1]))
    return np.stack((first, np.cross(third, first), third), axis=-1)


def _unit(vectors: FloatArray) -> FloatArray:
    unit: FloatArray = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
    return unit
