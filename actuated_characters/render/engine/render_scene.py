"""The shapes that are seen, in an engine that has no physics, and its drawings of them.

The engine's software renderer draws them: no window, no GPU, the same picture each time.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from actuated_characters.render.engine.camera_pose import CameraPose, PixelRegion, Size
from actuated_characters.render.engine.ground import Samples
from actuated_characters.render.engine.posed_characters import Frames
from actuated_characters.render.engine.surfaces import arrow_surface, round_surface
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.meshes.triangles import file_for_engine
from msgs_config.character.model import Quadruple, Shape, ShapeType, UrdfOptions
from msgs_config.errors import CharacterError
from msgs_config.geometry import rotations
from msgs_config.geometry.surface import Surface
from sim_node.physics.bullet.c_library import c_numbers, captured_output
from sim_node.physics.bullet.client import Engine, load_urdf, pybullet

LIGHT_VIEW = CameraPose(yaw=0.6, pitch=1.1, field_of_view=0.06)  # the view from the light

# In view distances: what is nearer or farther is not drawn.
_NEAR_PLANE, _FAR_PLANE = 0.02, 50.0
_LIGHT = {"lightAmbientCoeff": 0.6, "lightDiffuseCoeff": 0.45, "lightSpecularCoeff": 0.0}
_TERRAIN_COLOR = (0.78, 0.76, 0.70, 1.0)
_ARROW_COLOR = (0.86, 0.08, 0.24, 1.0)
_BALL_COLOR = (0.25, 0.25, 0.28, 1.0)
_OUT_OF_VIEW = (0.0, 0.0, -1e6)  # m, where no view looks


class Drawing(NamedTuple):
    """A part of a picture as the engine draws it, one sample a pixel."""

    color: Samples  # (h, w, 3): red, green, blue, 0 to 255
    depth: Samples  # (h, w): distance from the camera along its axis, m; infinite: nothing
    casts_shadow: BoolArray  # (h, w): whether it is a link or a ball


class RenderScene:
    """The links of characters and a terrain, balls and arrows, each of them shown or not."""

    def __init__(
        self, links: Sequence[tuple[Shape, ...]], terrain: UrdfOptions | None = None
    ) -> None:
        """Start the engine, with the shapes of each link.

        Raises:
            CharacterError: the engine refuses a shape or the terrain's URDF.
        """
        self._client = Engine()
        self._links: list[tuple[int, int, Quadruple]] = []  # row of the link, body, colour
        self._balls: list[tuple[float, int]] = []  # radius, body
        self._arrows: list[int] = []  # bodies
        self._terrain: tuple[int, Sequence[float], Sequence[float]] | None = None  # body and pose
        try:
            if terrain is not None:
                self._add_terrain(terrain)
            for row, shapes in enumerate(links):
                self._links += [(row, self._add_shape(shape), shape.color_rgba) for shape in shapes]
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the engine."""
        self._client.close()

    def clear(self) -> None:
        """Show nothing."""
        hidden = [body for _, body, _ in self._links] + [body for _, body in self._balls]
        hidden += [] if self._terrain is None else [self._terrain[0]]
        for body in hidden:
            self._put(body, _OUT_OF_VIEW)
        self._remove(self._arrows)
        self._arrows = []

    def show_links(self, frames: Frames, colors: Sequence[Quadruple | None]) -> None:
        """Put the links where their frames are, NaN hides one; None is a link's own colour."""
        for row, body, own_color in self._links:
            origin, turn_xyzw = frames[0][row], frames[1][row]
            if np.isnan(origin).any():
                self._put(body, _OUT_OF_VIEW)
            else:
                self._put(body, origin, turn_xyzw)
            red, green, blue, _ = colors[row] or own_color
            self._paint(body, -1, (red, green, blue, 1.0))  # the engine draws nothing transparent

    def show_terrain(self) -> None:
        """Show the terrain, if there is one."""
        if self._terrain is not None:
            self._put(*self._terrain)

    def show_balls(self, balls: FloatArray) -> None:
        """Show these balls, of which centres and radii (m, 4) are given in m, and no others."""
        radii = balls[:, 3].tolist()
        if [radius for radius, _ in self._balls] != radii:
            self._remove(body for _, body in self._balls)
            spheres = [Shape(ShapeType.SPHERE, (r,), color_rgba=_BALL_COLOR) for r in radii]
            self._balls = list(zip(radii, map(self._add_shape, spheres), strict=True))
        for (_, body), ball in zip(self._balls, balls, strict=True):
            self._put(body, ball[:3])

    def show_arrows(self, arrows: Iterable[FloatArray], radius: float) -> None:
        """Show these arrows, too, none of length zero: tail and tip (2, 3); shafts' radius; m."""
        for tail, tip in arrows:
            length = float(np.linalg.norm(tip - tail))
            body = self._add_body(_ARROW_COLOR, **_triangles(arrow_surface(length, radius)))
            self._put(body, tail, _turn_from_z((tip - tail) / length))
            self._arrows.append(body)

    def draw(self, view: CameraPose, size: Size, box: PixelRegion) -> Drawing:
        """What is seen in a part of a view's picture of a size; the part is not empty."""
        near, far = _NEAR_PLANE * view.distance, _FAR_PLANE * view.distance
        width, height = size
        step = view.pixel(height) * near  # a pixel on the near plane
        columns, rows = box.right - box.left, box.bottom - box.top
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
        # The inverse of what graphics cards store.
        depth: Samples = far * near / (far - (far - near) * stored)
        depth[seen < 0] = np.inf
        casting = [body for _, body, _ in self._links] + [body for _, body in self._balls]
        return Drawing(color, depth, np.isin(seen, casting))

    def _add_terrain(self, terrain: UrdfOptions) -> None:
        body = load_urdf(self._client, terrain)
        for link in range(-1, pybullet.getNumJoints(body, physicsClientId=self._client)):
            self._paint(body, link, _TERRAIN_COLOR)
        pose = pybullet.getBasePositionAndOrientation(body, physicsClientId=self._client)
        self._terrain = (body, *pose)

    def _add_shape(self, shape: Shape) -> int:
        """A shape as a body at the origin."""
        measures: dict[str, object]
        if shape.type is ShapeType.BOX:
            measures = {"halfExtents": [0.5 * edge for edge in shape.size]}
        elif shape.type is ShapeType.MESH:
            return self._add_mesh(shape)
        else:
            measures = _triangles(round_surface(shape))
        return self._add_drawn(shape, measures)

    def _add_mesh(self, shape: Shape) -> int:
        with TemporaryDirectory() as directory:
            file = file_for_engine(Path(shape.mesh), Path(directory), "mesh")
            return self._add_drawn(shape, {"fileName": str(file), "meshScale": shape.size})

    def _add_drawn(self, shape: Shape, measures: dict[str, object]) -> int:
        measures["visualFramePosition"] = shape.pose.position
        measures["visualFrameOrientation"] = shape.pose.orientation_xyzw
        try:
            return self._add_body(shape.color_rgba, **measures)
        except pybullet.error as error:
            raise CharacterError(f"cannot draw {shape.mesh or f'a {shape.type.value}'}") from error

    def _add_body(self, color: Quadruple, **measures: object) -> int:
        kind = pybullet.GEOM_BOX if "halfExtents" in measures else pybullet.GEOM_MESH
        with captured_output(), c_numbers():  # the engine reads a mesh's file with the body
            seen = pybullet.createVisualShape(
                kind, rgbaColor=color, **measures, physicsClientId=self._client
            )
            return int(pybullet.createMultiBody(0.0, -1, seen, physicsClientId=self._client))

    def _put(
        self,
        body: int,
        origin: FloatArray | Sequence[float],
        turn_xyzw: FloatArray | Sequence[float] = rotations.IDENTITY_XYZW,
    ) -> None:
        pybullet.resetBasePositionAndOrientation(
            body, origin, turn_xyzw, physicsClientId=self._client
        )

    def _paint(self, body: int, link: int, color: Quadruple) -> None:
        pybullet.changeVisualShape(body, link, rgbaColor=color, physicsClientId=self._client)

    def _remove(self, bodies: Iterable[int]) -> None:
        for body in bodies:
            pybullet.removeBody(body, physicsClientId=self._client)


def _triangles(surface: Surface) -> dict[str, object]:
    """A surface as the engine takes it."""
    return {
        "vertices": surface.vertices.tolist(),
        "normals": surface.normals.tolist(),
        "indices": surface.triangles.ravel().tolist(),
        "uvs": [(0.0, 0.0)] * len(surface.vertices),
    }


def _turn_from_z(direction: FloatArray) -> FloatArray:
    """The shortest turn xyzw (4,) that leads z to a unit vector (3,)."""
    x, y, z = direction.tolist()
    if z < -1.0 + 1e-9:
        return np.array((1.0, 0.0, 0.0, 0.0))
    return rotations.normalised(np.array((-y, x, 0.0, 1.0 + z)))
