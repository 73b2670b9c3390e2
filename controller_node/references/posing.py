"""Poses by inverse kinematics: links where they are wanted, within limits, near a given pose.

    posing = Posing(character)
    wanted = [Target("right_wrist", place=(0.4, -0.2, 1.3))]
    found = posing.fit(pose, wanted, holds=character.feet)
    found.pose, found.residual, found.reached

Pure: the same arguments give the same bits, on every processor. `msgs_config.compiled.posing` has
the equations.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller_node.references.posed_body import (
    LEVER_M,
    body_of,
    bounds_of,
    loads_of,
    rows_of,
    units_of,
)
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointType
from msgs_config.character.model import Character, Quaternion, Vector
from msgs_config.compiled import kinematics, posing
from msgs_config.errors import MotionError, one_of
from msgs_config.geometry import fixed_order, rotations

REACHED_M = 1e-3
"""m that a place may be off, and is reached."""
REACHED_RAD = 1e-2
"""rad that an orientation may be off, and is reached."""

_AIM_M = 0.3  # m: where a line of sight is held to the direction that it is to have
_LONGEST_TURN = math.pi - 1e-3  # rad of a rotation vector, for which there is one way alone


@dataclass(frozen=True)
class Target:
    """Where a point of a link is wanted, and how the link is turned there."""

    link: str
    place: Vector  # m, in the world
    point: Vector = (0.0, 0.0, 0.0)  # m, in the link frame
    weight: float = 1.0  # of the square of what it is off
    orientation_xyzw: Quaternion | None = None  # of the link in the world; None: any


@dataclass(frozen=True)
class Posed:
    """A pose that was found."""

    pose: GeneralizedPosition  # (n,) message form
    errors: FloatArray  # (t,) m that each target's point is off
    reached: bool
    """Whether all targets are within 1 mm and 0.01 rad, and the links that stay, too."""

    @property
    def residual(self) -> float:
        """What the worst of the targets is off, m; 0 of none."""
        return float(self.errors.max(initial=0.0))


class Posing:
    """Inverse kinematics of one character, in the world where it was placed.

    Hinges and sliders keep their limits. Ball joints have bounds for the entries of their rotation
    vector where the character's file gives a `soft_limit`. Where the given pose is beyond a limit,
    the pose that is found is not further beyond. Joints that mimic others follow.
    """

    def __init__(self, character: Character) -> None:
        self._character, self._layout = character, character.layout
        self._names = [link.name for link in character.links]
        self._body = body_of(character)
        self._lower, self._upper = bounds_of(character)
        self._units = units_of(character)
        self._metric = self._units * loads_of(character)
        turning = [joint.name for joint in self._layout.joints if joint.rotation is not None]
        self._turning = [
            (number, turning.index(link.joint.name))
            for number, link in enumerate(character.links)
            if link.joint.type in (JointType.SPHERICAL, JointType.FLOATING)
        ]
        """Links whose joint turns freely, and rows of the orientations."""

    def chain(self, link: str) -> BoolArray:
        """The degrees of freedom (n,) of a limb: from a link to the first one that has branches.

        Of a wrist those of shoulder and elbow. Raises MotionError on an unknown link.
        """
        mask, number = np.zeros(self._layout.size, dtype=np.bool_), self._number(link)
        parents = [each.parent for each in self._character.links]
        while number >= 0 and (parents.count(number) < 2 or self._names[number] == link):
            joint = self._character.links[number].joint
            if joint.type not in (JointType.FIXED, JointType.FLOATING):
                mask |= self._layout.mask([joint.name])
            number = parents[number]
        return mask

    def frame(self, pose: GeneralizedPosition, link: str) -> tuple[FloatArray, FloatArray]:
        """A link's place (3,) in m and orientation xyzw (4,) in the world, in a pose."""
        frame = self._frames(pose)[self._number(link)]
        return frame[:3].copy(), frame[3:].copy()

    def place(self, pose: GeneralizedPosition, link: str, point: Vector) -> FloatArray:
        """A point of a link, given in its frame, in the world (3,), m."""
        frames = self._frames(pose)
        return np.array(kinematics.point_of(frames, self._number(link), np.array(point)))

    def aim(self, pose: GeneralizedPosition, link: str, direction: Vector, point: Vector) -> Target:
        """A target that turns a link's direction, of any length but 0, to a point in the world.

        The link's origin counts as resting; so `free` of `fit` should leave it where it is.
        """
        origin, _ = self.frame(pose, link)
        way = np.array(point) - origin
        length, own = float(fixed_order.norm(way)), np.array(direction)
        unit = own / fixed_order.norm(own)
        if length < REACHED_M:  # no direction leads there
            return Target(link, _vector(self.place(pose, link, _vector(unit))), _vector(unit))
        return Target(link, _vector(origin + _AIM_M * way / length), _vector(_AIM_M * unit))

    def fit(
        self,
        pose: GeneralizedPosition,
        targets: Sequence[Target],
        *,
        free: BoolArray | None = None,
        holds: Sequence[str] = (),
        start: GeneralizedPosition | None = None,
    ) -> Posed:
        """The pose, nearest to the one given, whose links are where they are wanted.

        Args:
            pose: Position (n,), and orientations, which are those that count.
            targets: What is wanted; out of reach, the links stretch towards it.
            free: Which degrees of freedom move (n,), of a rotation all or none; None: all.
            holds: Links that stay where the given pose has them, and as they are turned.
            start: Where to begin, such as what was found for targets nearby; None: at `pose`.

        Raises:
            MotionError: a link is unknown; the message lists those that exist.
        """
        wanted = self._wanted(pose, targets, holds)
        freedom = self._freedom(pose, free)
        coordinates = self._coordinates(pose if start is None else start, freedom.bases)
        coordinates = np.where(freedom.free, coordinates, freedom.near)
        coordinates = np.minimum(np.maximum(coordinates, freedom.lower), freedom.upper)
        posing.fit(self._body, wanted, freedom, coordinates)
        return self._posed(pose, coordinates, wanted, freedom)

    def _number(self, link: str) -> int:
        if link not in self._names:
            raise MotionError(one_of("link", link, self._names))
        return self._names.index(link)

    def _bases(self, pose: GeneralizedPosition) -> FloatArray:
        """The base rotations (l, 4): of what has no bounds the given one, else none."""
        bases = np.tile(np.array(rotations.IDENTITY_XYZW), (len(self._names), 1))
        for number, row in self._turning:
            joint = self._character.links[number].joint
            if joint.soft_limit is None:
                bases[number] = pose.orientations_xyzw[row]
        return bases

    def _coordinates(self, pose: GeneralizedPosition, bases: FloatArray) -> FloatArray:
        """The coordinates (n,) of a pose about base rotations (l, 4)."""
        coordinates = pose.position.copy()
        for number, row in self._turning:
            turn = rotations.multiply(
                rotations.conjugate(bases[number]), pose.orientations_xyzw[row]
            )
            coordinates[self._layout.rotation_entries[row]] = rotations.log(turn)
        return coordinates

    def _frames(self, pose: GeneralizedPosition) -> FloatArray:
        bases, frames = self._bases(pose), np.empty((len(self._names), 7))
        kinematics.find_frames(self._body, bases, self._coordinates(pose, bases), frames)
        return frames

    def _wanted(
        self, pose: GeneralizedPosition, targets: Sequence[Target], holds: Sequence[str]
    ) -> posing.Wanted:
        frames, lever = self._frames(pose), LEVER_M * LEVER_M
        held = [frames[self._number(name)] for name in holds]
        no_turn, none = rotations.IDENTITY_XYZW, (0.0, 0.0, 0.0)
        heaviest = max([1.0, *(target.weight for target in targets)])
        turned = [target.orientation_xyzw for target in targets]
        return posing.Wanted(
            np.array(
                [self._number(name) for name in (*(t.link for t in targets), *holds)],
                dtype=np.intp,
            ),
            rows_of([*(target.point for target in targets), *(none for _ in held)], 3),
            rows_of([*(target.place for target in targets), *(frame[:3] for frame in held)], 3),
            rows_of([*(turn or no_turn for turn in turned), *(frame[3:] for frame in held)], 4),
            np.array([*(target.weight for target in targets), *(heaviest for _ in held)]),
            np.array(
                [
                    *(0.0 if t.orientation_xyzw is None else lever * t.weight for t in targets),
                    *(heaviest * lever for _ in held),
                ]
            ),
            np.array([False] * len(targets) + [True] * len(held), dtype=np.bool_),
        )

    def _freedom(self, pose: GeneralizedPosition, free: BoolArray | None) -> posing.Freedom:
        size, bases = self._layout.size, self._bases(pose)
        near = self._coordinates(pose, bases)
        movable = np.ones(size, dtype=np.bool_) if free is None else free.copy()
        movable[self._body.followers] = False
        longest = np.full(len(self._names), np.inf)
        for number, row in self._turning:
            length = float(fixed_order.norm(near[self._layout.rotation_entries[row]]))
            longest[number] = max(_LONGEST_TURN, length)
        lower, upper = np.minimum(self._lower, near), np.maximum(self._upper, near)
        return posing.Freedom(
            bases, near, lower, upper, longest, movable, self._metric, self._units
        )

    def _posed(
        self,
        pose: GeneralizedPosition,
        coordinates: FloatArray,
        wanted: posing.Wanted,
        freedom: posing.Freedom,
    ) -> Posed:
        frames, errors = np.empty((len(self._names), 7)), np.empty((len(wanted.links), 6))
        kinematics.find_frames(self._body, freedom.bases, coordinates, frames)
        posing.find_errors(wanted, frames, errors)
        position, turns = coordinates.copy(), pose.orientations_xyzw.copy()
        for number, row in self._turning:
            entries = self._layout.rotation_entries[row]
            if freedom.free[entries].any():
                turn = rotations.multiply(
                    freedom.bases[number], rotations.exp(coordinates[entries])
                )
                turns[row] = rotations.normalised(turn)
                position[entries] = rotations.log(turns[row])
            else:
                position[entries] = pose.position[entries]
        off = fixed_order.norm(errors.reshape(-1, 2, 3))
        reached = bool((off[:, 0] <= REACHED_M).all() and (off[:, 1] <= REACHED_RAD).all())
        return Posed(GeneralizedPosition(position, turns), off[~wanted.held, 0], reached)


def _vector(values: FloatArray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
