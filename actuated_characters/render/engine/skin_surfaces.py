"""A character's skin as surfaces to be drawn, each of one colour or with a texture."""

from collections.abc import Iterator, Sequence

import numpy as np

from actuated_characters.render.engine.camera_pose import Spheres
from actuated_characters.render.engine.posed_characters import Frames
from actuated_characters.render.engine.shape_meshes import TexturedSurface, untextured
from actuated_characters.render.skin.skin import PosedSkin, Skin
from msgs_config.arrays import BoolArray
from msgs_config.character.model import Quadruple
from msgs_config.geometry import rotations
from msgs_config.geometry.surface import Surface

_WHITE: Quadruple = (1.0, 1.0, 1.0, 1.0)


class SkinSurfaces:
    """The skin of one character among several."""

    def __init__(self, skin: Skin, colors: Sequence[Quadruple | None], links: slice) -> None:
        """Take a skin.

        Args:
            skin: Which.
            colors: Of its links (l,), rgba; None are the skin's own.
            links: Which of all links are its own.
        """
        self._posed, self._colors, self.links = PosedSkin(skin), colors, links
        self._around = None if skin.colors is None else skin.spheres()
        if skin.colors is not None:
            # A texture of a texel for each colour, in the middle of which all of a triangle is.
            levels = np.round(255.0 * skin.colors).astype(np.uint8)
            texels, numbers = np.unique(levels, axis=0, return_inverse=True)
            self._texture = texels[np.newaxis]
            self._columns = (numbers.ravel() + 0.5) / len(texels)

    def spheres(self, frames: Frames) -> Spheres:
        """Spheres around all of it, of the frames of all links; a made one is in its shapes'."""
        origins, turns_xyzw = (each[self.links] for each in frames)
        if self._around is None or not np.isfinite(origins).all():
            return Spheres(np.empty((0, 3)), np.empty(0))
        centres, radii = self._around
        return Spheres(origins + rotations.rotate(turns_xyzw, centres), radii)

    def surfaces(
        self, frames: Frames, colors: Sequence[Quadruple | None]
    ) -> Iterator[tuple[TexturedSurface, Quadruple]]:
        """What is to be drawn where all links are there; none if one is not.

        Args:
            frames: Of all links.
            colors: Of all links, instead of their own; None are their own.
        """
        origins, turns_xyzw = (each[self.links] for each in frames)
        if not np.isfinite(origins).all():
            return
        whole = self._posed.surface(origins, turns_xyzw)
        chosen = [given or own for given, own in zip(colors[self.links], self._colors, strict=True)]
        for which, color in self._posed.skin.colored(chosen):
            if color is None:
                yield self._with_own_colors(whole, which), _WHITE
            else:
                yield untextured(whole._replace(triangles=whole.triangles[which])), color

    def _with_own_colors(self, whole: Surface, which: BoolArray) -> TexturedSurface:
        """Some of the triangles (k,), which share no corners."""
        corners = whole.triangles[which].ravel()
        surface = Surface(
            whole.vertices[corners],
            whole.normals[corners],
            np.arange(len(corners)).reshape(-1, 3),
        )
        columns = np.repeat(self._columns[which], 3)
        uvs = np.column_stack((columns, np.full(len(columns), 0.5)))
        return TexturedSurface(surface, uvs, self._texture)
