"""Pictures of characters in given states. No window, no GPU, no physics."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from actuated_characters.render.engine.camera_pose import (
    CameraPose,
    PixelRegion,
    Size,
    Spheres,
)
from actuated_characters.render.engine.compositor import Compositor, Picture
from actuated_characters.render.engine.outlines import outline
from actuated_characters.render.engine.posed_characters import Frames, LinkForce, PosedCharacters
from actuated_characters.render.engine.render_scene import RenderScene
from actuated_characters.render.engine.skin_surfaces import SkinSurfaces
from actuated_characters.render.engine.surfaces import HEAD_WIDTH
from actuated_characters.render.skin.choosing import colors_of, skin_of
from actuated_characters.render.skin.given import GivenSkin
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.model import Character, Shape, UrdfOptions, Vector
from msgs_config.geometry import fixed_order

__all__ = ["FrameSpec", "Picture", "Renderer"]

_DEFAULT_VIEW = CameraPose()

_MOST_DRAWN = 2**23  # samples of a picture; each takes some 40 bytes, and more while it is drawn
_GHOST_COLOR, _GHOST_OPACITY = (0.25, 0.85, 0.45, 1.0), 0.45
_OUTLINE_COLOR = np.array((20.0, 150.0, 70.0), dtype=np.float32)
_MARK_COLOR = (0.55, 0.15, 0.75, 1.0)
_ARROW_RADIUS, _HIDDEN_ARROW_OPACITY = 0.005, 0.55  # share of the view's distance, opacity


@dataclass(frozen=True)
class FrameSpec:
    """What one picture shows, of characters of n degrees of freedom and l links in all."""

    position: FloatArray  # (n,), message form
    view: CameraPose = _DEFAULT_VIEW  # the camera's
    ghost: FloatArray | None = None  # (n,): transparent copies; NaN for a character without one
    ghost_offset: Vector = (0.0, 0.0, 0.0)  # m, world: how far from its place a ghost is drawn
    forces: Sequence[LinkForce] = ()
    arrow_length: float = 1.0  # m, length of an arrow whose `LinkForce.arrow` has length one
    touching: BoolArray | None = None  # (l,): the links that are marked by a colour
    balls: Sequence[Shape] = ()  # what was thrown, with poses in the world
    caption: str = ""  # text that `draw` adds


class Renderer:
    """Takes pictures of characters; of their references, too, as transparent ghosts.

    Of several characters a position (n,) is theirs one after the other. The ghosts are drawn alone
    and then blended in.
    """

    def __init__(
        self,
        character: Character | Sequence[Character],
        *,
        ground: bool = True,
        terrain: UrdfOptions | None = None,
        samples: int = 2,
        skinned: bool = False,
        skin: GivenSkin | None = None,
        color_numbers: Sequence[int] | None = None,
    ) -> None:
        """Make the surfaces of all that may be seen.

        Args:
            character: The character, or several.
            ground: Draw the plane z = 0 as a chequerboard; not if a fixed base hangs below it.
            terrain: What else stays there.
            samples: Drawn along each edge of a pixel, for smooth edges; one where a picture is so
                large that more would take gigabytes.
            skinned: Draw a smooth skin in place of the shapes that it is made from, where a
                character has a floating base and none of its shapes is a mesh; and ghosts that
                are where they really are as outlines, not transparent.
            skin: With `skinned`, a mesh from a file as the skin of every character.
            color_numbers: Which colours the skin of each character has (`skin_colors`); by default
                each has others.

        Raises:
            CharacterError: a file of a character or of the terrain cannot be used.
            SkinError: `skin` does not fit a character.
        """
        characters = (character,) if isinstance(character, Character) else character
        self._samples = samples
        self.posed = PosedCharacters(characters)
        self._has_ground = ground and self.posed.stand_on_ground()
        self._has_terrain = terrain is not None
        self._skinned = skinned
        self._skins = self._make_skins(characters, skin, color_numbers) if skinned else []
        shapes = list(self.posed.shapes)
        for made in self._skins:
            shapes[made.links] = [() for _ in shapes[made.links]]
        self._scene = RenderScene(shapes, terrain, self._skins)

    def _make_skins(
        self,
        characters: Sequence[Character],
        given: GivenSkin | None,
        color_numbers: Sequence[int] | None,
    ) -> list[SkinSurfaces]:
        """The skins of those characters that have one."""
        skins, first = [], 0
        colored = range(len(characters)) if color_numbers is None else color_numbers
        for number, (character, color) in enumerate(zip(characters, colored, strict=True)):
            links = slice(first, first + len(character.links))
            first = links.stop
            skin = skin_of(character, self.posed.shapes_of_characters[number], given)
            if skin is not None:
                skins.append(SkinSurfaces(skin, colors_of(skin, character, color), links))
        return skins

    def picture(self, frame: FrameSpec, size: Size) -> Picture:
        """A picture (h, w, 3) of a width and a height in pixels."""
        view, (width, height) = frame.view, size
        samples = self._samples if width * height * self._samples**2 <= _MOST_DRAWN else 1
        layers = Compositor(view, size, samples=samples, has_ground=self._has_ground)
        frames = self.posed.frames(frame.position)
        self._draw_bodies(layers, frame, frames, view, size)
        if frame.ghost is not None:
            origins, turns_xyzw = self.posed.frames(frame.ghost)
            ghosts = (origins + frame.ghost_offset, turns_xyzw)
            self._scene.clear()
            self._scene.show_links(ghosts, [_GHOST_COLOR] * len(origins))
            box = view.box(self._spheres(ghosts), size)
            if self._skinned and not any(frame.ghost_offset):
                layers.draw_outline(self._scene, box, _OUTLINE_COLOR)
            else:
                layers.draw_over(self._scene, box, _GHOST_OPACITY)
        if frame.forces:
            arrows = [self.posed.arrow(each, frames, frame.arrow_length) for each in frame.forces]
            radius = _ARROW_RADIUS * view.distance
            self._scene.clear()
            self._scene.show_arrows(arrows, radius)
            ends = np.concatenate(arrows)
            box = view.box(Spheres(ends, np.full(len(ends), HEAD_WIDTH * radius)), size)
            layers.draw_over(self._scene, box, 1.0, _HIDDEN_ARROW_OPACITY)
        return layers.picture()

    def _spheres(self, frames: Frames) -> Spheres:
        """Spheres around all that is drawn of characters."""
        bodies = [self.posed.spheres(frames)]
        return Spheres.joined([*bodies, *(each.spheres(frames) for each in self._skins)])

    def _draw_bodies(
        self, layers: Compositor, frame: FrameSpec, frames: Frames, view: CameraPose, size: Size
    ) -> None:
        """Draw what is solid, and its shadow."""
        touching = np.zeros(len(frames[0]), np.bool_) if frame.touching is None else frame.touching
        self._scene.clear()
        self._scene.show_links(frames, [_MARK_COLOR if touches else None for touches in touching])
        self._scene.show_terrain()
        bodies = self._spheres(frames)
        self._scene.show_balls(frame.balls)
        if self._has_ground:
            near = [ball for ball in frame.balls if _is_near(ball, view)]
            layers.darken_ground(self._scene, _with_balls(bodies, near))
        width, height = size
        everywhere = PixelRegion(0, height, 0, width)
        box = everywhere if self._has_terrain else view.box(_with_balls(bodies, frame.balls), size)
        layers.draw_solid(self._scene, box)


def _is_near(ball: Shape, view: CameraPose) -> bool:
    away = np.array(ball.pose.position) - view.target
    return bool(fixed_order.norm(away) < view.distance)


def _with_balls(bodies: Spheres, balls: Sequence[Shape]) -> Spheres:
    return Spheres.joined([bodies, *map(outline, balls)])
