"""The scene in the browser: ground, light, camera, balls, and a frame that follows the characters.

The camera belongs to each client, and no server can move it without a jerk. So it is the world that
moves: everything is below one node, which moves back by as far as the characters have gone.
"""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from actuated_characters.render.engine import ground
from actuated_characters.viewer.drawing.drawn_character import DrawnCharacter
from actuated_characters.viewer.drawing.framing import (
    EYE,
    FIELD_OF_VIEW,
    LOOK_AT,
    frame_points,
)
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Shape, ShapeType
from msgs_config.geometry import rotations
from msgs_config.messages.projectiles import BallStates
from msgs_config.messages.throw import ProjectileThrow

WORLD = "/world"

_BALL = (225, 95, 40)
_UNKNOWN = Shape(ShapeType.SPHERE, (0.1,))  # of what was thrown before it was seen
_CATCH_UP = 4.0  # 1/s: how soon the world follows the characters
_JUMP = 3.0  # m: a distance that is not caught up with but jumped
BACKGROUND, LIGHT_TILE, DARK_TILE = (
    tuple(np.round(each).astype(int).tolist()) for each in (ground.BACKGROUND, *ground.COLORS)
)
_ROOM = 5.0  # m around the characters, in which a terrain is seen at first
_TILES = 56  # along an edge of the ground
_PIXELS_A_TILE = 36
_ABOVE_TILES = 0.002  # of a tile's edge: where the shadow is drawn
_SHADOW = 0.3
# In the camera's distance at first: where the background's colour begins, and is all.
_HAZE = (2.0, 4.2)
_HAZE_COLOR = (216, 226, 244)  # becomes the background's by a page's tone mapping
_SKY_LIGHT: dict[str, Any] = {
    "sky_color": (255, 252, 246),
    "ground_color": (120, 124, 134),
    "intensity": 2.5,
    "wxyz": (0.5**0.5, 0.5**0.5, 0.0, 0.0),  # its own y, from where it shines, up
}


class BrowserScene:
    """What all clients see."""

    def __init__(self, server: viser.ViserServer) -> None:
        scene = server.scene
        self.api = scene
        self.follows = True
        self.offset: FloatArray = np.zeros(3)
        """What is to be added to a place in the browser, m, to have it in the world."""
        scene.set_up_direction("+z")
        scene.set_background_image(np.full((2, 2, 3), BACKGROUND, dtype=np.uint8))
        scene.configure_default_lights(enabled=True, cast_shadow=True)
        # without the picture of a hall that a page is lit by else, which tints what is plain
        scene.configure_environment_map(None)
        scene.add_light_hemisphere("/sky", **_SKY_LIGHT)
        self._server = server
        server.initial_camera.fov = FIELD_OF_VIEW
        server.initial_camera.position = EYE
        server.initial_camera.look_at = LOOK_AT
        self._world = scene.add_frame(WORLD, show_axes=False)
        self._ground = scene.add_frame(f"{WORLD}/ground", show_axes=False)
        tiles: Any = scene.add_image(
            f"{WORLD}/ground/tiles", _chequerboard(), _TILES, _TILES, format="png",
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        # An image takes no shadow; of this plane nothing else is seen.
        shadow: Any = scene.add_grid(
            f"{WORLD}/ground/shadow", _TILES, _TILES, cell_thickness=0.0, section_thickness=0.0,
            plane_opacity=0.0, shadow_opacity=_SHADOW,
        )  # fmt: skip
        self._tiles, self._shadow = tiles, shadow
        self._fit_ground(float(np.linalg.norm(np.subtract(EYE, LOOK_AT))))

    def _fit_ground(self, distance: float) -> None:
        """Have tiles and haze suit a camera that is so far away, m."""
        self._tile = ground.tile_length(distance)
        self._tiles.scale = self._shadow.scale = self._tile
        self._shadow.position = (0.0, 0.0, _ABOVE_TILES * self._tile)
        near, far = (share * distance for share in _HAZE)
        self.api.configure_fog(near, far, color=_HAZE_COLOR)

    def frame_characters(
        self,
        characters: Sequence[DrawnCharacter],
        others: Sequence[FloatArray] = (),
    ) -> None:
        """Have all pages see the characters where they are now, as large as fits.

        So are other points (k, 3), m, world, as far as they are near.
        """
        if not characters:
            return
        boxes = np.concatenate([_corners(*each.bounds()) for each in characters])
        around = boxes.min(axis=0) - _ROOM, boxes.max(axis=0) + _ROOM
        corners = np.concatenate([boxes, *(np.clip(each, *around) for each in others)])
        found, followed = frame_points(corners), self._followed(characters)
        self._fit_ground(found.distance)
        offset = self.offset if followed is None else followed
        eye, look_at = found.eye - offset, found.look_at - offset
        initial = self._server.initial_camera
        initial.position, initial.look_at = eye, look_at
        for client in self._server.get_clients().values():
            client.camera.position, client.camera.look_at = eye, look_at

    def _followed(self, characters: Sequence[DrawnCharacter]) -> FloatArray | None:
        """The point (3,) of the ground that is followed, m, world; None if none is."""
        moving = [each for each in characters if each.character.layout.has_floating_base]
        if not (self.follows and moving) or len(moving) != len(characters):
            return None
        return np.append(np.mean([each.root[:2] for each in moving], axis=0), 0.0)

    def follow_characters(self, characters: Sequence[DrawnCharacter], seconds: float) -> None:
        """Bring the middle of the characters nearer to where the cameras look."""
        middle = self._followed(characters)
        if middle is None:
            return
        way = middle - self.offset
        share = 1.0 if np.linalg.norm(way) > _JUMP else 1.0 - np.exp(-_CATCH_UP * seconds)
        self.offset = self.offset + share * way
        self._world.position = -self.offset
        # the ground moves along by pairs of tiles, or the characters would walk off it
        pair = 2.0 * self._tile
        self._ground.position = (*(pair * np.round(self.offset[:2] / pair)), 0.0)


def _corners(low: FloatArray, high: FloatArray) -> FloatArray:
    """The corners (8, 3) of a box between two of them (3,)."""
    corners: FloatArray = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1)
    return corners.reshape(-1, 3)


def _chequerboard() -> NDArray[np.uint8]:
    """The ground's picture (h, w, 3)."""
    number = np.arange(_TILES * _PIXELS_A_TILE) // _PIXELS_A_TILE
    is_dark = (number[:, np.newaxis] + number) % 2
    colors = np.array((LIGHT_TILE, DARK_TILE), dtype=np.uint8)
    picture: NDArray[np.uint8] = colors[is_dark]
    return picture


class DrawnBalls:
    """The balls and boxes of one simulator."""

    def __init__(self, scene: viser.SceneApi, name: str) -> None:
        self._scene, self._name = scene, name
        self._balls: dict[str, viser.IcosphereHandle | viser.BoxHandle] = {}
        self._released: deque[Shape] = deque(maxlen=100)  # of those not yet seen

    def draw(self, released: Sequence[ProjectileThrow], balls: BallStates | None) -> None:
        """Move the balls to where they are now."""
        self._released += [throw.shape for throw in released]
        if balls is not None:
            self.place(balls, lambda _: self._next_shape())

    def _next_shape(self) -> Shape:
        return self._released.popleft() if self._released else _UNKNOWN

    def place(self, balls: BallStates, shape_of: Callable[[str], Shape]) -> None:
        """Move the balls to where they are; new ones have the shape of their name."""
        for name in set(self._balls) - set(balls.names):
            self._balls.pop(name).remove()
        for name, motion in zip(balls.names, balls.motion, strict=True):
            if name not in self._balls:
                self._balls[name] = self._add(f"{self._name}/{name}", shape_of(name))
            ball = self._balls[name]
            ball.position = motion[:3]
            ball.wxyz = rotations.wxyz_from_xyzw(motion[3:7])

    def _add(self, name: str, shape: Shape) -> viser.IcosphereHandle | viser.BoxHandle:
        if shape.type is ShapeType.BOX:
            x, y, z = shape.size
            return self._scene.add_box(name, dimensions=(x, y, z), color=_BALL)
        return self._scene.add_icosphere(name, shape.size[0], color=_BALL)

    def remove(self) -> None:
        """Remove all: a new episode has none."""
        for ball in self._balls.values():
            ball.remove()
        self._balls.clear()
        self._released.clear()
