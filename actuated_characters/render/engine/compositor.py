"""A picture in layers: ground and sky, the shadow on the ground, and what a scene shows, in turn.

Scenes are drawn with several samples along each edge of a pixel, of which the picture has the
mean; what the samples leave free shows what is below.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from actuated_characters.render.engine import ground
from actuated_characters.render.engine.camera_pose import (
    CameraPose,
    PixelRegion,
    Size,
    Spheres,
    framing,
)
from actuated_characters.render.engine.ground import Samples
from actuated_characters.render.engine.rasteriser import add_shadow
from actuated_characters.render.engine.render_scene import LIGHT_VIEW, RenderScene
from msgs_config.arrays import BoolArray
from msgs_config.geometry import fixed_order

Picture: TypeAlias = NDArray[np.uint8]
"""Red, green and blue (h, w, 3), rows from top to bottom, columns from left to right."""

_SHADOW = 0.72  # share of the ground's brightness that a shadow leaves
_SHADOW_SIZE = (384, 384)  # pixels of the picture from the light
_LINE_OPACITY, _FILL_OPACITY = 0.85, 0.2  # of an outline, and of what is within it beside bodies
_LINE_SHARE = 1.0 / 350.0  # width of a line, of the picture's height


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
        self._colors: Samples = np.broadcast_to(ground.BACKGROUND, (height, width, 3)).copy()
        # for each sample, the distance of what is solid from the camera along its axis, m
        self._depth = np.full((height * samples, width * samples), np.inf, dtype=np.float32)
        self._is_body = np.zeros(self._depth.shape, dtype=np.bool_)
        if has_ground:
            self._colors = ground.colors(view, size)
            rows = np.arange(0.5, height * samples)
            self._depth[:] = ground.depths(view, height * samples, rows)[:, np.newaxis]

    def picture(self) -> Picture:
        """What has been drawn so far."""
        finished: Picture = np.rint(self._colors).astype(np.uint8)
        return finished

    def darken_ground(self, scene: RenderScene, casting: Spheres) -> None:
        """Darken the ground where what lies in spheres keeps the light off.

        That is what is seen from the light.
        """
        if not len(casting.radii):
            return
        light = framing(casting, 1.0, LIGHT_VIEW)
        width, height = _SHADOW_SIZE
        dark = scene.draw(light, _SHADOW_SIZE, PixelRegion(0, height, 0, width)).casts_shadow
        edges = np.array((0.0, 1.0))
        x, y = ground.places(light, (1, 1), edges, edges)  # corners of the picture from the light
        corners = np.column_stack((x.ravel(), y.ravel(), np.zeros(4)))
        box = self._view.box(Spheres(corners, np.zeros(4)), self._size)
        if box:
            share = self._shadow(dark, light, box)
            self._colors[box.part] *= 1.0 - (1.0 - _SHADOW) * share[:, :, np.newaxis]

    def draw_solid(self, scene: RenderScene, box: PixelRegion) -> None:
        """Draw what a scene has in a part of the picture, wherever nothing solid hides it."""
        if not box:
            return
        fine = box.times(self._samples)
        drawing = scene.draw(self._view, self._fine_size, fine)
        solid = self._depth[fine.part]
        seen = drawing.depth < solid
        paint = np.where(seen[:, :, np.newaxis], drawing.color, np.float32(0.0))
        share = ground.haze(drawing.depth / np.float32(self._view.distance))
        if share.max(initial=0.0, where=seen) > 0.0:
            paint += (seen * share)[:, :, np.newaxis] * (ground.BACKGROUND - paint)
        np.minimum(solid, drawing.depth, out=solid)
        self._is_body[fine.part] |= seen
        self._lay(box, paint, (~seen).astype(np.float32))

    def draw_over(
        self, scene: RenderScene, box: PixelRegion, opacity: float, hidden: float = 0.0
    ) -> None:
        """Blend in what a scene has in a part of the picture.

        With one opacity where it is before all that is solid, and with another where it is not.
        """
        if not box:
            return
        fine = box.times(self._samples)
        drawing = scene.draw(self._view, self._fine_size, fine)
        seen = drawing.depth < self._depth[fine.part]
        share = np.where(seen, opacity, hidden * np.isfinite(drawing.depth)).astype(np.float32)
        self._lay(box, share[:, :, np.newaxis] * drawing.color, 1.0 - share)

    def draw_outline(self, scene: RenderScene, box: PixelRegion, color: Samples) -> None:
        """Draw the outline of what a scene has in a part of the picture, also over bodies.

        It is filled faintly where no body is, so that it muddies no colour of theirs. `color` is
        red, green and blue (3,), 0 to 255.
        """
        if not box:
            return
        fine = box.times(self._samples)
        drawing = scene.draw(self._view, self._fine_size, fine)
        within = np.isfinite(drawing.depth)
        width = max(_LINE_SHARE * self._size[1], 1.0)
        line = within & ~_eroded(within, round(width * self._samples))
        fills = (drawing.depth < self._depth[fine.part]) & ~self._is_body[fine.part]
        share = np.where(line, _LINE_OPACITY, _FILL_OPACITY * fills).astype(np.float32)
        self._lay(box, share[:, :, np.newaxis] * color, 1.0 - share)

    def _lay(self, box: PixelRegion, paint: Samples, clear: Samples) -> None:
        """Lay samples over a part of the picture.

        Colours (h, w, 3) times the share that they cover, and the share (h, w) of what is below.
        """
        below = self._mean(clear)[:, :, np.newaxis] * self._colors[box.part]
        self._colors[box.part] = self._mean(paint) + below

    def _mean(self, fine: Samples) -> Samples:
        """The mean (h, w, ...) of the samples of each pixel."""
        edge = self._samples
        if edge == 1:
            return fine
        total = fine[::edge, ::edge].copy()
        for number in range(1, edge**2):
            row, column = divmod(number, edge)
            total += fine[row::edge, column::edge]
        mean: Samples = total * np.float32(1.0 / edge**2)
        return mean

    def _shadow(self, dark: BoolArray, light: CameraPose, box: PixelRegion) -> Samples:
        """The share of the pixels (h, w) of a part of the picture that see ground without light.

        `dark` is where something that casts a shadow is seen from the light.
        """
        height, width = dark.shape
        seen = ground.seen_places(self._view, self._fine_size)
        places = fixed_order.product(ground.seen_from(light, (width, height)), seen)
        fine = box.times(self._samples)
        share = np.zeros((box.bottom - box.top, box.right - box.left), dtype=np.float32)
        add_shadow(dark, np.vstack((places, seen[2])), (fine.top, fine.left), self._samples, share)
        return share


def _eroded(within: BoolArray, reach: int) -> BoolArray:
    """What (h, w) of a region is farther than so many samples from its border, along the axes."""
    left = within
    for _ in range(reach):
        padded = np.pad(left, 1, mode="edge")
        left = left & padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    return left
