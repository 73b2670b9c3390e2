"""A character as one body: its own shapes, bridged and blended where its joints are."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from actuated_characters.render.skin import distances
from actuated_characters.render.skin.cores import Core, core_of
from actuated_characters.render.skin.distances import BodyParts
from actuated_characters.render.skin.spread_pose import masses_beyond, spread_pose
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character, Shape, ShapeType
from msgs_config.geometry import fixed_order, rotations

_EDGE_ROUNDING = 0.85  # of a box's least half edge, and of a cylinder's radius
_PART_SOFTNESS = 0.4  # of the least radius: how softly the parts of a link go over into each other
_SOFTNESS, _REACH = 1.6, 3.2  # of a joint, in radii of the thinner one of its links
# A bridge is as thick as a ball of water of the mass beyond it, times a share, within bounds in
# radii of the thinner link.
_BRIDGE_SHARE, _LEAST_BRIDGE, _WIDEST_BRIDGE = 0.58, 0.4, 0.92
_WATER = 1000.0  # kg/m^3
_SHORT = 0.7  # in its radii: a bridge ends so far before the joint, where its end is round
_GAP = -0.6  # in the bridge's radii: a joint that lies deeper within its link needs no bridge


@dataclass(frozen=True)
class BlendedBody:
    """A body, and where the frames of its links are."""

    parts: BodyParts
    link_origins: FloatArray  # (l, 3), m, world
    link_turns_xyzw: FloatArray  # (l, 4)

    def depth(self, x: float, y: float, z: float) -> float:
        """How deep a point of the world is within it, m; negative outside."""
        return distances.depth_within(x, y, z, self.parts, len(self.link_origins))

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """The least and the greatest corner (3,) of a box around it, m, world."""
        body = self.parts
        half, radii = body.parts[:, :3].copy(), body.parts[:, distances.CYLINDER_RADIUS]
        half[:, :2] += radii[:, np.newaxis]
        reach = fixed_order.apply(np.abs(body.axes), half)
        swell = max(body.softness, float(body.joints[:, distances.SOFTNESS].max(initial=0.0)))
        reach += body.parts[:, distances.ROUNDING, np.newaxis] + 0.25 * swell
        return (body.origins - reach).min(axis=0), (body.origins + reach).max(axis=0)


def blend(character: Character, shapes_of_links: Sequence[Sequence[Shape]]) -> BlendedBody:
    """The body of a character's links' shapes, none of them a mesh, in its `spread_pose`."""
    cores = [[core_of(shape) for shape in shapes] for shapes in shapes_of_links]
    model = DynamicsModel(character)
    spread = spread_pose(character, cores)
    model.update(spread, np.zeros_like(spread))
    origins, turns_xyzw = model.link_poses()
    builder = _Builder(origins, turns_xyzw, cores)
    for row, shapes in enumerate(shapes_of_links):
        for shape in shapes:
            builder.add_shape(row, shape)
    beyond = masses_beyond(character)
    for row, link in enumerate(character.links):
        if link.parent >= 0:
            moves = link.joint.type is not JointType.FIXED
            builder.add_joint(link.parent, row, origins[row], beyond[row], moves=moves)
    return builder.body()


class _Builder:
    """Collects parts and joints; places are those of the world, m."""

    def __init__(
        self, origins: FloatArray, turns_xyzw: FloatArray, cores: Sequence[Sequence[Core]]
    ) -> None:
        self._link_origins, self._link_turns = origins, turns_xyzw
        self._cores = [
            [core.moved(origins[row], turns_xyzw[row]) for core in own]
            for row, own in enumerate(cores)
        ]
        self._parts: list[list[float]] = []
        self._places: list[FloatArray] = []
        self._turns: list[FloatArray] = []
        self._owners: list[int] = []
        self._joints: list[list[float]] = []
        self._ends: list[tuple[int, int]] = []

    def add_shape(self, row: int, shape: Shape) -> None:
        turn = rotations.multiply(self._link_turns[row], np.array(shape.pose.orientation_xyzw))
        local = rotations.rotate(self._link_turns[row], np.array(shape.pose.position))
        place = self._link_origins[row] + local
        half, radius, cylinder = np.zeros(3), shape.size[0], 0.0
        if shape.type is ShapeType.BOX:
            half = 0.5 * np.array(shape.size)
            radius = _EDGE_ROUNDING * float(half.min())
            half -= radius
        elif shape.type is ShapeType.CYLINDER:
            radius = _EDGE_ROUNDING * min(shape.size[0], 0.5 * shape.size[1])
            cylinder, half[2] = shape.size[0] - radius, 0.5 * shape.size[1] - radius
        elif shape.type is ShapeType.CAPSULE:
            half[2] = 0.5 * shape.size[1]
        self._add(row, [*half, radius, cylinder], place, turn)

    def add_joint(
        self, parent: int, child: int, place: FloatArray, beyond: float, *, moves: bool
    ) -> None:
        """Blend two links where they are joined, and bridge what is between them."""
        sides = [(row, self._nearest_core(row, place)) for row in (parent, child)]
        cores = [core for _, core in sides if core is not None]
        if not cores:
            return
        thinner = min(core.radius for core in cores)
        ball = (0.75 * beyond / (np.pi * _WATER)) ** (1.0 / 3.0)
        radius = min(max(_BRIDGE_SHARE * ball, _LEAST_BRIDGE * thinner), _WIDEST_BRIDGE * thinner)
        for row, core in sides:
            if core is not None and core.distance(place) > _GAP * radius:
                self._add_bridge(row, core.nearest(place), place, radius)
        if len(cores) == 2:
            reach = _REACH * thinner if moves else 2.0 * _REACH * thinner
            self._joints.append([*place, reach, _SOFTNESS * thinner])
            self._ends.append((parent, child))

    def _nearest_core(self, row: int, place: FloatArray) -> Core | None:
        cores = self._cores[row]
        return min(cores, key=lambda core: core.distance(place)) if cores else None

    def _add_bridge(self, row: int, start: FloatArray, end: FloatArray, radius: float) -> None:
        way = end - start
        length = float(fixed_order.norm(way))
        if length > 0.0:
            short = max(1.0 - _SHORT * radius / length, 0.0)
            way, length = short * way, short * length
            part = [0.0, 0.0, 0.5 * length, radius, 0.0]
            self._add(row, part, start + 0.5 * way, rotations.from_z(way))

    def _add(self, row: int, part: list[float], place: FloatArray, turn_xyzw: FloatArray) -> None:
        self._parts.append(part)
        self._places.append(place)
        self._turns.append(turn_xyzw)
        self._owners.append(row)

    def body(self) -> BlendedBody:
        cores = [core for own in self._cores for core in own]
        parts = BodyParts(
            np.array(self._parts),
            np.array(self._places),
            rotations.matrix(np.array(self._turns)),
            np.array(self._owners),
            _PART_SOFTNESS * min(core.radius for core in cores),
            np.array(self._joints).reshape(-1, distances.JOINT_COLUMNS),
            np.array(self._ends, dtype=np.intp).reshape(-1, 2),
        )
        return BlendedBody(parts, self._link_origins, self._link_turns)
