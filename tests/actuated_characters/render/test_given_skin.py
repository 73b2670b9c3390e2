"""A user's own skinned mesh as a character's skin, of which the right answer is known."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from actuated_characters.render.drawn_shapes import drawn_shapes
from actuated_characters.render.engine.camera_pose import CameraPose
from actuated_characters.render.engine.posed_characters import PosedCharacters
from actuated_characters.render.engine.renderer import FrameSpec, Renderer
from actuated_characters.render.skin.choosing import skin_of
from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.render.skin.skin import PosedSkin, Skin
from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.errors import ActuatedCharactersError
from msgs_config.geometry import rotations
from tests.support.hinged_humanoid import write_robot
from tests.support.physics import character, random_state
from tests.support.skins import (
    BLUE,
    MIXAMO,
    RED,
    bound_skin,
    edited,
    rows_in_file,
    skinned_glb,
    two_parts,
)

NEAR = 1e-5  # m: single precision, and how exactly bones are aligned
OF_FEET = 5e-3  # m: feet are scaled so that the soles are on the ground, where shapes are


def given(folder: Path, raw: bytes, joints: str | None = None) -> GivenSkin:
    path, names = folder / "body.glb", folder / "joints.yaml"
    path.write_bytes(raw)
    if joints is not None:
        names.write_text(joints)
    return GivenSkin.read(path, None if joints is None else names)


def poses() -> list[tuple[FloatArray, FloatArray]]:
    """Link frames in some poses."""
    humanoid, rng = character("humanoid"), np.random.default_rng(3)
    posed = PosedCharacters([humanoid])
    return [posed.frames(random_state(humanoid, rng)[0]) for _ in range(4)]


def assert_moves_as(skin: Skin, expected: Skin) -> None:
    """That both are at the same places in all poses, but for feet."""
    feet = [
        row for row, link in enumerate(character("humanoid").links) if link.name.endswith("ankle")
    ]
    of_feet = (np.isin(expected.bones, feet) & (expected.weights > 0.0)).any(axis=1)[rows_in_file()]
    one, other = PosedSkin(skin), PosedSkin(expected)
    for origins, turns in poses():
        places = other.surface(origins, turns).vertices[rows_in_file()]
        away = np.linalg.norm(one.surface(origins, turns).vertices - places, axis=1)
        assert away[~of_feet].max() < NEAR
        assert away[of_feet].max() < OF_FEET


@pytest.mark.parametrize("scale", [1.0, 100.0, 0.4])
def test_a_mesh_in_another_pose_and_unit_moves_as_one_bound_to_the_links(
    tmp_path: Path, scale: float
) -> None:
    skin = given(tmp_path, skinned_glb(scale=scale)).fitted(character("humanoid"))

    assert_moves_as(skin, bound_skin())


def test_joints_of_the_same_names_need_no_parts_of_a_body(tmp_path: Path) -> None:
    names = {link.name: f"rig|{link.name.upper()}" for link in character("humanoid").links}

    skin = given(tmp_path, skinned_glb(names)).fitted(character("humanoid"))

    assert_moves_as(skin, bound_skin())


def test_joints_without_names_that_say_anything_are_told(tmp_path: Path) -> None:
    names = {name: f"bone.{number}" for number, name in enumerate(MIXAMO)}
    told = "".join(f"{link}: {joint}\n" for link, joint in names.items())

    skin = given(tmp_path, skinned_glb(names), told).fitted(character("humanoid"))

    assert_moves_as(skin, bound_skin())


def test_a_link_without_a_joint_leaves_its_vertices_to_the_one_above(tmp_path: Path) -> None:
    humanoid = character("humanoid")

    skin = given(tmp_path, skinned_glb(), "left_wrist:\n").fitted(humanoid)

    rows = {link.name: row for row, link in enumerate(humanoid.links)}
    assert not skin.weights[skin.bones == rows["left_wrist"]].any()
    of_hand = bound_skin().bones[rows_in_file(), 0] == rows["left_wrist"]
    assert (skin.bones[of_hand, 0] == rows["left_elbow"]).all()


def test_a_mesh_of_other_proportions_has_its_joints_where_the_links_are(tmp_path: Path) -> None:
    humanoid, bound = character("humanoid"), bound_skin()
    rows = {link.name: row for row, link in enumerate(humanoid.links)}

    raw = skinned_glb(scale=np.array((1.0, 1.25, 1.0)))  # y is up
    skin = given(tmp_path, raw).fitted(humanoid)

    for row, link in enumerate(humanoid.links):
        if link.parent >= 0:
            ways = [each.origins[row] - each.origins[link.parent] for each in (skin, bound)]
            assert np.linalg.norm(ways[0]) == pytest.approx(np.linalg.norm(ways[1]), abs=1e-9)
    order = rows_in_file()
    for side in ("left", "right"):
        hip, knee = rows[f"{side}_hip"], rows[f"{side}_knee"]
        shared = np.array(
            [(bound.weights * (bound.bones == row)).sum(axis=1)[order] > 0.3 for row in (hip, knee)]
        ).all(axis=0)
        around = skin.surface.vertices[shared].mean(axis=0) - skin.origins[knee]
        expected = bound.surface.vertices[order][shared].mean(axis=0) - bound.origins[knee]
        np.testing.assert_allclose(around, expected, atol=0.01)
    heights = [
        each.origins[rows["left_ankle"], 2] - each.surface.vertices[:, 2].min()
        for each in (skin, bound)
    ]
    assert heights[0] == pytest.approx(heights[1], abs=OF_FEET)


def test_hinges_that_cross_are_one_joint(tmp_path: Path) -> None:
    """Of a robot whose hips are three hinges the thighs of the mesh are as long as its own."""
    robot = load_character(str(write_robot(tmp_path / "robot.urdf")))
    rows = {link.name: row for row, link in enumerate(robot.links)}
    mesh = given(tmp_path, skinned_glb())

    skin, humanoid, bound = mesh.fitted(robot), character("humanoid"), bound_skin()

    names = [link.name for link in humanoid.links]
    order = rows_in_file()
    for side in ("left", "right"):
        shared = np.array(
            [
                (bound.weights * (bound.bones == names.index(f"{side}_{part}"))).sum(axis=1)[order]
                > 0.3
                for part in ("hip", "knee")
            ]
        ).all(axis=0)
        knee = skin.origins[rows[f"{side}_knee_link"]]
        around = skin.surface.vertices[shared].mean(axis=0) - knee
        assert np.linalg.norm(around) < 0.03
        assert (skin.weights[skin.bones == rows[f"{side}_shoulder_pitch_link"]] == 0.0).all()


def test_triangles_have_the_colours_of_their_materials(tmp_path: Path) -> None:
    skin = given(tmp_path, skinned_glb()).fitted(character("humanoid"))

    assert skin.colors is not None
    for color, which in zip((RED, BLUE), two_parts(), strict=True):
        count = (np.abs(skin.colors - color[:3]).max(axis=1) < 1e-6).sum()
        assert count == which.sum()


def test_a_picture_shows_the_mesh_in_its_own_colours(tmp_path: Path) -> None:
    humanoid = character("humanoid")
    frame = FrameSpec(np.array(humanoid.rest_position), CameraPose((0.0, 0.0, 0.8), 4.0, 0.6, 0.2))

    camera = Renderer(humanoid, ground=False, skinned=True, skin=given(tmp_path, skinned_glb()))
    picture = camera.picture(frame, (120, 160)).astype(int)

    red, _, blue = np.moveaxis(picture, 2, 0)
    upper, lower = red > 2 * blue, blue > 2 * red
    assert upper.sum() > 300 and lower.sum() > 300
    assert np.flatnonzero(upper.any(axis=1)).max() < np.flatnonzero(lower.any(axis=1)).max()


def test_a_wide_mesh_is_within_the_part_of_a_picture_that_is_drawn(tmp_path: Path) -> None:
    skin = given(tmp_path, skinned_glb(scale=np.array((1.0, 1.0, 3.0)))).fitted(
        character("humanoid")
    )

    centres, radii = skin.spheres()

    for origins, turns in poses():
        vertices = PosedSkin(skin).surface(origins, turns).vertices
        places = origins + rotations.rotate(turns, centres)
        reach = radii[:, np.newaxis]
        assert (vertices.min(axis=0) >= (places - reach).min(axis=0)).all()
        assert (vertices.max(axis=0) <= (places + reach).max(axis=0)).all()


def test_characters_of_one_model_share_the_fitted_mesh(tmp_path: Path) -> None:
    humanoid, mesh = character("humanoid"), given(tmp_path, skinned_glb())
    shapes = drawn_shapes(humanoid)

    assert skin_of(humanoid, shapes, mesh) is skin_of(humanoid, shapes, mesh)


def harmful(name: str) -> str:
    """A name that begins with an escape code and a line's end, and is long."""
    return "\x1b[2J\n" + name + 10_000 * "x"


@pytest.mark.parametrize(
    "joints",
    [
        {},
        {"left_knee": "pillar"},
        {"left_knee": harmful("pillar")},
        {"root": harmful("mixamorig:Hips"), "chest": harmful("mixamorig:Hips")},
    ],
)
def test_joints_are_named_without_what_a_terminal_obeys(
    joints: dict[str, str], tmp_path: Path
) -> None:
    names = {link: harmful(name.replace("Left", "Near")) for link, name in MIXAMO.items()}

    with pytest.raises(ActuatedCharactersError) as caught:
        given(tmp_path, skinned_glb(names), json.dumps(joints)).fitted(character("humanoid"))

    line = str(caught.value)
    assert line.isprintable() and len(line) < 4000
    assert "mixamorig:Hips" in line  # Only the end of a name is cut.


# Files that cannot be used


def without(part: str) -> Callable[[dict[str, Any]], None]:
    return lambda content: content.pop(part)


def unskinned(content: dict[str, Any]) -> None:
    for node in content["nodes"]:
        node.pop("skin", None)


def huge(content: dict[str, Any]) -> None:
    for accessor in content["accessors"]:
        accessor["count"] = 10**9


def unseen_numbers(content: dict[str, Any]) -> None:
    content["accessors"][0].pop("bufferView")
    content["accessors"][0]["count"] = 10**9


def beyond(content: dict[str, Any]) -> None:
    content["bufferViews"][0]["byteLength"] = 10**9


def compressed(content: dict[str, Any]) -> None:
    content["extensionsRequired"] = ["KHR_draco_mesh_compression"]


def circular(content: dict[str, Any]) -> None:
    content["nodes"][3]["children"] = [0]


def no_joint(content: dict[str, Any]) -> None:
    content["skins"][0]["joints"] = [10**6]


def wrong_kind(content: dict[str, Any]) -> None:
    content["nodes"] = "none"


def flat(content: dict[str, Any]) -> None:
    content["skins"][0].pop("inverseBindMatrices")


def enormous(content: dict[str, Any]) -> None:
    content["nodes"][0]["scale"] = [1e200] * 3


def colorless(content: dict[str, Any]) -> None:
    content["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [None] * 4


@pytest.mark.parametrize(
    ("edit", "parts"),
    [
        (enormous, ("damaged", "1e+09")),
        (colorless, ("damaged", "colour")),
        (without("meshes"), ("no mesh",)),
        (unskinned, ("no mesh with a skin", "bind it")),
        (without("skins"), ("damaged",)),
        (without("accessors"), ("damaged",)),
        (huge, ("1000000000 rows",)),
        (unseen_numbers, ("1000000000 rows",)),
        (beyond, ("damaged", "beyond the end")),
        (compressed, ("KHR_draco_mesh_compression", "without compression")),
        (circular, ("damaged",)),
        (no_joint, ("damaged", "joints that are not there")),
        (wrong_kind, ("damaged", "nodes")),
        (flat, ("at one place",)),
    ],
)
def test_a_file_that_cannot_be_used_is_one_line(
    edit: Callable[[dict[str, Any]], None], parts: tuple[str, ...], tmp_path: Path
) -> None:
    with pytest.raises(ActuatedCharactersError) as caught:
        given(tmp_path, edited(skinned_glb(), edit)).fitted(character("humanoid"))

    line = str(caught.value)
    assert "\n" not in line and "body.glb" in line
    assert all(part in line for part in parts), line


@pytest.mark.parametrize(
    ("raw", "part"),
    [
        (b"", "no binary glTF"),
        (b"solid nothing", "no binary glTF"),
        (b'{"asset": {"version": "2.0"}}', "no binary glTF"),
        (b"glTF", "no binary glTF"),
        (b"glTF\1\0\0\0" + 12 * b"\0", "glTF 1"),
        (skinned_glb()[:-100], "damaged"),
        (b"Kaydara FBX Binary", "an FBX scene"),
    ],
)
def test_what_is_no_glb_is_one_line(raw: bytes, part: str, tmp_path: Path) -> None:
    with pytest.raises(ActuatedCharactersError, match=part) as caught:
        given(tmp_path, raw)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("joints", "parts"),
    [
        (
            "left_kneee: mixamorig:LeftLeg",
            ("unknown link 'left_kneee'", "mean 'left_knee'"),
        ),
        ("left_knee: LeftLeg", ("unknown joint 'LeftLeg'", "mixamorig:LeftLeg")),
        (
            "left_knee: mixamorig:LeftLeg\nleft_hip: mixamorig:LeftLeg",
            ("left_hip", "another link", "LeftLeg"),
        ),
        ("left_knee: [1, 2]", ("left_knee", "a text")),
        ("- left_knee", ("joints.yaml",)),
    ],
)
def test_a_wrong_map_is_one_line(joints: str, parts: tuple[str, ...], tmp_path: Path) -> None:
    with pytest.raises(ActuatedCharactersError) as caught:
        given(tmp_path, skinned_glb(), joints).fitted(character("humanoid"))

    line = str(caught.value)
    assert "\n" not in line and all(part in line for part in parts), line


def test_joints_that_are_not_found_are_named_with_those_that_are_there(tmp_path: Path) -> None:
    names = MIXAMO | {"left_knee": "pillar", "right_elbow": "beam"}

    with pytest.raises(ActuatedCharactersError) as caught:
        given(tmp_path, skinned_glb(names)).fitted(character("humanoid"))

    line = str(caught.value)
    assert "\n" not in line and "--skin-map" in line and "pillar" in line and "left_knee" in line
    told = "left_knee: pillar\nright_elbow: beam\n"
    assert given(tmp_path, skinned_glb(names), told).fitted(character("humanoid"))
