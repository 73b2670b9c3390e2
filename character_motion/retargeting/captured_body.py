"""A captured body: where the joints of a BVH motion are, and which of them is which."""

from dataclasses import dataclass, replace

import numpy as np

from character_motion.bvh.kinematics import forward_kinematics, rest_positions
from character_motion.bvh.skeleton import BvhMotion
from character_motion.retargeting.skeleton_map import SIDES, SkeletonMap, ancestors
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations

_MIN_BONE_LENGTH = 0.02  # share of a leg's length; a shorter bone has no direction
_BEGINS_NEAR = 0.3  # share of the way from hips to neck that the spine's middle may be off


@dataclass(frozen=True)
class CapturedBody:
    """The joints of a skeleton in f frames, its end sites behind them: n nodes, one world."""

    frame_time: float  # s
    names: tuple[str, ...]  # (j,) of the joints
    parents: tuple[int, ...]  # (n,) index of each node's parent; -1 of the root
    positions: FloatArray  # (f, n, 3)
    orientations_xyzw: FloatArray  # (f, j, 4) of the joints, since the pose of zero rotations
    rest: FloatArray  # (n, 3) the pose of zero rotations, in the file's axes
    map: SkeletonMap

    @property
    def frames(self) -> int:
        """Number f of frames."""
        return len(self.positions)

    def part(self, role: str) -> FloatArray:
        """Where a joint is (f, 3)."""
        return self.positions[:, self.map[role]]

    def middle(self, part: str) -> FloatArray:
        """The middle (f, 3) between a joint of the left and that of the right."""
        return 0.5 * (self.part(f"{SIDES[0]}_{part}") + self.part(f"{SIDES[1]}_{part}"))

    def in_joint(self, role: str, vectors: FloatArray) -> FloatArray:
        """Vectors (f, 3) or (3,) of the world in a joint's frame, in each frame (f, 3)."""
        return rotations.rotate(rotations.conjugate(self.orientation(role)), vectors)

    def orientation(self, role: str) -> FloatArray:
        """The turn (f, 4) of a joint since the pose of zero rotations."""
        return self.orientations_xyzw[:, self.map[role]]

    def tip(self, role: str) -> int | None:
        """The node below a joint that is farthest from it: its child, or end site; None if near."""
        below = [node for node, parent in enumerate(self.parents) if parent == self.map[role]]
        lengths = [float(np.linalg.norm(self.rest[n] - self.rest[self.map[role]])) for n in below]
        if not below or max(lengths) < _MIN_BONE_LENGTH * self.leg_length:
            return None
        return below[int(np.argmax(lengths))]

    @property
    def leg_length(self) -> float:
        """Length of thigh and shank together, the mean of both legs and all frames."""
        return self.length(("hip", "knee")) + self.length(("knee", "ankle"))

    def length(self, bone: tuple[str, str]) -> float:
        """Length of a bone between two parts, the mean of both sides and the median of frames."""
        lengths = [
            np.linalg.norm(self.part(f"{side}_{bone[1]}") - self.part(f"{side}_{bone[0]}"), axis=-1)
            for side in SIDES
        ]
        return float(np.mean([np.median(each) for each in lengths]))

    def neck_base(self) -> FloatArray:
        """Where the neck begins (f, 3), or else the middle of the shoulders."""
        if "neck" in self.map and self.map["neck"] != self.map["chest"]:
            return self.part("neck")
        return self.middle("shoulder")

    def middle_of_spine(self) -> FloatArray:
        """Where the spine bends (f, 3): its joint nearest to its middle, or else the middle."""
        hips, neck = self.middle("hip"), self.neck_base()
        line = ancestors(self.map["chest"], self.parents)
        spine = [node for node in line if self.map["pelvis"] in ancestors(node, self.parents)]
        half = 0.5 * (hips + neck)
        length = float(np.median(np.linalg.norm(neck - hips, axis=-1)))
        apart = [
            float(np.median(np.linalg.norm(self.positions[:, n] - half, axis=-1))) for n in spine
        ]
        if spine and min(apart) < _BEGINS_NEAR * length:
            return self.positions[:, spine[int(np.argmin(apart))]]
        return half

    def moved(self, offsets: FloatArray) -> "CapturedBody":
        """The body moved by an offset (f, 3) in each frame."""
        return replace(self, positions=self.positions + offsets[:, np.newaxis])

    def turned(self, turn_xyzw: FloatArray) -> "CapturedBody":
        """The body in a world that is turned by a quaternion (4,)."""
        return replace(
            self,
            positions=rotations.rotate(turn_xyzw, self.positions),
            orientations_xyzw=rotations.multiply(turn_xyzw, self.orientations_xyzw),
        )

    def scaled(self, scale: float) -> "CapturedBody":
        """The body with all lengths multiplied."""
        return replace(self, positions=scale * self.positions, rest=scale * self.rest)

    def since(self, frame: int) -> "CapturedBody":
        """The body from a frame on."""
        return replace(
            self,
            positions=self.positions[frame:],
            orientations_xyzw=self.orientations_xyzw[frame:],
        )


def captured_body(motion: BvhMotion, skeleton_map: SkeletonMap) -> CapturedBody:
    """The body of a BVH motion, in the file's units and axes."""
    skeleton, poses = motion.skeleton, forward_kinematics(motion)
    rest = rest_positions(skeleton)
    ends = [rest[site.joint] + np.array(site.offset) for site in skeleton.end_sites]
    return CapturedBody(
        frame_time=motion.frame_time,
        names=skeleton.names,
        parents=(*skeleton.parents, *(site.joint for site in skeleton.end_sites)),
        positions=np.concatenate((poses.positions, poses.end_positions), axis=1),
        orientations_xyzw=poses.orientations_xyzw,
        rest=np.concatenate((rest, np.array(ends).reshape(-1, 3))),
        map=skeleton_map,
    )
