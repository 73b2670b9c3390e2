"""The shapes that are seen, each of them shown or not, and their drawings."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from actuated_characters.render.engine import rasteriser
from actuated_characters.render.engine.camera_pose import CameraPose, PixelRegion, Size
from actuated_characters.render.engine.ground import Samples
from actuated_characters.render.engine.posed_characters import Frames
from actuated_characters.render.engine.shape_meshes import (
    TexturedSurface,
    textured_surface_of,
    untextured,
)
from actuated_characters.render.engine.skin_surfaces import SkinSurfaces
from actuated_characters.render.engine.surfaces import arrow_surface
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.model import Pose, Quadruple, Shape, UrdfOptions
from msgs_config.character.terrain import terrain_shapes
from msgs_config.geometry import fixed_order, rotations

LIGHT_VIEW = CameraPose(yaw=0.6, pitch=1.1, field_of_view=0.06)  # the view from the light

_NEAR_PLANE = 0.02  # view distances: what is nearer is not drawn
_TERRAIN_COLOR = (0.78, 0.76, 0.70, 1.0)
_ARROW_COLOR = (0.86, 0.08, 0.24, 1.0)
_BALL_COLOR = (0.25, 0.25, 0.28, 1.0)
_SEEN, _CASTS_SHADOW = 1, 2  # marks of samples in which there is something


class Drawing(NamedTuple):
    """A part of a picture, one sample a pixel."""

    color: Samples  # (h, w, 3): red, green, blue, 0 to 255
    depth: Samples  # (h, w): distance from the camera along its axis, m; infinite: nothing
    casts_shadow: BoolArray  # (h, w): whether it is a link or a ball


class _Body(NamedTuple):
    """A surface where it is shown."""

    skin: TexturedSurface
    color: Quadruple
    origin: FloatArray  # (3,), m, world
    axes: FloatArray  # (3, 3): its own as columns, in the world, of length one or scaled
    mark: int


class _Skins(NamedTuple):
    """The surfaces of shapes in their own frames, and where these are in others."""

    surfaces: list[TexturedSurface]
    colors: list[Quadruple]
    origins: FloatArray  # (b, 3), m
    axes: FloatArray  # (b, 3, 3), as columns

    @classmethod
    def of(cls, shapes: Sequence[Shape]) -> "_Skins":
        poses = [shape.pose for shape in shapes]
        turns_xyzw = np.array([pose.orientation_xyzw for pose in poses]).reshape(-1, 4)
        return cls(
            [textured_surface_of(shape) for shape in shapes],
            [shape.color_rgba for shape in shapes],
            np.array([pose.position for pose in poses]).reshape(-1, 3),
            rotations.matrix(turns_xyzw),
        )


class RenderScene:
    """The links of characters and a terrain, balls and arrows, each of them shown or not."""

    def __init__(
        self,
        links: Sequence[tuple[Shape, ...]],
        terrain: UrdfOptions | None = None,
        skins: Sequence[SkinSurfaces] = (),
    ) -> None:
        """Make the surfaces of the shapes of each link, but for those that skins are drawn of.

        Raises:
            CharacterError: a mesh cannot be used, or the terrain's URDF.
        """
        self._skins = skins
        self._links = _Skins.of([shape for shapes in links for shape in shapes])
        self._rows = np.repeat(np.arange(len(links)), [len(shapes) for shapes in links])
        self._terrain = _Skins.of([] if terrain is None else terrain_shapes(terrain))
        self._thrown: dict[Shape, TexturedSurface] = {}  # by shape, without a pose
        self._shown: list[_Body] = []

    def clear(self) -> None:
        """Show nothing."""
        self._shown = []

    def show_links(self, frames: Frames, colors: Sequence[Quadruple | None]) -> None:
        """Show the links where their frames are, NaN hides one; None is a link's own colour."""
        skins, (origins, turns_xyzw) = self._links, frames
        turns = rotations.matrix(turns_xyzw[self._rows])
        places = origins[self._rows] + fixed_order.apply(turns, skins.origins)
        axes = fixed_order.product(turns, skins.axes)
        for number, row in enumerate(self._rows.tolist()):
            color = colors[row] or skins.colors[number]
            skin, place = skins.surfaces[number], places[number]
            self._shown.append(_Body(skin, color, place, axes[number], _CASTS_SHADOW))
        for skinned in self._skins:
            for surface, color in skinned.surfaces(frames, colors):
                self._shown.append(_Body(surface, color, np.zeros(3), np.eye(3), _CASTS_SHADOW))

    def show_terrain(self) -> None:
        """Show the terrain, if there is one."""
        skins = self._terrain
        for skin, origin, axes in zip(skins.surfaces, skins.origins, skins.axes, strict=True):
            self._shown.append(_Body(skin, _TERRAIN_COLOR, origin, axes, _SEEN))

    def show_balls(self, balls: Sequence[Shape]) -> None:
        """Show what was thrown, with poses in the world."""
        for ball in balls:
            shape, origin = replace(ball, pose=Pose()), np.array(ball.pose.position)
            if shape not in self._thrown:
                self._thrown[shape] = textured_surface_of(shape)
            axes = rotations.matrix(np.array(ball.pose.orientation_xyzw))
            self._shown.append(_Body(self._thrown[shape], _BALL_COLOR, origin, axes, _CASTS_SHADOW))

    def show_arrows(self, arrows: Iterable[FloatArray], radius: float) -> None:
        """Show arrows, none of length zero: tail and tip (2, 3); their shafts' radius; m."""
        for tail, tip in arrows:
            surface = arrow_surface(float(fixed_order.norm(tip - tail)), radius)
            axes = rotations.matrix(rotations.from_z(tip - tail))
            self._shown.append(_Body(untextured(surface), _ARROW_COLOR, tail, axes, _SEEN))

    def draw(self, view: CameraPose, size: Size, box: PixelRegion) -> Drawing:
        """What is seen in a part of a view's picture of a size; the part is not empty."""
        width, height = size
        shape = (box.bottom - box.top, box.right - box.left)
        color = np.zeros((*shape, 3), dtype=np.float32)
        inverses = np.zeros(shape, dtype=np.float32)
        marks = np.zeros(shape, dtype=np.uint8)
        middle = (0.5 * width - box.left, 0.5 * height - box.top)
        lens = np.array((1.0 / view.pixel(height), *middle, _NEAR_PLANE * view.distance))
        origins = np.array([body.origin for body in self._shown]).reshape(-1, 3)
        turns = np.array([body.axes for body in self._shown]).reshape(-1, 3, 3)
        seen_axes = fixed_order.product(view.axes(), turns)
        seen_origins = fixed_order.apply(view.axes(), origins - view.eye())
        lights = fixed_order.apply(turns.swapaxes(-1, -2), LIGHT_VIEW.axes()[2])
        for number, body in enumerate(self._shown):
            rasteriser.draw_triangles(
                *body.skin.surface,
                body.skin.uvs,
                body.skin.texture,
                255.0 * np.array(body.color[:3]),
                seen_axes[number],
                seen_origins[number],
                lights[number] / fixed_order.norm(lights[number]),
                lens,
                body.mark,
                color,
                inverses,
                marks,
            )
        with np.errstate(divide="ignore"):
            depth: Samples = np.float32(1.0) / inverses
        return Drawing(color, depth, marks == _CASTS_SHADOW)
