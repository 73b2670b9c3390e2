"""Pictures of characters in given states. No window, no GPU, no physics."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from actuated_characters.render.engine.camera_pose import (
    Box,
    CameraPose,
    extents,
    framing,
    natural_aspect,
)
from actuated_characters.render.engine.compositor import Compositor, Picture
from actuated_characters.render.engine.posed_character import PosedCharacter
from actuated_characters.render.engine.render_scene import Arrow, RenderScene, Size
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.model import Character, Shape, UrdfOptions, Vector
from msgs_config.geometry import rotations

__all__ = ["DEFAULT_SIZE", "LinkForce", "Picture", "Renderer"]

DEFAULT_SIZE = (640, 480)

_MOST_DRAWN = 2**23  # samples of a picture; each takes some 40 bytes, and more while it is drawn
_GHOST_COLOR, _GHOST_OPACITY = (0.25, 0.85, 0.45, 1.0), 0.45
_BELOW_GROUND = 0.1  # of its height, that a character may reach below the ground
_HIDDEN_ARROW_OPACITY = 0.55
_NO_OFFSET = (0.0, 0.0, 0.0)
_NO_BALLS = np.zeros((0, 4))

Frames: TypeAlias = tuple[FloatArray, FloatArray]
"""Origins (links, 3) in m and orientations xyzw (links, 4) of the link frames in the world."""

Outline: TypeAlias = tuple[FloatArray, FloatArray]
"""Spheres around what is seen: centres (m, 3), radii (m,), in m."""


@dataclass(frozen=True)
class LinkForce:
    """A force to be shown as an arrow that ends where it leaves the air and meets a link."""

    link: int  # among those of all characters
    point: FloatArray  # (3,) where it acts, m in the link frame
    arrow: FloatArray  # (3,) from tail to tip, m in the world


class Renderer:
    """Takes pictures of characters; of their references, too, as transparent ghosts.

    Of several characters a position (n,) is theirs one after the other. The ghosts are drawn alone
    and then blended in.
    """

    def __init__(
        self,
        character: Character | Sequence[Character],
        *,
        ground: bool = True,
        terrain: UrdfOptions | None = None,
        samples: int = 2,
    ) -> None:
        """Start the engines.

        Args:
            character: The character, or several.
            ground: Draw the plane z = 0 as a chequerboard; not if a fixed base hangs below it.
            terrain: What else stays there.
            samples: Drawn along each edge of a pixel, for smooth edges; one where a picture is so
                large that more would take gigabytes.

        Raises:
            CharacterError: a file of a character or of the terrain cannot be used.
        """
        characters = (character,) if isinstance(character, Character) else character
        self._samples = samples
        self._ghost: RenderScene | None = None
        self._arrows: RenderScene | None = None
        self._stages: list[RenderScene] = []
        self._puppets: list[PosedCharacter] = []
        try:
            for each in characters:
                self._puppets.append(PosedCharacter(each))
            self._shapes = [shapes for puppet in self._puppets for shapes in puppet.shapes]
            self._ends = np.cumsum([puppet.layout.size for puppet in self._puppets])
            self._has_ground = ground and self._stands(characters)
            self._stage = self._new_stage(self._shapes)
            if terrain is not None:
                self._stage.add_terrain(terrain)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End the engines."""
        for puppet in self._puppets:
            puppet.close()
        for stage in self._stages:
            stage.close()

    def picture(
        self,
        position: FloatArray,
        *,
        ghost: FloatArray | None = None,
        ghost_offset: Vector = _NO_OFFSET,
        forces: Sequence[LinkForce] = (),
        touching: BoolArray | None = None,
        balls: FloatArray = _NO_BALLS,
        view: CameraPose | None = None,
        size: Size = DEFAULT_SIZE,
    ) -> Picture:
        """A picture (h, w, 3) at a position (n,), message form.

        Args:
            position: Where the characters are.
            ghost: Where their transparent copies are, (n,); None draws none, and NaN not that one.
            ghost_offset: How far from there the copies are drawn, m in the world.
            forces: Arrows.
            touching: The links, of all characters, that are marked by a colour.
            balls: Centres and radii (m, 4) of balls, m in the world.
            view: Where from; by default from where `view` says.
            size: Width and height in pixels.
        """
        view = view or self.view(position, size=size)
        width, height = size
        samples = self._samples if width * height * self._samples**2 <= _MOST_DRAWN else 1
        frames = self._frames(position)
        outline = self._outline(frames)
        self._stage.place(*frames)
        self._stage.mark(np.zeros(len(frames[0]), np.bool_) if touching is None else touching)
        self._stage.show_balls(balls)
        canvas = Compositor(view, size, samples=samples, has_ground=self._has_ground)
        if self._has_ground:
            is_near = np.linalg.norm(balls[:, :3] - view.target, axis=1) < view.distance
            canvas.darken(self._stage, *_with_balls(outline, balls[is_near]))
        outline = _with_balls(outline, balls)
        everywhere = Box(0, height, 0, width)
        canvas.draw_solid(
            self._stage, everywhere if self._stage.has_terrain else view.box(*outline, size)
        )
        if ghost is not None:
            origins, turns = self._frames(ghost)
            ghosts = origins + ghost_offset, turns
            stage = self._ghost_stage()
            stage.place(*ghosts)
            canvas.draw_over(stage, view.box(*self._outline(ghosts), size), _GHOST_OPACITY)
        if forces:
            arrows = [self._arrow(force, frames) for force in forces]
            stage = self._arrow_stage()
            stage.show_arrows(arrows, view)
            outlines = [arrow.outline(view) for arrow in arrows]
            canvas.draw_over(stage, view.box(*_joined(outlines), size), 1.0, _HIDDEN_ARROW_OPACITY)
        return canvas.picture()

    def view(
        self, positions: FloatArray, *, size: Size = DEFAULT_SIZE, like: CameraPose | None = None
    ) -> CameraPose:
        """The nearest view of a position (n,), or of the first of several (p, n), that fits all.

        `followed` moves it on to the others. It has the directions and the angle of `like`; by
        default it looks at a character that faces +x from its right side and a bit from in front.
        """
        rows = np.atleast_2d(positions)
        return self.view_along(rows, self._ways(rows), size=size, like=like)

    def view_along(
        self,
        positions: FloatArray,
        ways: FloatArray,
        *,
        ghosts: FloatArray | None = None,
        ghost_offset: Vector = _NO_OFFSET,
        besides: Sequence[FloatArray] = (),
        size: Size = DEFAULT_SIZE,
        like: CameraPose | None = None,
    ) -> CameraPose:
        """The nearest view that fits all positions (p, n) when it is moved along ways (p, 2), m.

        The same ways go with `ghosts` (p, n), of which those that are NaN are not looked at. It
        fits points (3,) `besides`, too, in m where they are before anything is moved.
        """
        outlines = [self._joint_outline(positions, ways)]
        if besides:
            outlines.append((np.array(besides), np.zeros(len(besides))))
        if ghosts is not None:
            points, radii = self._joint_outline(ghosts, ways)
            outlines.append((points + ghost_offset, radii))
        return framing(*_joined(outlines), size[0] / size[1], like or CameraPose())

    def tail(self, position: FloatArray, force: LinkForce) -> FloatArray:
        """Where (3,) the arrow of a force begins, m in the world."""
        return self._arrow(force, self._frames(position)).tail

    def extents(self, positions: FloatArray, ways: FloatArray, like: CameraPose) -> FloatArray:
        """How much (3,) in m of the axes of `like` all positions (p, n) take up together.

        Each of them is moved back by its way (p, 2) in m.
        """
        return extents(*self._joint_outline(positions, ways), like)

    def aspect(self, positions: FloatArray) -> float:
        """Width over height of the picture that suits all of positions (p, n) best."""
        rows = np.atleast_2d(positions)
        return natural_aspect(*self._joint_outline(rows, self._ways(rows)), CameraPose())

    def followed(self, view: CameraPose, start: FloatArray, position: FloatArray) -> CameraPose:
        """The view of a position (n,) that is what `view` is of `start` (n,).

        It goes with the root along the ground, not with its height, which is to be seen.
        """
        x, y = self._way(start, position).tolist()
        return view.moved(x, y)

    def _ways(self, positions: FloatArray) -> FloatArray:
        return np.array([self._way(positions[0], row) for row in positions])

    def _way(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """How far the roots go along the ground in the mean (2,), m; a fixed base nowhere."""
        pairs = zip(self._puppets, self._split(start), self._split(end), strict=True)
        way: FloatArray = np.mean([puppet.way(*ends) for puppet, *ends in pairs], axis=0)
        return way

    def _split(self, position: FloatArray) -> list[FloatArray]:
        return np.split(position, self._ends[:-1])

    def _frames(self, position: FloatArray) -> Frames:
        pairs = zip(self._puppets, self._split(position), strict=True)
        origins, turns = zip(*(puppet.frames(own) for puppet, own in pairs), strict=True)
        return np.concatenate(origins), np.concatenate(turns)

    def _outline(self, frames: Frames) -> Outline:
        """Spheres around all that is seen of the characters."""
        own, first = [], 0
        for puppet in self._puppets:
            links = slice(first, first + len(puppet.shapes))
            own.append(puppet.outline(frames[0][links], frames[1][links]))
            first = links.stop
        return _joined(own)

    def _joint_outline(self, positions: FloatArray, ways: FloatArray) -> Outline:
        """Spheres around all of positions (p, n), each moved back by its way (p, 2)."""
        own = []
        for position, (x, y) in zip(positions, ways, strict=True):
            points, radii = self._outline(self._frames(position))
            own.append((points - (x, y, 0.0), radii))
        return _joined(own)

    def _stands(self, characters: Sequence[Character]) -> bool:
        """Whether all are above the ground, none hanging through it as a pendulum does."""
        for character, puppet in zip(characters, self._puppets, strict=True):
            if character.layout.has_floating_base:  # goes where it can
                continue
            points, radii = puppet.outline(*puppet.frames(np.array(character.rest_position)))
            heights = points[:, 2]
            lowest, highest = float((heights - radii).min()), float((heights + radii).max())
            if lowest < -_BELOW_GROUND * (highest - lowest):
                return False
        return True

    def _arrow(self, force: LinkForce, frames: Frames) -> Arrow:
        """The arrow whose tip is where its line enters what is seen of the link."""
        origin, turn = frames[0][force.link], frames[1][force.link]
        at = origin + rotations.rotate(turn, force.point)
        direction = force.arrow / np.linalg.norm(force.arrow)
        points, radii = self._link_outline(force.link, frames)
        back = float(np.max((at - points) @ direction + radii, initial=0.0))
        tip = at - back * direction
        return Arrow(tip - force.arrow, tip)

    def _link_outline(self, link: int, frames: Frames) -> Outline:
        first = 0
        for puppet in self._puppets:
            if link < first + len(puppet.shapes):
                break
            first += len(puppet.shapes)
        return puppet.link_outline(link - first, frames[0][link], frames[1][link])

    def _ghost_stage(self) -> RenderScene:
        if self._ghost is None:
            self._ghost = self._new_stage(
                [tuple(replace(s, color_rgba=_GHOST_COLOR) for s in own) for own in self._shapes]
            )
        return self._ghost

    def _arrow_stage(self) -> RenderScene:
        if self._arrows is None:
            self._arrows = self._new_stage(())
        return self._arrows

    def _new_stage(self, shapes: Sequence[tuple[Shape, ...]]) -> RenderScene:
        stage = RenderScene()
        self._stages.append(stage)
        stage.add_links(shapes)
        return stage


def _with_balls(outline: Outline, balls: FloatArray) -> Outline:
    return _joined([outline, (balls[:, :3], balls[:, 3])])


def _joined(outlines: Sequence[Outline]) -> Outline:
    points, radii = zip(*outlines, strict=True)
    return np.concatenate(points), np.concatenate(radii)
