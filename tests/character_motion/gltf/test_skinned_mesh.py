"""Skinned meshes read from .glb files: colours, several trees of joints, and damaged content."""

import io
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from actuated_characters.render.skin.given import GivenSkin
from character_motion.gltf.document import GltfDocument
from character_motion.gltf.reading import GlbFile
from character_motion.gltf.skinned_mesh import SkinnedMesh, read_skinned_mesh
from msgs_config.arrays import FloatArray
from msgs_config.errors import SkinError
from msgs_config.geometry.surface import Surface
from tests.support.gltf import WIDTHS
from tests.support.physics import character
from tests.support.skins import edited, skinned_glb

WRONG: tuple[Any, ...] = (None, -1, 3, 10**9, 1e38, "x", [], {}, [1], [0, 0, 0], [1e38] * 16)
KINDS = {
    "POSITION": ("VEC3",),
    "NORMAL": ("VEC3",),
    "JOINTS_0": ("VEC4",),
    "WEIGHTS_0": ("VEC4",),
    "TEXCOORD_0": ("VEC2",),
    "COLOR_0": ("VEC3", "VEC4"),
    "indices": ("SCALAR",),
    "inverseBindMatrices": ("MAT4",),
}
"""What the standard says that each is of (glTF 2.0, 3.7.2.1 and 3.7.3.1)."""
QUARTERS = np.array(((255, 0, 0), (0, 255, 0), (0, 0, 255), (90, 120, 150)), dtype=np.uint8)


def read(folder: Path, raw: bytes) -> SkinnedMesh:
    path = folder / "body.glb"
    path.write_bytes(raw)
    return read_skinned_mesh(GlbFile.read(path))


def four_triangles(colors: FloatArray | None = None) -> bytes:
    """Triangles that each lie in a quarter of a picture, from left to right and down."""
    picture = io.BytesIO()
    Image.fromarray(QUARTERS.reshape(2, 2, 3)).resize((8, 8), Image.Resampling.NEAREST).save(
        picture, "png"
    )
    corners = np.array(((0.1, 0.1, 0.0), (0.4, 0.1, 0.0), (0.1, 0.4, 0.0)))
    quarters = np.array([(0.5 * x, 0.5 * y, 0.0) for y in (0, 1) for x in (0, 1)])
    places = (quarters[:, np.newaxis] + corners).reshape(-1, 3)
    surface = Surface(places, np.tile((0.0, 0.0, 1.0), (12, 1)), np.arange(12).reshape(-1, 3))
    document = GltfDocument("an artist's program")
    joint = document.add_node("joint")
    vertices = document.add_vertices(surface, places[:, :2] + (2.0, -1.0), colors)
    vertices |= document.bind(np.zeros((12, 4), dtype=np.intp), np.eye(4)[np.zeros(12, dtype=int)])
    material = document.add_tiles(picture.getvalue())
    mesh = document.add_mesh_of("body", [(vertices, surface.triangles, material)])
    skin = document.add_skin("skin", [joint], document.add_matrices(np.eye(4)[np.newaxis]))
    document.add_node("body", mesh=mesh, skin=skin)
    return document.to_glb()


def test_a_triangle_has_the_colour_of_the_texture_in_its_middle(tmp_path: Path) -> None:
    mesh = read(tmp_path, four_triangles())

    np.testing.assert_allclose(mesh.colors, QUARTERS / 255.0, atol=1e-6)


def test_the_colours_of_vertices_are_a_share_of_that(tmp_path: Path) -> None:
    half = np.full((12, 3), 0.7353569)  # one half without sRGB's gamma, as tables have it

    mesh = read(tmp_path, four_triangles(half))

    np.testing.assert_allclose(mesh.colors[0], (0.7353569, 0.0, 0.0), atol=1e-5)


def test_a_texture_that_cannot_be_read_is_left_out(tmp_path: Path) -> None:
    def break_picture(content: dict[str, Any]) -> None:
        view = content["images"][0]["bufferView"]
        content["bufferViews"][view]["byteLength"] = 20

    mesh = read(tmp_path, edited(four_triangles(), break_picture))

    np.testing.assert_allclose(mesh.colors, 1.0)


def test_a_texture_without_a_picture_is_left_out(tmp_path: Path) -> None:
    """Where an extension has it, say: it is none of the file's other pictures."""

    def leave_out(content: dict[str, Any]) -> None:
        content["textures"][0].pop("source")

    mesh = read(tmp_path, edited(four_triangles(), leave_out))

    np.testing.assert_allclose(mesh.colors, 1.0)


def test_a_picture_of_many_parts_is_read_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def repeat(content: dict[str, Any]) -> None:
        content["meshes"][0]["primitives"] *= 5

    opened, of_pillow = [], Image.open

    def count(*arguments: Any) -> Any:
        opened.append(arguments)
        return of_pillow(*arguments)

    monkeypatch.setattr(Image, "open", count)
    mesh = read(tmp_path, edited(four_triangles(), repeat))

    np.testing.assert_allclose(mesh.colors, np.tile(QUARTERS / 255.0, (5, 1)), atol=1e-6)
    assert len(opened) == 1


MOVE = {"offset": [0.5, 0.5]}
TURN = {"offset": [0.0, 1.0], "rotation": np.pi / 2}
SCALE = {"scale": [0.5, 1.0], "texCoord": 0}


@pytest.mark.parametrize(
    ("transform", "quarters"),
    [
        (MOVE, (3, 2, 1, 0)),
        (TURN, (2, 0, 3, 1)),
        (SCALE, (0, 0, 2, 2)),
        ({}, (0, 1, 2, 3)),
    ],
    ids=("move", "turn", "scale", "nothing"),
)
def test_a_texture_may_be_transformed(
    transform: dict[str, Any], quarters: tuple[int, ...], tmp_path: Path
) -> None:
    """As KHR_texture_transform says: scaled, turned from v to u, moved."""

    def change(content: dict[str, Any]) -> None:
        content["extensionsRequired"] = ["KHR_texture_transform"]
        texture = content["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
        texture["extensions"] = {"KHR_texture_transform": transform}

    mesh = read(tmp_path, edited(four_triangles(), change))

    np.testing.assert_allclose(mesh.colors, QUARTERS[list(quarters)] / 255.0, atol=1e-6)


def test_what_joints_hang_on_need_not_be_a_joint(tmp_path: Path) -> None:
    """Of a skin whose weights leave out the hips, the legs are trees of their own."""

    def leave_out(content: dict[str, Any]) -> None:
        skin = content["skins"][0]
        skin["joints"][0] = skin["joints"][1]

    mesh = read(tmp_path, edited(skinned_glb(), leave_out))

    assert mesh.parents.count(-1) == 3
    assert "mixamorig:Hips" not in mesh.names


def entries(content: Any) -> Iterator[tuple[Any, Any]]:
    """All places of a JSON value: what they are in, and their key."""
    keys = content if isinstance(content, dict) else range(len(content))
    for key in list(keys):
        yield content, key
        if isinstance(content[key], dict | list):
            yield from entries(content[key])


@pytest.mark.parametrize("seed", range(40))
def test_wrong_content_is_one_line(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)

    def spoil(content: dict[str, Any]) -> None:
        holder, key = chance.choice(list(entries(content)))
        holder[key] = chance.choice(WRONG)

    path = tmp_path / "body.glb"
    path.write_bytes(edited(skinned_glb(), spoil))
    try:
        skin = GivenSkin.read(path).fitted(character("humanoid"))
    except SkinError as error:
        assert "\n" not in str(error) and str(error).startswith(str(path))
    else:
        assert np.isfinite(skin.surface.vertices).all()


@pytest.mark.parametrize(
    ("name", "wrong"),
    [(name, kind) for name, right in KINDS.items() for kind in WIDTHS if kind not in right],
)
def test_numbers_of_another_kind_are_one_line(name: str, wrong: str, tmp_path: Path) -> None:
    """Even where there are as many rows of them as there must be."""

    def change(content: dict[str, Any]) -> None:
        primitive = content["meshes"][0]["primitives"][0]
        holders = (primitive, primitive["attributes"], content["skins"][0])
        (number,) = (each[name] for each in holders if name in each)
        accessor = content["accessors"][number]
        accessor["type"] = wrong
        accessor.pop("bufferView")  # Then its numbers are zeros, as many as there must be.

    with pytest.raises(SkinError) as caught:
        read(tmp_path, edited(four_triangles(np.ones((12, 3))), change))

    line = str(caught.value)
    assert f"{name} is {wrong}; it must be {' or '.join(KINDS[name])}" in line
    assert "\n" not in line
