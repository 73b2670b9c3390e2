"""A character that is put into poses to be seen: where its links are then, and their extent."""

import numpy as np

from actuated_characters.render.engine.visual_shapes import drawn_shapes, outline
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character, Shape
from msgs_config.geometry import rotations
from sim_node.physics.world import World, WorldSettings


class PosedCharacter:
    """The shapes of a character of n degrees of freedom, and where they are at a position.

    The links are put where a `Body`, in a world of its own, has them.
    """

    def __init__(self, character: Character) -> None:
        """Start the engine.

        Raises:
            CharacterError: a file of the character cannot be used.
        """
        self.layout = character.layout
        self.shapes: list[tuple[Shape, ...]] = drawn_shapes(character)
        self._outlines = [[outline(shape) for shape in shapes] for shapes in self.shapes]
        self._still = np.zeros(character.layout.size)
        self._world = World(WorldSettings(ground=False))
        try:
            self._body = self._world.add(character)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the engine."""
        self._world.close()

    def frames(self, position: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Origins (links, 3) in m and orientations xyzw (links, 4) of the link frames.

        At a position (n,), message form; where that is NaN, so are they.
        """
        if np.isnan(position).any():
            count = len(self.shapes)
            return np.full((count, 3), np.nan), np.full((count, 4), np.nan)
        self._body.set_state(position, self._still)
        return self._body.link_frames()

    def outline(self, origins: FloatArray, turns_xyzw: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Spheres around all that is seen of it: centres (m, 3), radii (m,), in m.

        With the link frames where `frames` says; none where these are NaN.
        """
        if np.isnan(origins).any():
            return np.empty((0, 3)), np.empty(0)
        points, radii = [origins], [np.zeros(len(origins))]
        for row, (origin, turn) in enumerate(zip(origins, turns_xyzw, strict=True)):
            own_points, own_radii = self.link_outline(row, origin, turn)
            points.append(own_points)
            radii.append(own_radii)
        return np.concatenate(points), np.concatenate(radii)

    def link_outline(
        self, row: int, origin: FloatArray, turn_xyzw: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Likewise around one link whose frame is there; none where it has no shape."""
        points, radii = [np.empty((0, 3))], [np.empty(0)]
        for own_points, own_radii in self._outlines[row]:
            points.append(origin + rotations.rotate(turn_xyzw, own_points))
            radii.append(own_radii)
        return np.concatenate(points), np.concatenate(radii)

    def way(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """How far the root goes along the ground (2,), m; a fixed base nowhere."""
        if not self.layout.has_floating_base:
            return np.zeros(2)
        way: FloatArray = end[:2] - start[:2]
        return way
