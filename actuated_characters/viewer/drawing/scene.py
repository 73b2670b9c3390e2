"""The scene in the browser: ground, light, balls, and a frame that follows the characters.

The camera belongs to each client, and no server can move it without a jerk. So it is the world that
moves: everything is below one node, which moves back by as far as the characters have gone.
"""

from collections import deque
from collections.abc import Callable, Sequence

import numpy as np
import viser

from actuated_characters.viewer.drawing.drawn_character import DrawnCharacter
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations
from msgs_config.messages.projectiles import BallStates
from msgs_config.messages.throw import ProjectileThrow

WORLD = "/world"

_BALL, _UNKNOWN_RADIUS = (225, 95, 40), 0.1  # colour; m
_CATCH_UP = 4.0  # 1/s: how soon the world follows the characters
_JUMP = 3.0  # m: a distance that is not caught up with but jumped
BACKGROUND = (237, 242, 250)
EYE, LOOK_AT = (2.6, -2.6, 1.5), (0.0, 0.0, 0.8)
"""Of the camera at first, m, from the point on the ground below the middle of the characters."""


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
        server.initial_camera.position = EYE
        server.initial_camera.look_at = LOOK_AT
        self._world = scene.add_frame(WORLD, show_axes=False)
        self._ground = scene.add_grid(
            f"{WORLD}/ground",
            width=60.0,
            height=60.0,
            cell_size=0.5,
            section_size=1.0,
            cell_color=(205, 212, 222),
            section_color=(165, 175, 190),
            plane_color=(247, 249, 252),
            plane_opacity=1.0,
            fade_distance=25.0,
            shadow_opacity=0.25,
        )

    def follow_characters(self, characters: Sequence[DrawnCharacter], seconds: float) -> None:
        """Bring the middle of the characters nearer to where the cameras look."""
        moving = [each for each in characters if each.character.layout.has_floating_base]
        if not (self.follows and moving) or len(moving) != len(characters):
            return
        middle = np.append(np.mean([each.root[:2] for each in moving], axis=0), 0.0)
        way = middle - self.offset
        share = 1.0 if np.linalg.norm(way) > _JUMP else 1.0 - np.exp(-_CATCH_UP * seconds)
        self.offset = self.offset + share * way
        self._world.position = -self.offset
        # the grid moves along by whole sections, or the characters would walk off it
        self._ground.position = (*np.round(self.offset[:2]), 0.0)


class DrawnBalls:
    """The balls of one simulator."""

    def __init__(self, scene: viser.SceneApi, name: str) -> None:
        self._scene, self._name = scene, name
        self._balls: dict[str, viser.IcosphereHandle] = {}
        self._released: deque[float] = deque(maxlen=100)  # radii, m, of balls not yet seen

    def draw(self, released: Sequence[ProjectileThrow], balls: BallStates | None) -> None:
        """Move the balls to where they are now."""
        self._released += [throw.radius for throw in released]
        if balls is not None:
            self.place(balls, lambda _: self._next_radius())

    def _next_radius(self) -> float:
        return self._released.popleft() if self._released else _UNKNOWN_RADIUS

    def place(self, balls: BallStates, radius_of: Callable[[str], float]) -> None:
        """Move the balls to where they are; new ones have the radius of their name, m."""
        for name in set(self._balls) - set(balls.names):
            self._balls.pop(name).remove()
        for name, motion in zip(balls.names, balls.motion, strict=True):
            if name not in self._balls:
                self._balls[name] = self._scene.add_icosphere(
                    f"{self._name}/{name}", radius_of(name), color=_BALL
                )
            ball = self._balls[name]
            ball.position = motion[:3]
            ball.wxyz = rotations.wxyz_from_xyzw(motion[3:7])

    def remove(self) -> None:
        """Remove all: a new episode has none."""
        for ball in self._balls.values():
            ball.remove()
        self._balls.clear()
        self._released.clear()
