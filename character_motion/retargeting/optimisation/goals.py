"""What a character's links should do to show a captured motion: the goals of its kinematics."""

from dataclasses import dataclass, replace

import numpy as np

from character_motion.retargeting.captured_body import CapturedBody
from character_motion.retargeting.optimisation.capsules import Capsules
from character_motion.retargeting.optimisation.joint_angles import joint_angles
from character_motion.retargeting.segments import SegmentTurns
from character_motion.retargeting.skeleton_map import SIDES
from character_motion.retargeting.target_body import SurfacePoints, TargetBody
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.geometry import rotations

# Weights: one over what counts as a residual of one
_TURNS = {"pelvis": 1 / 0.06, "chest": 1 / 0.06, "head": 1 / 0.12, "ankle": 1 / 0.12}
_BONE, _TWIST = 1 / 0.06, 1 / 0.5  # rad, of limbs across and about their bones
_PELVIS = np.array((1 / 0.03, 1 / 0.03, 1 / 0.03))  # m
_ANKLE = 1 / 0.03  # m
_GROUND, _LIMIT = 1 / 0.001, 1 / 0.005  # m below the ground, rad beyond a limit
_OVERLAP = 1 / 0.002  # m
_ACCELERATION, _ROOT_ACCELERATION = 90.0, 25.0  # rad/s^2 and m/s^2
MARGIN = 0.001  # m over the ground


@dataclass(frozen=True)
class Goals:
    """What the links should do in f frames; weights are those of residuals."""

    links: IntArray  # (k,) whose turns are given
    turns_xyzw: FloatArray  # (f, k, 4), world
    turn_weights: FloatArray  # (f, k, 3, 3) 1/rad, of rotation vectors in world axes
    point_links: IntArray  # (p,) links that the points move with
    point_offsets: FloatArray  # (p, 3) m, in the link frame
    places: FloatArray  # (f, p, 3) m, where the points should be
    place_weights: FloatArray  # (f, p, 3) 1/m
    surface: SurfacePoints
    clearance: FloatArray  # (f, s) m, of each ball of the surface over the ground
    ground_weight: float  # 1/m below that clearance
    capsules: Capsules
    overlap_weight: float  # 1/m nearer to each other than their margins
    limit_weight: float  # 1/rad beyond a limit
    acceleration: FloatArray  # (n,) m/s^2 or rad/s^2 that count as much as a residual of one

    def part(self, frames: slice) -> "Goals":
        """The goals of some frames."""
        return replace(
            self,
            turns_xyzw=self.turns_xyzw[frames],
            turn_weights=self.turn_weights[frames],
            places=self.places[frames],
            place_weights=self.place_weights[frames],
            clearance=self.clearance[frames],
        )


def free_goals(body: CapturedBody, target: TargetBody, turns: SegmentTurns) -> Goals:
    """The goals without contacts: turns of all segments, places of pelvis and ankles."""
    roles = list(turns.turns_xyzw)
    wanted = np.stack([turns.turns_xyzw[role] for role in roles], axis=1)
    weights = np.stack([_turn_weights(role, turns, body.frames) for role in roles], axis=1)
    ankles = [f"{side}_ankle" for side in SIDES]
    names = ["pelvis", *ankles]
    offsets = [hips_in_pelvis(target), *(target.offset(ankle) for ankle in ankles)]
    places = np.stack([body.middle("hip"), *(body.part(role) for role in ankles)], axis=1)
    place_weights = np.tile(
        np.array([_PELVIS, *([_ANKLE] * 3 for _ in ankles)]), (body.frames, 1, 1)
    )
    layout = target.character.layout
    acceleration = np.full(layout.size, _ACCELERATION)
    acceleration[:3] = _ROOT_ACCELERATION
    return Goals(
        links=np.array([target.map[role] for role in roles], dtype=np.intp),
        turns_xyzw=wanted,
        turn_weights=weights,
        point_links=np.array([target.map[name] for name in names], dtype=np.intp),
        point_offsets=np.array(offsets),
        places=places,
        place_weights=place_weights,
        surface=target.surface,
        clearance=np.full((body.frames, len(target.surface.links)), MARGIN),
        ground_weight=_GROUND,
        capsules=target.capsules,
        overlap_weight=_OVERLAP,
        limit_weight=_LIMIT,
        acceleration=acceleration,
    )


def link_motion(
    target: TargetBody, motion: GeneralizedPosition, link: int
) -> tuple[FloatArray, FloatArray]:
    """Origins (f, 3) in m and turns (f, 4) of a link in the world."""
    model, still = DynamicsModel(target.character), np.zeros(motion.position.shape[1])
    origins, turns = np.empty((len(motion.position), 3)), np.empty((len(motion.position), 4))
    for frame, position in enumerate(motion.position):
        model.update(position, still)
        whole = model.link_poses()
        origins[frame], turns[frame] = whole[0][link], whole[1][link]
    return origins, turns


def hips_in_pelvis(target: TargetBody) -> FloatArray:
    """The middle (3,) of the hips in the frame of the pelvis' link, m."""
    link = target.map["pelvis"]
    back = rotations.conjugate(target.turns_xyzw[link])
    return rotations.rotate(back, _middle_of_hips(target) - target.origins[link])


def first_guess(body: CapturedBody, target: TargetBody, turns: SegmentTurns) -> GeneralizedPosition:
    """The character with its links turned as the segments are, joint by joint from the root on."""
    pelvis = target.map["pelvis"]
    back = rotations.multiply(rotations.conjugate(target.turns_xyzw[pelvis]), target.turns_xyzw[0])
    turn = rotations.multiply(turns.turns_xyzw["pelvis"], back)
    hips = rotations.rotate(
        rotations.conjugate(target.turns_xyzw[0]), _middle_of_hips(target) - target.origins[0]
    )
    origin = body.middle("hip") - rotations.rotate(turn, hips)
    by_link = {target.map[role]: turn for role, turn in turns.turns_xyzw.items()}
    return joint_angles(target.character, (origin, turn), by_link)


def _middle_of_hips(target: TargetBody) -> FloatArray:
    """The middle (3,) between the hips at rest, m."""
    left, right = (target.origin(f"{side}_hip") for side in SIDES)
    middle: FloatArray = 0.5 * (left + right)
    return middle


def _turn_weights(role: str, turns: SegmentTurns, frames: int) -> FloatArray:
    """The weights (f, 3, 3) of a segment's rotation vector."""
    if role in turns.bones:
        bone = turns.bones[role]
        along = bone[:, :, np.newaxis] * bone[:, np.newaxis]
        weights: FloatArray = _BONE * (np.eye(3) - along) + _TWIST * along
        return weights
    part = role.removeprefix("left_").removeprefix("right_")
    return np.tile(_TURNS[part] * np.eye(3), (frames, 1, 1))
