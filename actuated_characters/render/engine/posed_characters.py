"""Characters in poses to be seen: where their links are, and spheres around what they look like."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from actuated_characters.render.drawn_shapes import drawn_shapes
from actuated_characters.render.engine.camera_pose import Spheres
from actuated_characters.render.engine.outlines import outline
from actuated_characters.render.skin.choosing import skin_of
from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.render.skin.skin import PosedSkin
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character
from msgs_config.geometry import fixed_order, rotations

_BELOW_GROUND = 0.1  # share of its height that a character may reach below the ground

Frames: TypeAlias = tuple[FloatArray, FloatArray]
"""Origins (links, 3) in m and orientations xyzw (links, 4) of link frames in the world."""


@dataclass(frozen=True)
class LinkForce:
    """A force to be shown as an arrow that ends where it leaves the air and meets a link."""

    link: int  # row of the link among those of all characters
    point: FloatArray  # (3,) where it acts, m in the link frame
    arrow: FloatArray  # (3,) along the force in the world, of length one for the longest arrow


class PosedCharacters:
    """The shapes of several characters, and where they are.

    A position (n,) is theirs one after the other, and so are the links.
    """

    def __init__(self, characters: Sequence[Character], skin: GivenSkin | None = None) -> None:
        """Find the shapes.

        Args:
            characters: Which.
            skin: A mesh from a file that is seen of each of them; it may be larger than the shapes.

        Raises:
            CharacterError: a file of a character cannot be used.
            SkinError: `skin` does not fit a character.
        """
        self._characters = characters
        self._models = [DynamicsModel(character) for character in characters]
        self._ends = np.cumsum([character.layout.size for character in characters])
        self.shapes_of_characters = [drawn_shapes(each) for each in characters]
        self.shapes = [shapes for each in self.shapes_of_characters for shapes in each]
        none = Spheres(np.empty((0, 3)), np.empty(0))
        self._around = [Spheres.joined([none, *map(outline, own)]) for own in self.shapes]
        # the spheres of all links in their frames: around the shapes, and the origins
        count = len(self.shapes)
        origins = Spheres(np.zeros((count, 3)), np.zeros(count))
        self._spheres = Spheres.joined([*self._around, origins])
        numbers = np.repeat(np.arange(count), [len(each.radii) for each in self._around])
        self._links = np.concatenate((numbers, np.arange(count)))
        self._skins = [] if skin is None else self._outermost(skin)

    def _outermost(self, given: GivenSkin) -> list[PosedSkin]:
        """Where the skin of each character ends."""
        pairs = zip(self._characters, self.shapes_of_characters, strict=True)
        skins = [skin_of(character, shapes, given) for character, shapes in pairs]
        return [PosedSkin(skin.outermost()) for skin in skins if skin is not None]

    def frames(self, position: FloatArray) -> Frames:
        """Where the link frames are at a position (n,), message form.

        Those of a character of which that is NaN are NaN.
        """
        origins, turns_xyzw = [], []
        for model, own in zip(self._models, np.split(position, self._ends[:-1]), strict=True):
            known = np.isfinite(own).all()
            model.update(own if known else np.zeros_like(own), np.zeros_like(own))
            origin, turn_xyzw = model.link_poses()
            origins.append(origin if known else np.full_like(origin, np.nan))
            turns_xyzw.append(turn_xyzw if known else np.full_like(turn_xyzw, np.nan))
        return np.concatenate(origins), np.concatenate(turns_xyzw)

    def spheres(self, frames: Frames) -> Spheres:
        """Spheres around all that is seen, and points of a skin; none where the frames are NaN."""
        origins, turns_xyzw = frames[0][self._links], frames[1][self._links]
        there = np.isfinite(origins[:, 0])
        local, radii = self._spheres.centres[there], self._spheres.radii[there]
        spheres = Spheres(origins[there] + rotations.rotate(turns_xyzw[there], local), radii)
        return Spheres.joined([spheres, *self._ends_of_skins(frames)])

    def _ends_of_skins(self, frames: Frames) -> Iterator[Spheres]:
        """The outermost points of each skin, as spheres of no size."""
        first = 0
        for skin in self._skins:
            links = slice(first, first + len(skin.skin.origins))
            first = links.stop
            if np.isfinite(frames[0][links]).all():
                points = skin.surface(frames[0][links], frames[1][links]).vertices
                yield Spheres(points, np.zeros(len(points)))

    def stand_on_ground(self) -> bool:
        """Whether all are above the ground, none hanging through it as a pendulum does."""
        for number, character in enumerate(self._characters):
            rest = [np.full(each.layout.size, np.nan) for each in self._characters]
            rest[number] = np.array(character.rest_position)
            lowest, highest = self.spheres(self.frames(np.concatenate(rest))).bounds(np.eye(3))
            below = lowest[2] < -_BELOW_GROUND * (highest[2] - lowest[2])
            if below and not character.layout.has_floating_base:  # a floating base does not hang
                return False
        return True

    def ways(self, positions: FloatArray) -> FloatArray:
        """How far (p, 2) in m the roots are along the ground from the first of positions (p, n).

        Not their height, which is to be seen; nowhere if a base is fixed.
        """
        path = root_path(self._characters, positions)
        ways: FloatArray = path - path[0]
        return ways

    def outline(self, positions: FloatArray, ways: FloatArray) -> Spheres:
        """Spheres around all of positions (p, n), each moved back by its way (p, 2) in m."""
        return Spheres.joined(
            self.spheres(self.frames(position)).moved((-x, -y, 0.0))
            for position, (x, y) in zip(positions, ways.tolist(), strict=True)
        )

    def tails(
        self,
        positions: FloatArray,
        ways: FloatArray,
        forces: Sequence[Sequence[LinkForce]],
        longest: float,
    ) -> Spheres:
        """Points where the arrows of the forces (p,) at positions (p, n) begin.

        Each is moved back by its way (p, 2); `longest` is the length of the longest arrow; all m.
        """
        tails = [np.empty((0, 3))]
        for position, (x, y), acting in zip(positions, ways.tolist(), forces, strict=True):
            if acting:
                frames = self.frames(position)
                own = [self.arrow(force, frames, longest)[0] for force in acting]
                tails.append(np.array(own) - (x, y, 0.0))
        points = np.concatenate(tails)
        return Spheres(points, np.zeros(len(points)))

    def arrow(self, force: LinkForce, frames: Frames, longest: float) -> FloatArray:
        """Tail and tip (2, 3), m, world; the tip is where it enters what is seen of the link."""
        origin, turn_xyzw = frames[0][force.link], frames[1][force.link]
        local, radii = self._around[force.link]
        at = origin + rotations.rotate(turn_xyzw, force.point)
        direction = force.arrow / fixed_order.norm(force.arrow)
        along = fixed_order.dot(at - origin - rotations.rotate(turn_xyzw, local), direction)
        outside = along + radii
        tip = at - float(np.max(outside, initial=0.0)) * direction
        return np.array((tip - longest * force.arrow, tip))


def root_path(characters: Sequence[Character], positions: FloatArray) -> FloatArray:
    """Where (p, 2) the middle of the roots is in positions (p, n), m along the ground.

    It rests at the origin where one of the characters has a fixed base.
    """
    if not all(character.layout.has_floating_base for character in characters):
        return np.zeros((len(positions), 2))
    ends = np.cumsum([character.layout.size for character in characters])
    roots = [each[:, :2] for each in np.split(positions, ends[:-1], axis=1)]
    path: FloatArray = np.mean(roots, axis=0)
    return path
