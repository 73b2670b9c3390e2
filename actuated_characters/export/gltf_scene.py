"""A scene of characters and balls that move, as glTF: each link is a node below its parent."""

from dataclasses import replace

import numpy as np

from actuated_characters.export.gltf_ground import add_ground
from actuated_characters.export.gltf_skin import SkinnedMeshes
from actuated_characters.render.drawn_shapes import drawn_shapes
from actuated_characters.render.engine.shape_meshes import surface_of
from actuated_characters.render.skin.choosing import colors_of, skin_of
from actuated_characters.render.skin.given import GivenSkin
from character_motion.bvh.kinematics import continuous
from character_motion.export.trajectories import (
    BallTrajectory,
    CharacterTrajectory,
    LinkPoses,
    Progress,
    Trajectories,
)
from character_motion.export.upright import UPRIGHT_XYZW
from character_motion.gltf.document import GltfDocument
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Quadruple, Shape
from msgs_config.geometry import rotations
from msgs_config.geometry.surface import Surface

_BALL_RGBA: Quadruple = (0.88, 0.37, 0.16, 1.0)
_GENERATOR = "actuated_characters"
_ROTATING_JOINTS = (JointType.REVOLUTE, JointType.SPHERICAL, JointType.FLOATING)
_TRANSLATING_JOINTS = (JointType.PRISMATIC, JointType.FLOATING)


def make_document(
    motion: Trajectories,
    times: FloatArray,
    *,
    ground: bool = False,
    skinned: bool = True,
    skin: GivenSkin | None = None,
    progress: Progress | None = None,
) -> GltfDocument:
    """The scene at some times (f,) in s, of which the first one becomes 0.

    Args:
        motion: What moves.
        times: In s, rising.
        ground: Whether the plane z = 0 is there, too.
        skinned: Whether a character of plain shapes is seen as one smooth body, as in pictures.
        skin: A mesh from a file as that body.
        progress: Is told the frames so far, of each character one after the other.

    Raises:
        CharacterError: a mesh cannot be used; names its file.
        SkinError: `skin` does not fit a character.
    """
    builder = _SceneBuilder(times, skinned=skinned, skin=skin)
    if ground:
        builder.add_ground()
    for number, trajectory in enumerate(motion.characters):
        before = number * len(times)
        told = None if progress is None else (lambda done, b=before: progress(b + done))
        poses = motion.link_poses(trajectory, times, told)
        builder.add_character(trajectory, poses, several=len(motion.characters) > 1)
    for ball in motion.sampled_balls(times):
        builder.add_ball(ball)
    return builder.document


class _SceneBuilder:
    """Adds what is to be seen to a document, below one node that turns z up to y up."""

    def __init__(self, times: FloatArray, *, skinned: bool, skin: GivenSkin | None) -> None:
        self.document = GltfDocument(_GENERATOR)
        self._skins = SkinnedMeshes(self.document) if skinned else None
        self._given = skin
        self._seconds = times - times[0]
        self._times = self.document.add_times(self._seconds)
        self._world = self.document.add_node("world", rotation_xyzw=UPRIGHT_XYZW)
        self._meshes: dict[tuple[Shape, ...], int] = {}

    def add_ground(self) -> None:
        """Add the plane z = 0."""
        self.document.add_node("ground", self._world, add_ground(self.document, "ground"))

    def add_character(
        self, trajectory: CharacterTrajectory, poses: LinkPoses, *, several: bool
    ) -> None:
        """Add its links; those of several characters have the character's name before theirs."""
        character = trajectory.character
        links, shapes_of_links = character.links, drawn_shapes(character)
        skin = skin_of(character, shapes_of_links, self._given) if self._skins else None
        root, prefix = self._world, ""
        if several:
            root = self.document.add_node(trajectory.name, self._world)
            prefix = f"{trajectory.name}_"
        nodes = [root]
        for row, shapes in enumerate(shapes_of_links):
            link, name = links[row], prefix + links[row].name
            origins, turns = _in_parent(poses, row, link.parent)
            mesh = self._mesh(name, shapes) if shapes and skin is None else None
            node = self.document.add_node(name, nodes[link.parent + 1], mesh, origins[0], turns[0])
            nodes.append(node)
            if link.joint.type in _TRANSLATING_JOINTS:
                self.document.animate(node, "translation", self._times, origins)
            if link.joint.type in _ROTATING_JOINTS:
                self.document.animate(node, "rotation", self._times, turns)
        if self._skins and skin is not None:
            colors = colors_of(skin, character, trajectory.color_number)
            self._skins.add(f"{prefix}skin", character, skin, colors, nodes[1:])

    def add_ball(self, ball: BallTrajectory) -> None:
        """Add a ball, of no size while it is not there, which is how glTF hides a node."""
        there = np.isfinite(ball.centres[:, 0])
        if not there.any():
            return
        rows = np.maximum.accumulate(np.where(there, np.arange(len(there)), np.argmax(there)))
        centres, turns = ball.centres[rows], continuous(ball.turns_xyzw[rows])
        sizes = np.repeat(there.astype(float)[:, np.newaxis], 3, axis=1)
        shape = replace(ball.shape, color_rgba=_BALL_RGBA)
        node = self.document.add_node(
            ball.name,
            self._world,
            self._mesh(ball.name, (shape,)),
            centres[0],
            turns[0],
            sizes[0],
        )
        self.document.animate(node, "translation", self._times, centres)
        self.document.animate(node, "rotation", self._times, turns)
        if not there.all():
            changes = np.flatnonzero(np.diff(there, prepend=not there[0]))
            appears = self.document.add_times(self._seconds[changes])
            self.document.animate(node, "scale", appears, sizes[changes], steps=True)

    def _mesh(self, name: str, shapes: tuple[Shape, ...]) -> int:
        if shapes not in self._meshes:
            surfaces = [(_placed(shape), shape.color_rgba) for shape in shapes]
            self._meshes[shapes] = self.document.add_mesh(name, surfaces)
        return self._meshes[shapes]


def _placed(shape: Shape) -> Surface:
    """The surface of a shape in its link's frame."""
    surface, turn = surface_of(shape), np.array(shape.pose.orientation_xyzw)
    vertices = rotations.rotate(turn, surface.vertices) + np.array(shape.pose.position)
    return Surface(vertices, rotations.rotate(turn, surface.normals), surface.triangles)


def _in_parent(poses: LinkPoses, row: int, parent: int) -> tuple[FloatArray, FloatArray]:
    """Origins (f, 3) in m and turns (f, 4) of a link in its parent's frame; -1 is the world."""
    origins, turns = poses.origins[:, row], poses.turns_xyzw[:, row]
    if parent >= 0:
        back = rotations.conjugate(poses.turns_xyzw[:, parent])
        origins = rotations.rotate(back, origins - poses.origins[:, parent])
        turns = rotations.multiply(back, turns)
    return origins, continuous(rotations.normalised(turns))
