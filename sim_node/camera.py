"""Pictures of a character in given states. No window, no GPU, no physics."""

from collections.abc import Sequence
from dataclasses import replace
from types import TracebackType
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from msgs_config import rotations
from msgs_config.arrays import FloatArray
from msgs_config.character import Character, Loading, Shape
from sim_node.looks import drawn_shapes, outline
from sim_node.stage import Drawing, Size, Stage
from sim_node.view import View, framing, natural_aspect
from sim_node.world import World, WorldSettings

Picture: TypeAlias = NDArray[np.uint8]
"""Red, green and blue (h, w, 3), rows from top to bottom, columns from left to right."""

DEFAULT_SIZE = (640, 480)

_MOST_DRAWN = 2**23  # samples of a picture; each takes some 40 bytes, and more while it is drawn
_GHOST_COLOR, _GHOST_OPACITY = (0.25, 0.85, 0.45, 1.0), 0.45
_BELOW_GROUND = 0.1  # of its height, that a character may reach below the ground


class Camera:
    """Takes pictures of a character; of its reference, too, as a transparent ghost.

    The links are put where a `Body`, in a world of its own, has them. The ghost is drawn alone and
    then blended in.
    """

    def __init__(
        self,
        character: Character,
        *,
        ground: bool = True,
        terrain: Loading | None = None,
        samples: int = 2,
    ) -> None:
        """Start the engines.

        Args:
            character: The character.
            ground: Draw the plane z = 0 as a chequerboard; not if a fixed base hangs below it.
            terrain: What else lies there for ever.
            samples: Drawn along each edge of a pixel, for smooth edges; one where a picture is so
                large that more would take gigabytes.

        Raises:
            CharacterError: a file of the character or of the terrain cannot be used.
        """
        self._layout = character.layout
        self._samples = samples
        self._shapes = drawn_shapes(character)
        self._outlines = [[outline(shape) for shape in shapes] for shapes in self._shapes]
        self._still = np.zeros(character.layout.size)
        self._ghost: Stage | None = None
        self._stages: list[Stage] = []
        self._world = World(WorldSettings(ground=False))
        try:
            self._body = self._world.add(character)
            self._stage = self._new_stage(self._shapes)
            self._has_ground = ground and self._stands(np.array(character.rest_position))
            if terrain is not None:
                self._stage.add_terrain(terrain)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "Camera":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the engines."""
        self._world.close()
        for stage in self._stages:
            stage.close()

    def picture(
        self,
        position: FloatArray,
        *,
        ghost: FloatArray | None = None,
        view: View | None = None,
        size: Size = DEFAULT_SIZE,
    ) -> Picture:
        """A picture (h, w, 3) of the character at a position (n,), message form.

        Args:
            position: Where it is.
            ghost: Where its transparent copy is, (n,); None draws none.
            view: Where from; by default from where `view` says.
            size: Width and height in pixels.
        """
        view = view or self.view(position, size=size)
        width, height = size
        samples = self._samples if width * height * self._samples**2 <= _MOST_DRAWN else 1
        drawn = (width * samples, height * samples)
        if self._has_ground:
            self._stage.lay_ground(view)
        self._stage.place(*self._frames(position))
        drawing = self._stage.draw(view, drawn)
        color = drawing.color
        if ghost is not None:
            color = _laid_over(drawing, self._draw_ghost(ghost, view, drawn))
        blocks = color.reshape(height, samples, width, samples, 3)
        picture: Picture = np.rint(blocks.mean(axis=(1, 3))).astype(np.uint8)
        return picture

    def view(
        self, positions: FloatArray, *, size: Size = DEFAULT_SIZE, like: View | None = None
    ) -> View:
        """The nearest view of a position (n,), or of the first of several (p, n), that fits all.

        `followed` moves it on to the others. It has the directions and the angle of `like`; by
        default it looks at a character that faces +x from its right side and a bit from in front.
        """
        aspect = size[0] / size[1]
        return framing(*self._joint_outline(positions), aspect, like or View())

    def aspect(self, positions: FloatArray) -> float:
        """Width over height of the picture that suits all of positions (p, n) best."""
        return natural_aspect(*self._joint_outline(positions), View())

    def followed(self, view: View, start: FloatArray, position: FloatArray) -> View:
        """The view of a position (n,) that is what `view` is of `start` (n,).

        It goes with the root along the ground, not with its height, which is to be seen.
        """
        return view.moved(*self._way(start, position))

    def _way(self, start: FloatArray, end: FloatArray) -> tuple[float, float]:
        """How far the root goes along the ground, m; a fixed base nowhere."""
        if not self._layout.has_floating_base:
            return 0.0, 0.0
        x, y = (end[:2] - start[:2]).tolist()
        return x, y

    def _frames(self, position: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Origins (links, 3) in m and orientations xyzw (links, 4) of the link frames."""
        self._body.set_state(position, self._still)
        return self._body.links.frames()

    def _outline(self, position: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Spheres around all that is seen of the character: centres (m, 3), radii (m,), in m."""
        origins, turns = self._frames(position)
        points, radii = [origins], [np.zeros(len(origins))]
        for origin, turn, outlines in zip(origins, turns, self._outlines, strict=True):
            for own_points, own_radii in outlines:
                points.append(origin + rotations.rotate(turn, own_points))
                radii.append(own_radii)
        return np.concatenate(points), np.concatenate(radii)

    def _joint_outline(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Spheres around all of positions (p, n), moved to where the root of the first one is."""
        rows = np.atleast_2d(positions)
        points, radii = [], []
        for row in rows:
            own_points, own_radii = self._outline(row)
            points.append(own_points - [*self._way(rows[0], row), 0.0])
            radii.append(own_radii)
        return np.concatenate(points), np.concatenate(radii)

    def _stands(self, position: FloatArray) -> bool:
        """Whether the character is above the ground, not hanging through it as a pendulum does."""
        if self._layout.has_floating_base:  # goes where it can
            return True
        points, radii = self._outline(position)
        lowest, highest = float((points[:, 2] - radii).min()), float((points[:, 2] + radii).max())
        return lowest >= -_BELOW_GROUND * (highest - lowest)

    def _draw_ghost(self, position: FloatArray, view: View, size: Size) -> Drawing:
        if self._ghost is None:
            self._ghost = self._new_stage(
                [tuple(replace(s, color_rgba=_GHOST_COLOR) for s in own) for own in self._shapes]
            )
        self._ghost.place(*self._frames(position))
        return self._ghost.draw(view, size)

    def _new_stage(self, shapes: Sequence[tuple[Shape, ...]]) -> Stage:
        stage = Stage()
        self._stages.append(stage)
        stage.add_links(shapes)
        return stage


def _laid_over(below: Drawing, ghost: Drawing) -> FloatArray:
    """The colours (h, w, 3) with a ghost blended in, wherever nothing is before it."""
    visible = ghost.depth < below.depth
    blended = (1.0 - _GHOST_OPACITY) * below.color + _GHOST_OPACITY * ghost.color
    return np.where(visible[:, :, np.newaxis], blended, below.color)
