"""A skinned mesh as an artist's program would write it, made of a character's own skin."""

import json
import struct
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from actuated_characters.render.drawn_shapes import drawn_shapes
from actuated_characters.render.skin.choosing import skin_of
from actuated_characters.render.skin.skin import PosedSkin, Skin
from character_motion.gltf.document import GltfDocument
from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.geometry.surface import Surface
from tests.support.physics import character

MIXAMO = {
    "root": "mixamorig:Hips",
    "chest": "mixamorig:Spine1",
    "neck": "mixamorig:Neck",
} | {
    f"{side}_{link}": f"mixamorig:{side.title()}{joint}"
    for side in ("left", "right")
    for link, joint in (
        ("hip", "UpLeg"),
        ("knee", "Leg"),
        ("ankle", "Foot"),
        ("shoulder", "Arm"),
        ("elbow", "ForeArm"),
        ("wrist", "Hand"),
    )
}
"""Names of joints that tools of animation give, by the humanoid's links."""

_Y_UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
RED, BLUE = (0.8, 0.1, 0.1, 1.0), (0.1, 0.1, 0.8, 1.0)


@cache
def bound_skin() -> Skin:
    """The humanoid's own skin with its arms held out to the sides, as meshes are bound."""
    humanoid = character("humanoid")
    own = skin_of(humanoid, drawn_shapes(humanoid))
    assert own is not None
    origins, turns = arms_out()
    surface = PosedSkin(own).surface(origins, turns)
    return Skin(surface, own.owners, own.bones, own.weights, origins, turns)


def arms_out() -> tuple[FloatArray, FloatArray]:
    """The links' origins (l, 3), m, and turns (l, 4) then."""
    humanoid = character("humanoid")
    position = np.array(humanoid.rest_position)
    for side, angle in (("left", -1.3), ("right", 1.3)):
        entries = humanoid.layout.joint(f"{side}_shoulder").entries
        position[entries] = (-angle, 0.0, 0.0)  # about the URDF's x, which is ahead
    model = DynamicsModel(humanoid)
    model.update(position, np.zeros_like(position))
    return model.link_poses()


def two_parts() -> tuple[BoolArray, BoolArray]:
    """Which triangles (k,) are of the upper part of that mesh, and of the lower one."""
    surface = bound_skin().surface
    upper = surface.vertices[surface.triangles].mean(axis=1)[:, 2] > 0.9
    return upper, ~upper


def rows_in_file() -> IntArray:
    """The vertices as the file has them, those of the upper part first."""
    triangles = bound_skin().surface.triangles
    return np.concatenate([np.unique(triangles[which]) for which in two_parts()])


def skinned_glb(
    names: Mapping[str, str] = MIXAMO,
    scale: FloatArray | float = 1.0,
    edit: Callable[[dict[str, Any]], None] | None = None,
) -> bytes:
    """The humanoid with its arms out as a .glb file.

    Args:
        names: Of the joints by its links; a link without one has no joint. Their frames are all
            parallel to the world's, whatever the links' are.
        scale: Of a metre, in the file's unit, or one along each axis of the file (3,).
        edit: Changes the file's JSON.
    """
    humanoid, skin = character("humanoid"), bound_skin()
    document = GltfDocument("an artist's program")
    places = scale * (skin.origins @ _Y_UP.T)
    nodes = _add_joints(document, names, places)
    numbers = {row: number for number, row in enumerate(nodes)}
    binds = np.tile(np.eye(4), (len(nodes), 1, 1))
    binds[:, :3, 3] = -places[list(nodes)]
    surface = Surface(
        scale * (skin.surface.vertices @ _Y_UP.T),
        skin.surface.normals @ _Y_UP.T,
        skin.surface.triangles,
    )
    joints = np.array([numbers.get(row, 0) for row in range(len(humanoid.links))])[skin.bones]
    vertices = document.add_vertices(surface) | document.bind(joints, skin.weights)
    parts = [
        (vertices, surface.triangles[which], document.material(color))
        for which, color in zip(two_parts(), (RED, BLUE), strict=True)
    ]
    number = document.add_skin("skin", list(nodes.values()), document.add_matrices(binds))
    document.add_node("body", mesh=document.add_mesh_of("body", parts), skin=number)
    raw = document.to_glb()
    return raw if edit is None else edited(raw, edit)


def _add_joints(
    document: GltfDocument, names: Mapping[str, str], places: FloatArray
) -> dict[int, int]:
    """Add the joints at the places (l, 3) of links; the numbers of their nodes by links."""
    nodes: dict[int, int] = {}
    for row, link in enumerate(character("humanoid").links):
        if link.name in names:
            above = link.parent
            while above not in nodes and above >= 0:
                above = character("humanoid").links[above].parent
            way = places[row] - (places[above] if above >= 0 else 0.0)
            nodes[row] = document.add_node(
                names[link.name], nodes.get(above), translation=np.asarray(way)
            )
    return nodes


def edited(raw: bytes, edit: Callable[[dict[str, Any]], None]) -> bytes:
    """A .glb file with its JSON changed."""
    (size,) = struct.unpack_from("<I", raw, 12)
    content = json.loads(raw[20 : 20 + size])
    edit(content)
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + raw[20 + size :]
    return struct.pack("<III", 0x46546C67, 2, 12 + len(body)) + body
