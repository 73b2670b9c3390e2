"""A picture that is being made: the ground, the shadow on it, and over it what stages show."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from actuated_characters.render.engine import ground, layers
from actuated_characters.render.engine.camera_pose import Box, CameraPose, framing
from actuated_characters.render.engine.ground import Samples
from actuated_characters.render.engine.layers import Drawing
from actuated_characters.render.engine.render_scene import LIGHT_VIEW, RenderScene, Size
from msgs_config.arrays import FloatArray

Picture: TypeAlias = NDArray[np.uint8]
"""Red, green and blue (h, w, 3), rows from top to bottom, columns from left to right."""

_SHADOW = 0.72  # of the ground's brightness
_SHADOW_SIZE = (384, 384)  # of the picture from the light


class Compositor:
    """What a view sees, from the ground upwards."""

    def __init__(self, view: CameraPose, size: Size, *, samples: int, has_ground: bool) -> None:
        """Begin with the ground and the sky.

        Args:
            view: Where from.
            size: Width and height in pixels.
            samples: Drawn along each edge of a pixel.
            has_ground: Whether there is the plane z = 0.
        """
        width, height = size
        self._view, self._size, self._samples = view, size, samples
        self._fine_size = (width * samples, height * samples)
        self._has_ground = has_ground
        self._solid: tuple[Drawing, Box] | None = None
        if has_ground:
            self._colors = ground.colors(view, size)
        else:
            self._colors = np.broadcast_to(ground.BACKGROUND, (height, width, 3)).copy()

    def picture(self) -> Picture:
        """What has been drawn so far."""
        finished: Picture = np.rint(self._colors).astype(np.uint8)
        return finished

    def darken(self, stage: RenderScene, points: FloatArray, radii: FloatArray) -> None:
        """Darken the ground where the links keep the light off: what is seen from the light.

        The engine's own shadows darken the ground as a whole. Spheres (m, 3) and (m,) in m are
        around the links.
        """
        light = framing(points, radii, 1.0, LIGHT_VIEW)
        whole = Box(0, _SHADOW_SIZE[1], 0, _SHADOW_SIZE[0])
        dark = stage.draw(light, _SHADOW_SIZE, whole).is_link
        box = layers.shadow_box(light, self._view, self._size)
        if not box:
            return
        fine = box.times(self._samples)
        shadow = layers.shadow(dark, light, self._view, self._fine_size, fine)
        share = layers.shrunk(shadow, self._samples)[:, :, np.newaxis]
        self._colors[box.rows, box.columns] *= 1.0 - (1.0 - _SHADOW) * share

    def draw_solid(self, stage: RenderScene, box: Box) -> None:
        """Draw what a stage has in a part of the picture, wherever the ground does not hide it."""
        if not box:
            return
        fine = box.times(self._samples)
        drawing = stage.draw(self._view, self._fine_size, fine)
        layer = layers.solid(drawing, self._ground_depth(fine), self._view)
        layers.lay(self._colors, box, layer, self._samples)
        self._solid = drawing, fine

    def draw_over(self, stage: RenderScene, box: Box, opacity: float, hidden: float = 0.0) -> None:
        """Blend in what a stage has in a part of the picture.

        With one opacity where it is before all that is solid, and with another where it is not.
        """
        if not box:
            return
        fine = box.times(self._samples)
        before = self._ground_depth(fine)[:, np.newaxis]
        if self._solid is not None:
            before = layers.nearest(*self._solid, before, fine)
        drawing = stage.draw(self._view, self._fine_size, fine)
        layer = layers.transparent(drawing, before, opacity, hidden)
        layers.lay(self._colors, box, layer, self._samples)

    def _ground_depth(self, fine: Box) -> Samples:
        """Of the rows of a part, in samples, m."""
        rows = np.arange(fine.top + 0.5, fine.bottom)
        if not self._has_ground:
            return np.full(len(rows), np.inf, dtype=np.float32)
        return ground.depths(self._view, self._fine_size[1], rows).astype(np.float32)
