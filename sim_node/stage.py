"""What is seen of a world, in an engine of its own that has no physics, and its pictures.

The engine's software renderer draws it: no window, no GPU, the same picture each time.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import degrees
from typing import NamedTuple, TypeAlias

import numpy as np

from msgs_config import rotations
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.bullet import captured_output, connect, load_urdf, pybullet
from msgs_config.character import Loading, Quadruple, Shape, ShapeType
from msgs_config.errors import CharacterError
from sim_node.surfaces import round_surface
from sim_node.view import View

Size: TypeAlias = tuple[int, int]
"""Width and height of a picture in pixels."""

_NEAR, _FAR = 0.02, 50.0  # of the view's distance: what is nearer or farther is not drawn
_HAZE = (1.6, 2.9)  # of the view's distance: where the background's colour begins, and is all
_BACKGROUND = 255.0 * np.array((0.93, 0.95, 0.98))
_LIGHT_VIEW = View(yaw=0.6, pitch=1.1, field_of_view=0.06)  # from the light
_LIGHT_AWAY = 20.0  # of the view's distance: nearly parallel
_LIGHT_SIZE = (512, 512)
_SHADOW = 0.72  # of the ground's brightness
_LIGHT = {"lightAmbientCoeff": 0.6, "lightDiffuseCoeff": 0.45, "lightSpecularCoeff": 0.0}
_TILE_COLORS = ((0.88, 0.90, 0.92, 1.0), (0.70, 0.74, 0.79, 1.0))
_TERRAIN_COLOR = (0.78, 0.76, 0.70, 1.0)
_TILES = 30  # of the ground, to each side: at least to where the haze is all
_TILES_A_VIEW = 6  # or up to 2.5 times as many, along the view's distance


class Drawing(NamedTuple):
    """A picture as it is drawn, one sample a pixel."""

    color: FloatArray  # (h, w, 3): red, green, blue, 0 to 255
    depth: FloatArray  # (h, w): distance from the camera along its axis, m


class Stage:
    """What is seen: the links of a character, the ground, a terrain."""

    def __init__(self) -> None:
        """Start the engine."""
        self._client = connect()
        self._parts: list[tuple[int, int]] = []  # row of the link, body
        self._tiles: list[int] = []  # bodies
        self._tile = 0.0  # m

    def close(self) -> None:
        """End the engine."""
        pybullet.disconnect(self._client)

    def add_links(self, shapes: Sequence[tuple[Shape, ...]]) -> None:
        """Add the shapes of each link.

        Raises:
            CharacterError: the engine refuses one.
        """
        with captured_output():
            for row, own in enumerate(shapes):
                self._parts += [(row, self._add_shape(shape)) for shape in own]

    def add_terrain(self, terrain: Loading) -> None:
        """Add what lies there for ever. Raises CharacterError if the engine refuses its URDF."""
        body = load_urdf(self._client, terrain)
        for link in range(-1, pybullet.getNumJoints(body, physicsClientId=self._client)):
            pybullet.changeVisualShape(
                body, link, rgbaColor=_TERRAIN_COLOR, physicsClientId=self._client
            )

    def place(self, origins: FloatArray, turns_xyzw: FloatArray) -> None:
        """Put the links where their frames are: (links, 3) in m and (links, 4)."""
        for row, body in self._parts:
            self._put(body, origins[row], turns_xyzw[row])

    def lay_ground(self, view: View) -> None:
        """Have a chequerboard at z = 0 around where a view looks, its tiles of a size that suits.

        It always has one grid, that of the world, so that it shows how far a character has gone.
        """
        tile = _round_length(view.distance / _TILES_A_VIEW)
        if tile != self._tile:
            for body in self._tiles:
                pybullet.removeBody(body, physicsClientId=self._client)
            self._tile = tile
            self._tiles = [self._add_tiles(tile, parity) for parity in range(2)]
        x, y = (2.0 * tile * round(place / (2.0 * tile)) for place in view.target[:2])
        for body in self._tiles:
            self._put(body, np.array((x, y, 0.0)), np.array(rotations.IDENTITY_XYZW))

    def draw(self, view: View, size: Size) -> Drawing:
        """What is seen in a view."""
        color, depth, bodies = self._render(view, size)
        if self._tiles:
            ground = np.isin(bodies, self._tiles)
            color[self._in_shadow(view, ground, depth)] *= _SHADOW
        return Drawing(_hazed(color, depth / view.distance), depth)

    def _in_shadow(self, view: View, ground: BoolArray, depth: FloatArray) -> BoolArray:
        """Where (h, w) the links keep the light from the ground: what is seen from the light.

        The engine's own shadows darken the ground as a whole.
        """
        light = replace(_LIGHT_VIEW, target=view.target, distance=_LIGHT_AWAY * view.distance)
        _, _, bodies = self._render(light, _LIGHT_SIZE)
        dark = np.isin(bodies, [body for _, body in self._parts])
        shadow = np.zeros_like(ground)
        size = (ground.shape[1], ground.shape[0])
        seen = view.points(np.array(np.nonzero(ground)), depth[ground], size)
        rows, columns = light.pixels(seen, _LIGHT_SIZE)
        height, width = dark.shape
        within = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
        shadow[ground] = within & dark[rows * within, columns * within]
        return shadow

    def _render(self, view: View, size: Size) -> tuple[FloatArray, FloatArray, IntArray]:
        """Colours (h, w, 3), distances (h, w) along the axis in m, and bodies (h, w), -1: none."""
        width, height = size
        near, far = _NEAR * view.distance, _FAR * view.distance
        _, _, rgba, depths, bodies = pybullet.getCameraImage(
            width,
            height,
            pybullet.computeViewMatrix(view.eye().tolist(), view.target, view.axes()[1].tolist()),
            pybullet.computeProjectionMatrixFOV(
                degrees(view.field_of_view), width / height, near, far
            ),
            lightDirection=_LIGHT_VIEW.axes()[2].tolist(),
            lightColor=(1.0, 1.0, 1.0),
            shadow=0,
            **_LIGHT,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        color = np.reshape(rgba, (height, width, 4))[:, :, :3].astype(float)
        seen = np.reshape(bodies, (height, width)).astype(np.intp)
        stored = np.reshape(depths, (height, width)).astype(float)
        depth = far * near / (far - (far - near) * stored)  # as a graphics card stores it
        depth[seen < 0] = np.inf
        return color, depth, seen

    def _put(self, body: int, origin: FloatArray, turn_xyzw: FloatArray) -> None:
        pybullet.resetBasePositionAndOrientation(
            body, origin, turn_xyzw, physicsClientId=self._client
        )

    def _add_shape(self, shape: Shape) -> int:
        """A shape as a body at the origin."""
        measures: dict[str, object]
        if shape.type is ShapeType.BOX:
            measures = {"halfExtents": [0.5 * edge for edge in shape.size]}
        elif shape.type is ShapeType.MESH:
            measures = {"fileName": shape.mesh, "meshScale": shape.size}
        else:
            surface = round_surface(shape)
            measures = _triangles(surface.vertices, surface.normals, surface.triangles)
        is_box = shape.type is ShapeType.BOX
        geometry = pybullet.GEOM_BOX if is_box else pybullet.GEOM_MESH
        red, green, blue, _ = shape.color_rgba  # the renderer knows no transparency
        try:
            return self._add_body(
                geometry,
                (red, green, blue, 1.0),
                visualFramePosition=shape.pose.position,
                visualFrameOrientation=shape.pose.orientation_xyzw,
                **measures,
            )
        except pybullet.error as error:
            raise CharacterError(f"cannot draw {shape.mesh or f'a {shape.type.value}'}") from error

    def _add_tiles(self, tile: float, parity: int) -> int:
        """Every second square of a chequerboard around the origin, each `tile` m wide."""
        column, row = np.mgrid[-_TILES:_TILES, -_TILES:_TILES].reshape(2, -1)
        mine = (column + row) % 2 == parity
        lowest = np.column_stack((column, row, np.zeros_like(row)))[mine]
        corners = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)])
        vertices = tile * (lowest[:, np.newaxis] + corners).reshape(-1, 3)
        first = np.arange(0, len(vertices), 4)[:, np.newaxis]
        normals = np.tile((0.0, 0.0, 1.0), (len(vertices), 1))
        triangles = first + np.array((0, 1, 2, 0, 2, 3))
        return self._add_body(
            pybullet.GEOM_MESH, _TILE_COLORS[parity], **_triangles(vertices, normals, triangles)
        )

    def _add_body(self, geometry: int, color: Quadruple, **measures: object) -> int:
        seen = pybullet.createVisualShape(
            geometry, rgbaColor=color, **measures, physicsClientId=self._client
        )
        return int(pybullet.createMultiBody(0.0, -1, seen, physicsClientId=self._client))


def _triangles(vertices: FloatArray, normals: FloatArray, triangles: IntArray) -> dict[str, object]:
    """A surface as the engine takes it."""
    return {
        "vertices": vertices.tolist(),
        "normals": normals.tolist(),
        "indices": triangles.ravel().tolist(),
        "uvs": [(0.0, 0.0)] * len(vertices),
    }


def _round_length(length: float) -> float:
    """The largest of 1, 2 or 5 times a power of ten that is not above a length, m."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= length))


def _hazed(color: FloatArray, distance: FloatArray) -> FloatArray:
    """Colours (h, w, 3) that become the background's with the distance (h, w)."""
    begin, end = _HAZE
    share = np.clip((distance - begin) / (end - begin), 0.0, 1.0)[:, :, np.newaxis]
    return (1.0 - share) * color + share * _BACKGROUND
