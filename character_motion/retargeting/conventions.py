"""How a file means its numbers: which axis is up, where the body faces, units, the first frame.

All of it is found out from the motion: a standing body has its trunk above its legs, and the
lowest point of a body that goes about stays at one height, that of the ground.
"""

import math
from dataclasses import dataclass

import numpy as np

from character_motion.bvh.axes_and_units import AXES, UNITS
from character_motion.retargeting.captured_body import CapturedBody
from character_motion.retargeting.skeleton_map import SIDES
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations

_LEG = 0.82  # m from the hip to the ankle of an adult
_USUAL_UNITS = ("m", "cm", "mm", "inches", "feet")
_SCALE_TOLERANCE = 0.35  # difference of natural logarithms: a leg of 0.58 m to 1.16 m
_PRIOR = {"y": 0.10, "z": 0.05, "x": -0.05, "-x": -0.3, "-y": -0.2, "-z": -0.2}
_UPRIGHT_COSINE = math.cos(math.radians(38.0))  # least cosine of the tilt of legs and trunk at rest
_JUMP = 0.12  # lengths of a leg that joints move from a pose that was put first
_MORE_THAN_ELSE = 6.0  # times as far as joints move between other frames
_FACING_TIME = 0.1  # s over which a body's first heading is measured


@dataclass(frozen=True)
class Conventions:
    """How a file means its numbers."""

    up: str  # an axis, from `AXES`
    unit: str  # from `UNITS`, or `?`
    unit_length: float  # m
    heading: float  # rad about up, of the body at first, from the axis that comes after up
    rest: str  # what the pose of zero rotations is
    first_frame: int  # first frame of the motion; a pose that was put before it is left out
    sides_swapped: bool  # what is called left is right
    root_moves: bool  # whether the file says where the root is
    is_own: bool = False  # the skeleton is the character's own, and the motion taken as it is

    def described(self) -> str:
        """A line of it."""
        unit = "" if self.unit == "?" else f" ({self.unit})"
        parts = [
            f"up is {self.up}",
            f"unit {self.unit_length:.4g} m{unit}",
            f"rest pose {self.rest}",
            f"heading {math.degrees(self.heading):.0f} degrees",
        ]
        if self.first_frame:
            parts.append("without its first frame, a pose that the motion does not go on from")
        if self.sides_swapped:
            parts.append("left and right exchanged, as the feet point backwards")
        if not self.root_moves:
            parts.append("the root stands still, so the feet say where it goes")
        if self.is_own:
            parts.append("the character's own skeleton, whose motion is taken as it is")
        return ", ".join(parts)


def leading_poses(body: CapturedBody) -> int:
    """Number of frames before the motion: 1 if a pose was put first, as makers do, else 0."""
    if body.frames < 4:
        return 0
    relative = body.positions - body.middle("hip")[:, np.newaxis]
    moved = np.linalg.norm(np.diff(relative, axis=0), axis=-1).mean(axis=-1)
    usual = float(np.max(moved[1 : min(len(moved), 1 + round(1.0 / body.frame_time))]))
    limit = max(_JUMP * body.leg_length, _MORE_THAN_ELSE * usual)
    return int(moved[0] > limit or (moved[0] > 3.0 * usual and _is_rest(body)))


def _is_rest(body: CapturedBody) -> bool:
    """Whether the first frame is the pose of zero rotations, wherever the root is."""
    turn = rotations.conjugate(body.orientations_xyzw[0, :1])
    apart = rotations.angle_between(
        rotations.multiply(turn, body.orientations_xyzw[0]),
        np.array(rotations.IDENTITY_XYZW),
    )
    return bool(apart.max() < 0.05)


def find_up(body: CapturedBody) -> str:
    """The axis that points up, from `AXES`."""
    hips, ankles, neck = body.middle("hip"), body.middle("ankle"), body.neck_base()
    posture = _unit(_unit(neck - hips) + _unit(hips - ankles)).mean(axis=0)
    size = body.leg_length
    scores = {}
    for axis in AXES:
        direction = axis_vector(axis)
        lowest = (body.positions @ direction).min(axis=1)
        spread = float(np.subtract(*np.percentile(lowest, (95, 5)))) / size
        scores[axis] = float(posture @ direction) - min(spread, 1.0) + _PRIOR[axis]
    return max(scores, key=lambda axis: scores[axis])


def axis_vector(axis: str) -> FloatArray:
    """The unit vector (3,) of an axis, from `AXES`."""
    vector = np.zeros(3)
    vector["xyz".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
    return vector


def to_upright(up: str) -> FloatArray:
    """The turn (4,) that leads an axis up to z, and the one after it to x."""
    direction = axis_vector(up)
    ahead = np.roll(np.abs(direction), 1)
    return quaternion(np.array((ahead, np.cross(direction, ahead), direction)))


def quaternion(matrix: FloatArray) -> FloatArray:
    """The unit quaternion xyzw (..., 4) of rotation matrices (..., 3, 3), by the largest part.

    Source: Shepperd 1978, "Quaternion from Rotation Matrix".
    """
    m = matrix
    diagonal = np.stack((m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]), axis=-1)
    trace = diagonal.sum(axis=-1)
    squares = np.concatenate((1.0 + 2.0 * diagonal - trace[..., None], 1.0 + trace[..., None]), -1)
    skew = [m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]]
    s01, s02, s12 = (m[..., i, j] + m[..., j, i] for i, j in ((0, 1), (0, 2), (1, 2)))
    candidates = np.stack(
        [
            np.stack((squares[..., 0], s01, s02, skew[0]), axis=-1),
            np.stack((s01, squares[..., 1], s12, skew[1]), axis=-1),
            np.stack((s02, s12, squares[..., 2], skew[2]), axis=-1),
            np.stack((skew[0], skew[1], skew[2], squares[..., 3]), axis=-1),
        ],
        axis=-2,
    )
    largest = np.argmax(squares, axis=-1)[..., None, None]
    return _unit(np.take_along_axis(candidates, largest, axis=-2)[..., 0, :])


def forwards(body: CapturedBody) -> FloatArray:
    """The direction (f, 3) in which the pelvis faces, in a world whose z is up; of length 1.

    Of a body that lies it is where its front would be if it stood up about its left-right axis.
    """
    left = body.part(f"{SIDES[0]}_hip") - body.part(f"{SIDES[1]}_hip")
    ahead = np.cross(left, (0.0, 0.0, 1.0))
    return _unit(ahead)


def feet_point_backwards(body: CapturedBody) -> bool:
    """Whether the feet point against the pelvis: left and right are named the other way round."""
    along = []
    for side in SIDES:
        tip = body.map[f"{side}_toe"] if f"{side}_toe" in body.map else body.tip(f"{side}_ankle")
        if tip is None:
            return False
        trunk = body.neck_base() - body.middle("hip")
        left = body.part(f"{SIDES[0]}_hip") - body.part(f"{SIDES[1]}_hip")
        front = _unit(np.cross(left, trunk))
        toe = _unit(body.positions[:, tip] - body.part(f"{side}_ankle"))
        along.append((front * toe).sum(axis=-1).mean())
    return float(np.mean(along)) < -0.3


def first_heading(body: CapturedBody) -> float:
    """The angle in rad about z of where the body faces at first; its world's z is up."""
    count = max(1, round(_FACING_TIME / body.frame_time))
    x, y, _ = forwards(body)[:count].mean(axis=0).tolist()
    return math.atan2(y, x)


def rest_up(body: CapturedBody) -> FloatArray | None:
    """The direction (3,) that is up in the pose of zero rotations; None if it does not stand.

    In a T-pose and its kin, legs hang from the pelvis and the trunk stands on it.
    """
    rest, named = body.rest, body.map
    hips = 0.5 * sum(rest[named[f"{side}_hip"]] for side in SIDES)
    neck = rest[named["neck"]] if "neck" in named else rest[named["chest"]]
    if named.joints.get("neck", named["chest"]) == named["chest"]:
        neck = 0.5 * sum(rest[named[f"{side}_shoulder"]] for side in SIDES)
    trunk = neck - hips
    if np.linalg.norm(trunk) < 0.2 * body.leg_length:
        return None
    up = np.zeros(3)
    largest = int(np.argmax(np.abs(trunk)))
    up[largest] = np.sign(trunk[largest])
    bones = [trunk]
    for side in SIDES:
        points = [rest[named[f"{side}_{part}"]] for part in ("ankle", "knee", "hip")]
        bones += [points[1] - points[0], points[2] - points[1]]
    return up if all(float(_unit(bone) @ up) > _UPRIGHT_COSINE for bone in bones) else None


def rest_name(body: CapturedBody) -> str:
    """What the pose of zero rotations is: `T`, `A` or `I` by its arms, or `none`."""
    up = rest_up(body)
    if up is None:
        return "none"
    named = body.map
    heights = []
    for side in SIDES:
        arm = body.rest[named[f"{side}_elbow"]] - body.rest[named[f"{side}_shoulder"]]
        heights.append(math.degrees(math.asin(float(np.clip(_unit(arm) @ up, -1.0, 1.0)))))
    angle = float(np.mean(heights))
    return "T" if angle > -20.0 else "A" if angle > -65.0 else "I"


def find_unit(leg: float) -> tuple[str, float]:
    """The unit in which a leg from hip to ankle has a human length, and its length in m.

    It is `?` with the length that makes it an adult's if none fits.
    """
    apart = {unit: abs(math.log(leg * UNITS[unit] / _LEG)) for unit in _USUAL_UNITS}
    nearest = min(apart, key=lambda unit: apart[unit])
    return (nearest, UNITS[nearest]) if apart[nearest] < _SCALE_TOLERANCE else ("?", _LEG / leg)


def _unit(vectors: FloatArray) -> FloatArray:
    unit: FloatArray = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
    return unit
