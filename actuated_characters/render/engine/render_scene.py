"""What is seen of a world, in an engine of its own that has no physics, and its pictures.

The engine's software renderer draws it: no window, no GPU, the same picture each time.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import tan
from typing import TypeAlias

import numpy as np

from actuated_characters.render.engine.camera_pose import Box, CameraPose
from actuated_characters.render.engine.ground import Samples
from actuated_characters.render.engine.layers import Drawing
from actuated_characters.render.engine.surfaces import (
    HEAD_WIDTH,
    Surface,
    arrow_surface,
    round_surface,
)
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.bullet import captured_output, connect, load_urdf, pybullet
from msgs_config.character.model import Quadruple, Shape, ShapeType, UrdfOptions
from msgs_config.errors import CharacterError
from msgs_config.geometry import rotations

Size: TypeAlias = tuple[int, int]
"""Width and height of a picture in pixels."""

LIGHT_VIEW = CameraPose(yaw=0.6, pitch=1.1, field_of_view=0.06)  # from the light

_NEAR, _FAR = 0.02, 50.0  # of the view's distance: what is nearer or farther is not drawn
_LIGHT = {"lightAmbientCoeff": 0.6, "lightDiffuseCoeff": 0.45, "lightSpecularCoeff": 0.0}
_TERRAIN_COLOR = (0.78, 0.76, 0.70, 1.0)
_ARROW_RADIUS = 0.005  # of the view's distance
_MARK_COLOR = (0.55, 0.15, 0.75, 1.0)
_ARROW_COLOR = (0.86, 0.08, 0.24, 1.0)
_BALL_COLOR = (0.25, 0.25, 0.28, 1.0)
_NOWHERE = np.array((0.0, 0.0, -1e6))  # m, where no view looks


@dataclass(frozen=True)
class Arrow:
    """An arrow in the world, as thick as suits a view."""

    tail: FloatArray  # (3,), m
    tip: FloatArray  # (3,), m

    def outline(self, view: CameraPose) -> tuple[FloatArray, FloatArray]:
        """Spheres around it: centres (2, 3), radii (2,), in m."""
        return np.array((self.tail, self.tip)), np.full(2, HEAD_WIDTH * self.radius(view))

    def radius(self, view: CameraPose) -> float:
        """Of its shaft, m."""
        return _ARROW_RADIUS * view.distance


class RenderScene:
    """What is seen: the links of characters, a terrain, balls, arrows."""

    def __init__(self) -> None:
        """Start the engine."""
        self._client = connect()
        self._parts: list[tuple[int, int]] = []  # row of the link, body
        self._colors: list[Quadruple] = []  # of each part
        self._marked: set[int] = set()  # bodies
        self._arrows: list[int] = []  # bodies
        self._balls: list[tuple[float, int]] = []  # radius, body
        self.has_terrain = False

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
                self._colors += [_opaque(shape.color_rgba) for shape in own]

    def add_terrain(self, terrain: UrdfOptions) -> None:
        """Add what stays there. Raises CharacterError if the engine refuses its URDF."""
        body = load_urdf(self._client, terrain)
        for link in range(-1, pybullet.getNumJoints(body, physicsClientId=self._client)):
            pybullet.changeVisualShape(
                body, link, rgbaColor=_TERRAIN_COLOR, physicsClientId=self._client
            )
        self.has_terrain = True

    def place(self, origins: FloatArray, turns_xyzw: FloatArray) -> None:
        """Put the links where their frames are: (links, 3) in m and (links, 4); NaN hides one."""
        for row, body in self._parts:
            if np.isnan(origins[row]).any():
                self._put(body, _NOWHERE, np.array(rotations.IDENTITY_XYZW))
            else:
                self._put(body, origins[row], turns_xyzw[row])

    def mark(self, rows: BoolArray) -> None:
        """Draw these links (links,) in the colour of a mark, the others in their own."""
        for (row, body), color in zip(self._parts, self._colors, strict=True):
            if bool(rows[row]) != (body in self._marked):
                pybullet.changeVisualShape(
                    body,
                    -1,
                    rgbaColor=_MARK_COLOR if rows[row] else color,
                    physicsClientId=self._client,
                )
                self._marked ^= {body}

    def show_balls(self, balls: FloatArray) -> None:
        """Have these balls, of which centres and radii (m, 4) are given in m, and no others."""
        radii = balls[:, 3].tolist()
        if [radius for radius, _ in self._balls] != radii:
            for _, body in self._balls:
                pybullet.removeBody(body, physicsClientId=self._client)
            self._balls = [(radius, self._add_ball(radius)) for radius in radii]
        for (_, body), ball in zip(self._balls, balls, strict=True):
            self._put(body, ball[:3], np.array(rotations.IDENTITY_XYZW))

    def _add_ball(self, radius: float) -> int:
        return self._add_shape(Shape(ShapeType.SPHERE, (radius,), color_rgba=_BALL_COLOR))

    def show_arrows(self, arrows: Sequence[Arrow], view: CameraPose) -> None:
        """Have these arrows, none of length zero, and no others."""
        for body in self._arrows:
            pybullet.removeBody(body, physicsClientId=self._client)
        self._arrows = []
        for arrow in arrows:
            along = arrow.tip - arrow.tail
            length = float(np.linalg.norm(along))
            surface = arrow_surface(length, arrow.radius(view))
            body = self._add_body(pybullet.GEOM_MESH, _ARROW_COLOR, **_triangles(surface))
            self._put(body, arrow.tail, _turn_from_z(along / length))
            self._arrows.append(body)

    def draw(self, view: CameraPose, size: Size, box: Box) -> Drawing:
        """What is seen in a part of a view's picture of a size; the part is not empty."""
        near, far = _NEAR * view.distance, _FAR * view.distance
        width, height = size
        step = 2.0 * tan(0.5 * view.field_of_view) / height * near  # a pixel on the near plane
        columns, rows = box.size
        _, _, rgba, depths, bodies = pybullet.getCameraImage(
            columns,
            rows,
            pybullet.computeViewMatrix(view.eye().tolist(), view.target, view.axes()[1].tolist()),
            pybullet.computeProjectionMatrix(
                step * (box.left - 0.5 * width),
                step * (box.right - 0.5 * width),
                step * (0.5 * height - box.bottom),
                step * (0.5 * height - box.top),
                near,
                far,
            ),
            lightDirection=LIGHT_VIEW.axes()[2].tolist(),
            lightColor=(1.0, 1.0, 1.0),
            shadow=0,
            **_LIGHT,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        color = np.reshape(rgba, (rows, columns, 4))[:, :, :3].astype(np.float32)
        seen: IntArray = np.reshape(bodies, (rows, columns))
        stored: Samples = np.reshape(depths, (rows, columns))
        depth: Samples = far * near / (far - (far - near) * stored)  # as graphics cards store it
        depth[seen < 0] = np.inf
        casting = [body for _, body in (*self._parts, *self._balls)]
        return Drawing(color, depth, np.isin(seen, casting))

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
            measures = _triangles(round_surface(shape))
        is_box = shape.type is ShapeType.BOX
        geometry = pybullet.GEOM_BOX if is_box else pybullet.GEOM_MESH
        try:
            return self._add_body(
                geometry,
                _opaque(shape.color_rgba),
                visualFramePosition=shape.pose.position,
                visualFrameOrientation=shape.pose.orientation_xyzw,
                **measures,
            )
        except pybullet.error as error:
            raise CharacterError(f"cannot draw {shape.mesh or f'a {shape.type.value}'}") from error

    def _add_body(self, geometry: int, color: Quadruple, **measures: object) -> int:
        seen = pybullet.createVisualShape(
            geometry, rgbaColor=color, **measures, physicsClientId=self._client
        )
        return int(pybullet.createMultiBody(0.0, -1, seen, physicsClientId=self._client))


def _triangles(surface: Surface) -> dict[str, object]:
    """A surface as the engine takes it."""
    return {
        "vertices": surface.vertices.tolist(),
        "normals": surface.normals.tolist(),
        "indices": surface.triangles.ravel().tolist(),
        "uvs": [(0.0, 0.0)] * len(surface.vertices),
    }


def _opaque(color: Quadruple) -> Quadruple:
    """The renderer knows no transparency."""
    red, green, blue, _ = color
    return red, green, blue, 1.0


def _turn_from_z(direction: FloatArray) -> FloatArray:
    """The shortest turn xyzw (4,) that leads z to a unit vector (3,)."""
    x, y, z = direction.tolist()
    if z < -1.0 + 1e-9:
        return np.array((1.0, 0.0, 0.0, 0.0))
    return rotations.normalised(np.array((-y, x, 0.0, 1.0 + z)))
