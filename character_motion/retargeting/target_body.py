"""The body of a character as retargeting sees it: which link is which, bones, soles, limits."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from character_motion.retargeting.optimisation.capsules import Capsules, make_capsules
from character_motion.retargeting.shape_points import balls, corners
from character_motion.retargeting.skeleton_map import SIDES, SkeletonMap
from character_motion.retargeting.target_joints import find_target_joints
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.dynamics import still_model
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.errors import ClipError
from msgs_config.geometry import rotations

_INSIDE = 0.02  # rad by which solutions keep away from the soft limits of ball joints

BELOW = {"hip": "knee", "knee": "ankle", "shoulder": "elbow", "elbow": "wrist"}
"""Of each segment of a limb, the one below."""


@dataclass(frozen=True)
class SurfacePoints:
    """Balls that touch the ground for a character's shapes; p of them."""

    links: IntArray  # (p,) indices of `Character.links`
    offsets: FloatArray  # (p, 3) m, in the link frame
    radii: FloatArray  # (p,) m


class TargetBody:
    """A character that stands on two legs, with its links by role.

    Raises ClipError where it is no such character.
    """

    def __init__(self, character: Character, given: Mapping[str, str] | None = None) -> None:
        """Take a character, with links or joints by role that its names do not tell."""
        self.character = character
        layout = character.layout
        if not layout.has_floating_base:
            raise ClipError(f"character '{character.name}' has no floating base: it stands nowhere")
        found = find_target_joints(character, given)
        self.map: SkeletonMap = found.map
        rest = np.zeros(layout.size)
        rest[:6] = character.rest_position[:6]
        self.origins, self.turns_xyzw = still_model(character, rest).link_poses()
        self._joints = found

    def origin(self, role: str) -> FloatArray:
        """Where a segment's joint is (3,) in the pose with all joints at zero, upright, m."""
        return self._joints.centre(role, self.character.links, self.origins, self.turns_xyzw)

    def offset(self, role: str) -> FloatArray:
        """Where a segment's joint is (3,) in the frame of its link, m."""
        link = self.map[role]
        back = rotations.conjugate(self.turns_xyzw[link])
        return rotations.rotate(back, self.origin(role) - self.origins[link])

    def bone(self, role: str) -> FloatArray:
        """From a limb's segment's joint to the one below (3,) at rest, m.

        Where there is none below, to the centre of mass of what hangs on it.
        """
        side, _, part = role.partition("_")
        below = BELOW[part]
        if f"{side}_{below}" in self.map:
            return self.origin(f"{side}_{below}") - self.origin(role)
        links = [(row, self.character.links[row]) for row in self.below(role)]
        moments = [
            link.mass
            * (
                self.origins[row]
                + rotations.rotate(self.turns_xyzw[row], np.array(link.inertial_pose.position))
                - self.origin(role)
            )
            for row, link in links
        ]
        bone: FloatArray = np.sum(moments, axis=0) / max(sum(link.mass for _, link in links), 1e-9)
        return bone

    def bend_axis(self, side: str, part: str) -> FloatArray | None:
        """The axis (3,) at rest about which a knee or an elbow bends; None if it is no hinge.

        Of several hinges, as where a forearm turns, too, it is the one most across the upper bone.
        """
        links, upper = self.character.links, {"knee": "hip", "elbow": "shoulder"}[part]
        bone = self.bone(f"{side}_{upper}")
        axes = [
            rotations.rotate(self.turns_xyzw[row], np.array(links[row].joint.axis_in_child))
            for row in self._joints.hinges(links, f"{side}_{part}")
        ]
        return max(axes, key=lambda axis: float(np.linalg.norm(np.cross(axis, bone))), default=None)

    def below(self, role: str) -> list[int]:
        """The link of a segment and those that hang on it."""
        found: list[int] = []
        for row, link in enumerate(self.character.links):
            if row == self.map[role] or link.parent in found:
                found.append(row)
        return found

    def length(self, start: str, end: str) -> float:
        """Distance between the origins of two links in m, in the pose with all joints at zero."""
        return float(np.linalg.norm(self.origin(end) - self.origin(start)))

    @property
    def leg_length(self) -> float:
        """From hip to ankle along thigh and shank, m."""
        side = SIDES[0]
        return self.length(f"{side}_hip", f"{side}_knee") + self.length(
            f"{side}_knee", f"{side}_ankle"
        )

    @property
    def ankle_height(self) -> float:
        """Height of the ankles over the soles in m, of a foot that stands flat."""
        ankle = f"{SIDES[0]}_ankle"
        points = self.soles(ankle) - self.offset(ankle)
        return float(-rotations.rotate(self.turns_xyzw[self.map[ankle]], points)[:, 2].min())

    def foot_up(self, ankle: str) -> FloatArray:
        """The direction (3,) in a foot's link that is up while it stands flat."""
        back = rotations.conjugate(self.turns_xyzw[self.map[ankle]])
        return rotations.rotate(back, np.array((0.0, 0.0, 1.0)))

    def soles(self, ankle: str) -> FloatArray:
        """The corners (4, 3) of a foot's sole in its link's frame, m: two at the toes come first.

        Those of its box, or of the bounds of what it collides with.
        """
        link = self.map[ankle]
        turn = self.turns_xyzw[link]
        upright = np.concatenate(
            [
                self.origins[row]
                + rotations.rotate(self.turns_xyzw[row], corners(shape))
                - self.origins[link]
                for row in self.below(ankle)
                for shape in self.character.links[row].collision_shapes
            ]
            or [np.zeros((1, 3))]
        )
        low, high = upright.min(axis=0), upright.max(axis=0)
        sole = np.array([(x, y, low[2]) for x in (high[0], low[0]) for y in (high[1], low[1])])
        return rotations.rotate(rotations.conjugate(turn), sole)

    @cached_property
    def surface(self) -> SurfacePoints:
        """Balls for all shapes that collide: the ends of capsules, corners of boxes, spheres.

        Of a character that collides with nothing they are the origins of its links.
        """
        rows = [
            (index, point, radius)
            for index, link in enumerate(self.character.links)
            for shape in link.collision_shapes
            for point, radius in balls(shape)
        ] or [(index, np.zeros(3), 0.0) for index in range(len(self.character.links))]
        links, points, radii = zip(*rows, strict=True) if rows else ((), (), ())
        return SurfacePoints(
            np.array(links, dtype=np.intp),
            np.array(points).reshape(-1, 3),
            np.array(radii, dtype=float),
        )

    @cached_property
    def capsules(self) -> Capsules:
        """Capsules for all shapes that collide, and which of them are kept apart."""
        left, right = (self.map[f"{side}_knee"] for side in SIDES)
        links = self.character.links
        return make_capsules(links, self.origins, self.turns_xyzw, (left, right))

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bound (n,) of each entry: of hinges, and soft ones of ball joints."""
        lower, upper = self.character.position_bounds()
        for joint in self.character.moving_joints:
            if joint.type is JointType.SPHERICAL and joint.soft_limit is not None:
                entries = self.character.layout.joint(joint.name).entries
                lower[entries] = np.array(joint.soft_limit.lower) + _INSIDE
                upper[entries] = np.array(joint.soft_limit.upper) - _INSIDE
        return lower, upper
