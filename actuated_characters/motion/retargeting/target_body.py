"""The body of a character as retargeting sees it: which link is which, bones, soles, limits."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from actuated_characters.motion.retargeting.capsules import Capsules, make_capsules
from actuated_characters.motion.retargeting.shape_points import balls, corners
from actuated_characters.motion.retargeting.skeleton_map import SIDES, SkeletonMap, find_map
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.dynamics import still_model
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.errors import ClipError
from msgs_config.geometry import rotations

_INSIDE = 0.02  # rad by which solutions keep away from the soft limits of ball joints


@dataclass(frozen=True)
class SurfacePoints:
    """Balls that touch the ground for a character's shapes; p of them."""

    links: IntArray  # (p,) indices of `Character.links`
    offsets: FloatArray  # (p, 3) m, in the link frame
    radii: FloatArray  # (p,) m


class TargetBody:
    """A character that stands on two legs, with its links by role.

    Raises ClipError where it is no such character, or has no clips.
    """

    def __init__(self, character: Character) -> None:
        self.character = character
        layout = character.layout
        if not (layout.has_floating_base and character.clips.joints):
            raise ClipError(
                f"character '{character.name}' has no floating base, or no clips: its file has no "
                "key 'clips'"
            )
        parents = [link.parent for link in character.links]
        names = [link.name for link in character.links]
        self.map: SkeletonMap = find_map(f"character '{character.name}'", names, parents)
        rest = np.zeros(layout.size)
        rest[:6] = character.rest_position[:6]
        self._at_rest = still_model(character, rest)
        self.origins, self.turns_xyzw = self._at_rest.link_poses()

    def origin(self, role: str) -> FloatArray:
        """Where a link's frame is (3,) in the pose with all joints at zero, upright, m."""
        place: FloatArray = self.origins[self.map[role]]
        return place

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
        link = self.map[f"{SIDES[0]}_ankle"]
        points = self.soles(f"{SIDES[0]}_ankle")
        return float(-rotations.rotate(self.turns_xyzw[link], points)[:, 2].min())

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
        points = np.concatenate(
            [corners(shape) for shape in self.character.links[link].collision_shapes]
            or [np.zeros((1, 3))]
        )
        upright = rotations.rotate(turn, points)
        low, high = upright.min(axis=0), upright.max(axis=0)
        sole = np.array([(x, y, low[2]) for x in (high[0], low[0]) for y in (high[1], low[1])])
        return rotations.rotate(rotations.conjugate(turn), sole)

    @cached_property
    def surface(self) -> SurfacePoints:
        """Balls for all shapes that collide: the ends of capsules, corners of boxes, spheres."""
        rows = [
            (index, point, radius)
            for index, link in enumerate(self.character.links)
            for shape in link.collision_shapes
            for point, radius in balls(shape)
        ]
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
