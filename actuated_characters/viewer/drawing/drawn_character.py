"""One character in the browser: its links, its reference, and what acts on it."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import viser

from actuated_characters.render.drawn_shapes import drawn_shapes
from actuated_characters.render.engine.camera_pose import Spheres
from actuated_characters.render.engine.outlines import outline
from actuated_characters.render.engine.shape_meshes import surface_of
from actuated_characters.render.skin.choosing import skin_of
from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.render.skin.palette import skin_colors
from actuated_characters.render.skin.skin import Skin
from actuated_characters.viewer.drawing.character_marks import CharacterMarks, LinkPoses
from actuated_characters.viewer.drawing.colors import GHOST, STRAIN
from actuated_characters.viewer.drawing.drawn_skin import DrawnSkin, GhostSkin
from actuated_characters.viewer.drawing.sample import CharacterSample
from actuated_characters.viewer.drawing.scene_poses import set_poses
from actuated_characters.viewer.parameters import SHOWN
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character, Shape
from msgs_config.geometry import rotations

_LEVELS = 12  # colours of a link, few so that they seldom change from frame to frame
_GHOST_OPACITY = 0.3  # where it has no skin, which is seen as an outline
LinkMesh = viser.MeshHandle | viser.MeshSkinnedHandle

Bind = Callable[[LinkMesh, int], None]
"""Makes a shape of a link, by its number, one that can be touched."""


def bind_nothing(mesh: LinkMesh, row: int) -> None:
    """Leave a shape as one that cannot be touched."""


class DrawnCharacter:
    """The nodes of one character below a name in the scene."""

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        character: Character,
        effort_limits: FloatArray,
        bind: Bind = bind_nothing,
        number: int = 0,
        skin: GivenSkin | None = None,
    ) -> None:
        """Add all nodes; limits (b,) are those of the character's physical vectors.

        Its `number` among several characters says which colours its skin has, unless `skin`, a
        mesh from a file, is to be that.

        Raises:
            CharacterError: a mesh cannot be used.
            SkinError: `skin` does not fit.
        """
        self.character, self.name, self.effort_limits = character, name, effort_limits
        self._scene, self._model = scene, DynamicsModel(character)
        self._all = scene.add_frame(name, show_axes=False, visible=False)  # until it is drawn
        shapes = drawn_shapes(character)
        outlines = [_around(link.collision_shapes) for link in character.links]
        self._around = [_around(own) for own in shapes]
        self._centres = np.array([link.inertial_pose.position for link in character.links])
        self._frames = [
            scene.add_frame(f"{name}/links/{row}", show_axes=False) for row in range(len(shapes))
        ]
        self._ghost_frames = [
            scene.add_frame(f"{name}/ghost/{row}", show_axes=False, visible=False)
            for row in range(len(shapes))
        ]
        self._meshes: list[list[LinkMesh]] = [
            [self._add(f"{name}/links/{row}/{k}", shape) for k, shape in enumerate(own)]
            for row, own in enumerate(shapes)
        ]
        self._shape_counts = [len(own) for own in shapes]
        self._colors = [[np.array(each.color_rgba[:3]) * 255.0 for each in own] for own in shapes]
        self._painted: FloatArray | None = None  # (3,) one colour in place of these, 0 to 255
        self._skin: DrawnSkin | None = None
        self.has_sides = False
        """Whether the right side of its skin has a colour of its own."""
        self._shows_skin = False
        self._ghost_skin: GhostSkin | None = None
        made = skin_of(character, shapes, skin)
        if made is not None:
            self._add_skin(made, number)
        else:
            for row, own in enumerate(shapes):
                for k, shape in enumerate(own):
                    self._add(f"{name}/ghost/{row}/{k}", shape, ghost=True)
        for row, meshes in enumerate(self._meshes):
            for mesh in meshes:
                bind(mesh, row)
        self._levels = [0] * len(shapes)
        self._vectors = _last_vectors(character)
        self.marks = CharacterMarks(scene, f"{name}/marks", character, outlines)
        self.origins: FloatArray = np.zeros((len(shapes), 3))
        self.turns_xyzw: FloatArray = np.tile((0.0, 0.0, 0.0, 1.0), (len(shapes), 1))
        self.shows: Mapping[str, bool] = dict.fromkeys(SHOWN, True)
        self.has_been_drawn = False

    def _add_skin(self, skin: Skin, number: int) -> None:
        """Add a skin around the shapes, which are hidden by it or instead of it."""
        colors = skin.link_colors()
        if colors is None:
            colors = np.array(skin_colors(self.character, number))[:, :3]
            self.has_sides = len(np.unique(colors, axis=0)) > 1
        links = f"{self.name}/links"
        own = list(255.0 * colors)
        rgb = [_rgb(color) for color in own]
        self._skin = DrawnSkin(self._scene, links, self.character, skin, rgb)
        self._ghost_skin = GhostSkin(self._scene, f"{self.name}/ghost_skin", skin, GHOST)
        for row, color in enumerate(own):
            if (mesh := self._skin.handle(row)) is not None:
                self._meshes[row].append(mesh)
                self._colors[row].append(color)
        self._show_skin(shown=True)

    def _show_skin(self, *, shown: bool) -> None:
        """Show the skin, if there is one, or the shapes."""
        if self._skin is None or shown == self._shows_skin:
            return
        self._shows_skin = shown
        for count, meshes in zip(self._shape_counts, self._meshes, strict=True):
            for number, mesh in enumerate(meshes):
                mesh.visible = shown == (number >= count)

    def _add(self, name: str, shape: Shape, *, ghost: bool = False) -> viser.MeshHandle:
        vertices, _, faces = surface_of(shape)
        red, green, blue, alpha = shape.color_rgba
        color = GHOST if ghost else _rgb(255.0 * np.array((red, green, blue)))
        opacity = _GHOST_OPACITY if ghost else (None if alpha >= 1.0 else max(alpha, 0.1))
        return self._scene.add_mesh_simple(
            name,
            vertices,
            faces,
            color=color,
            opacity=opacity,
            cast_shadow=not ghost,
            receive_shadow=False,
            wxyz=_wxyz(np.array(shape.pose.orientation_xyzw)),
            position=shape.pose.position,
        )

    @property
    def root(self) -> FloatArray:
        """Where the base link is (3,), m, world."""
        root: FloatArray = self.origins[0]
        return root

    @property
    def _links(self) -> LinkPoses:
        return LinkPoses(self.origins, self.turns_xyzw)

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """The least and the greatest corner (3,) of a box around all its shapes, m, world.

        Of a fixed base the box has room for the rest pose, too, and for where it stands.
        """
        if self.character.layout.has_floating_base:
            return self._spheres(self.origins, self.turns_xyzw).bounds(np.eye(3))
        place = self.character.placement
        at_rest = self._poses(np.array(self.character.rest_position))
        foot = Spheres(np.array([[place.x, place.y, place.z]]), np.zeros(1))
        around = self._spheres(self.origins, self.turns_xyzw), self._spheres(*at_rest), foot
        return Spheres.joined(around).bounds(np.eye(3))

    def _spheres(self, origins: FloatArray, turns_xyzw: FloatArray) -> Spheres:
        """Spheres around the shapes of links at these poses (l, 3), (l, 4), world."""
        placed = [
            Spheres(origins[row] + rotations.rotate(turns_xyzw[row], local), radii)
            for row, (local, radii) in enumerate(self._around)
        ]
        return Spheres.joined(placed)

    def remove(self) -> None:
        """Remove all nodes."""
        self._scene.remove_by_name(self.name)

    def draw(self, sample: CharacterSample) -> None:
        """Move everything to where it is now."""
        if sample.state is None:
            return
        if not self.has_been_drawn:
            self._all.visible = self.has_been_drawn = True
        self._draw_ghost(sample.reference if self.shows["reference"] else None)
        self.origins, self.turns_xyzw = self._poses(sample.state.position)
        set_poses(self._frames, self.origins, self.turns_xyzw)
        if self._skin is not None:
            self._show_skin(shown=self.shows["skin"])
            self._skin.bend(self.origins, self.turns_xyzw)
        self._color(sample.state.effort)
        self.marks.draw(sample, self._links, self._model, self.shows)

    def paint(self, color: tuple[int, int, int] | None) -> None:
        """Give all links one colour, 0 to 255, or each its own again."""
        self._painted = None if color is None else np.array(color, dtype=float)
        self._levels = [-1] * len(self._levels)  # none is right any more

    @property
    def is_shown(self) -> bool:
        """Whether it is seen at all."""
        return bool(self._all.visible)

    def show(self, *, shown: bool) -> None:
        """Have all of it be seen, or nothing."""
        if self.is_shown != shown:
            self._all.visible = shown

    def _draw_ghost(self, position: FloatArray | None) -> None:
        """Draw the reference at a position (n,); None: there is none."""
        if position is not None:
            poses = self._poses(position)
            if self._ghost_skin is not None:
                self._ghost_skin.bend(*poses)
            else:
                set_poses(self._ghost_frames, *poses)
        for node in self._ghost_frames if self._ghost_skin is None else [self._ghost_skin.handle]:
            node.visible = position is not None

    def _poses(self, position: FloatArray) -> tuple[FloatArray, FloatArray]:
        self._model.update(position, np.zeros_like(position))
        return self._model.link_poses()

    def _color(self, effort: FloatArray | None) -> None:
        """Colour each link by the share of its joint's limit that the effort has."""
        limits = self.effort_limits
        shares = np.zeros(len(limits))
        if effort is not None and self.shows["torques"]:
            norms = self.character.layout.norms(effort)
            shares = np.divide(norms, limits, out=shares, where=limits > 0.0)
        for row, vector in enumerate(self._vectors):
            share = 0.0 if vector is None else min(float(shares[vector]), 1.0)
            level = round(_LEVELS * share)
            if level == self._levels[row]:
                continue
            self._levels[row] = level
            for mesh, own in zip(self._meshes[row], self._colors[row], strict=True):
                color = own if self._painted is None else self._painted
                mesh.color = _rgb(color + (np.array(STRAIN) - color) * (level / _LEVELS))

    def point(self, row: int, local: FloatArray) -> FloatArray:
        """A point (3,) of a link, m in its frame, in the world."""
        return self._links.point(row, local)

    def local(self, row: int, point: FloatArray) -> FloatArray:
        """A point (3,) of the world in a link's frame, m."""
        turn = rotations.conjugate(self.turns_xyzw[row])
        return rotations.rotate(turn, point - self.origins[row])

    def centre_of(self, row: int) -> FloatArray:
        """A link's centre of mass (3,), m, world."""
        return self.point(row, self._centres[row])


def _around(shapes: Sequence[Shape]) -> Spheres:
    return Spheres.joined([Spheres(np.empty((0, 3)), np.empty(0)), *map(outline, shapes)])


def _last_vectors(character: Character) -> list[int | None]:
    """Of each link the number of the physical vector of its joint; None where it is not driven."""
    numbers: dict[str, int] = {}
    count = 0
    for joint in character.layout.joints:
        numbers[joint.name] = count
        count += len(joint.vectors)
    return [
        None
        if link.joint.type in (JointType.FIXED, JointType.FLOATING)
        else numbers[link.joint.name]
        for link in character.links
    ]


def _rgb(color: FloatArray) -> tuple[int, int, int]:
    red, green, blue = (round(part) for part in np.clip(color, 0.0, 255.0).tolist())
    return red, green, blue


def _wxyz(turn_xyzw: FloatArray) -> Any:
    return rotations.wxyz_from_xyzw(turn_xyzw)
