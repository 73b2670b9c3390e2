"""Scenes as glTF, read by an own reader and by trimesh, against what Bullet has."""

import io
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from actuated_characters.export.gltf_scene import make_document
from actuated_characters.render.drawn_shapes import drawn_shapes
from actuated_characters.render.engine.ground import COLORS
from actuated_characters.render.engine.shape_meshes import surface_of
from actuated_characters.render.skin.choosing import skin_of
from actuated_characters.render.skin.palette import skin_colors
from actuated_characters.render.skin.skin import PosedSkin
from character_motion.export.trajectories import BallTrajectory, Trajectories
from character_motion.gltf.document import GltfDocument
from msgs_config.character.model import Shape, ShapeType
from msgs_config.geometry import rotations
from tests.support.gltf import Gltf, assert_valid
from tests.support.moving import FRAMES, random_motion
from tests.support.physics import EVERY_CHARACTER, character, character_id

SINGLE = 1e-6  # of the single precision that glTF has, m at a few metres
AXES = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # y up, forward is z


def written(motion: Trajectories, **options: bool) -> Gltf:
    return Gltf.of_glb(make_document(motion, motion.sample_times(), **options).to_glb())


@pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
def test_every_link_is_where_bullet_has_it(name: str) -> None:
    whole = character(name)
    motion, expected = random_motion(whole)

    gltf = written(motion)

    assert_valid(gltf)
    times = motion.sample_times()
    assert len(times) == FRAMES
    for frame, time in enumerate(times.tolist()):
        poses = gltf.poses(time)
        for row, link in enumerate(whole.links):
            pose = poses[gltf.node(link.name)]
            turn = rotations.matrix(expected.turns_xyzw[frame, row])
            np.testing.assert_allclose(pose[:3, :3], AXES @ turn, atol=SINGLE)
            place = AXES @ expected.origins[frame, row]
            np.testing.assert_allclose(pose[:3, 3], place, atol=4 * SINGLE)


def test_between_two_frames_the_turn_is_the_shortest() -> None:
    motion, _ = random_motion(character("humanoid"))
    trajectory = motion.characters[0]

    gltf = written(motion)

    half = motion.link_poses(trajectory, np.array([0.5 / motion.rate]))
    # of the base alone: below it, slerp of glTF and turns in our sampling are the same path
    pose = gltf.poses(0.5 / motion.rate)[gltf.node("base")]
    np.testing.assert_allclose(pose[:3, 3], AXES @ half.origins[0, 0], atol=4 * SINGLE)
    turn = AXES @ rotations.matrix(half.turns_xyzw[0, 0])
    np.testing.assert_allclose(pose[:3, :3], turn, atol=4 * SINGLE)


def test_trimesh_sees_the_humanoid_stand_on_the_ground_with_the_volume_of_its_shapes() -> None:
    whole = character("humanoid")
    rest = np.array([whole.rest_position])
    motion, _ = random_motion(whole)
    trajectory = replace(motion.characters[0], configurations=whole.layout.configuration(rest))
    still = replace(motion, times=np.zeros(1), characters=(trajectory,))

    raw = make_document(still, np.zeros(1), skinned=False).to_glb()

    scene = trimesh.load_scene(io.BytesIO(raw), file_type="glb")
    (left, bottom, back), (right, top, front) = scene.bounds
    assert bottom == pytest.approx(0.0, abs=0.03)  # y is up
    assert top - bottom == pytest.approx(1.6, abs=0.1)
    assert left == pytest.approx(-right, abs=1e-3)
    assert front > -back  # the toes are before the heels
    sizes = [shape for link in whole.links for shape in link.shapes]
    expected = sum(abs(_volume(shape)) for shape in sizes)
    assert scene.to_mesh().volume == pytest.approx(expected, rel=0.03)


def test_a_skin_follows_the_links_as_in_pictures() -> None:
    whole = character("humanoid")
    motion, expected = random_motion(whole)

    gltf = written(motion)

    assert_valid(gltf)
    skin = skin_of(whole, drawn_shapes(whole))
    assert skin is not None
    posed, node = PosedSkin(skin), gltf.node("skin")
    for frame, time in enumerate(motion.sample_times().tolist()):
        surface = posed.surface(expected.origins[frame], expected.turns_xyzw[frame])
        parts = gltf.skinned(node, time)
        for part, (which, _) in zip(parts, skin.colored(skin_colors(whole)), strict=True):
            used = np.unique(surface.triangles[which])
            places = surface.vertices[used] @ AXES.T
            np.testing.assert_allclose(part, places, atol=10 * SINGLE)


def test_a_skin_has_the_colours_of_pictures_and_its_triangles_each_once() -> None:
    whole = character("humanoid")
    motion, _ = random_motion(whole)

    gltf = written(motion)

    skin = skin_of(whole, drawn_shapes(whole))
    assert skin is not None
    (mesh,) = gltf.content["meshes"]
    expected = list(skin.colored(skin_colors(whole)))
    assert len(expected) == 2
    for primitive, (which, color) in zip(mesh["primitives"], expected, strict=True):
        corners = gltf.numbers(primitive["indices"]).reshape(-1, 3)
        triangles = skin.surface.triangles[which]
        np.testing.assert_array_equal(np.unique(triangles)[corners], triangles)
        surface = gltf.content["materials"][primitive["material"]]["pbrMetallicRoughness"]
        red = ((color[0] + 0.055) / 1.055) ** 2.4  # without its gamma
        assert surface["baseColorFactor"][0] == pytest.approx(red)


def test_trimesh_sees_the_skin_closed_and_on_the_ground() -> None:
    motion, _ = random_motion(character("humanoid"))

    raw = make_document(motion, motion.sample_times()).to_glb()

    scene = trimesh.load_scene(io.BytesIO(raw), file_type="glb")
    whole = scene.to_mesh()
    mesh = trimesh.Trimesh(whole.vertices, whole.faces)  # which merges those of two colours
    assert mesh.is_watertight and mesh.volume > 0.03
    (_, bottom, _), (_, top, _) = mesh.bounds
    assert bottom == pytest.approx(0.0, abs=SINGLE) and 1.4 < top < 1.8


def test_characters_of_one_model_share_the_vertices_of_their_skins() -> None:
    motion, _ = random_motion(character("humanoid"))
    each = motion.characters[0]
    other_team = replace(each, name="right", color_number=1)
    two = replace(motion, characters=(replace(each, name="left"), other_team))

    gltf = written(two)

    assert_valid(gltf)
    left, right = (mesh["primitives"] for mesh in gltf.content["meshes"])
    for one, other in zip(left, right, strict=True):
        assert one["attributes"] == other["attributes"] and one["material"] != other["material"]
    joints = [set(skin["joints"]) for skin in gltf.content["skins"]]
    assert not joints[0] & joints[1]


def test_the_ground_has_the_tiles_of_pictures() -> None:
    motion, _ = random_motion(character("pendulum"))

    raw = make_document(motion, motion.sample_times(), ground=True).to_glb()

    assert_valid(Gltf.of_glb(raw))
    scene = trimesh.load_scene(io.BytesIO(raw), file_type="glb")
    plane = scene.geometry["ground"]
    picture = np.asarray(plane.visual.material.baseColorTexture.convert("RGB"))
    height, width = picture.shape[:2]
    for x, y in ((0.2, 0.3), (0.7, 0.3), (-0.2, 0.3), (-0.7, -1.8), (0.2, 12.6)):
        (row,) = np.flatnonzero((np.sign(plane.vertices[:, :2]) == np.sign((x, y))).all(axis=1))
        u, v = plane.visual.uv[row] * (x, y) / plane.vertices[row, :2]  # as it is linear
        color = picture[int(((1.0 - v) % 1.0) * height), int((u % 1.0) * width)]
        is_dark = (np.floor(x / 0.5) + np.floor(y / 0.5)) % 2
        np.testing.assert_allclose(color, COLORS[int(is_dark)], atol=0.5)


def _volume(shape: Shape) -> float:
    """Exactly; faceted surfaces have up to 3 % less."""
    if shape.type is ShapeType.BOX:
        return float(np.prod(shape.size))
    radius, length = shape.size[0], shape.size[1] if len(shape.size) > 1 else 0.0
    return float(np.pi * radius**2 * (length + 4.0 / 3.0 * radius))


def test_a_colour_loses_its_gamma_and_is_shared() -> None:
    document = GltfDocument("test")
    surface = surface_of(Shape(ShapeType.SPHERE, (0.1,)))

    document.add_mesh("two", [(surface, (0.5, 1.0, 0.0, 1.0)), (surface, (0.5, 1.0, 0.0, 1.0))])
    document.add_mesh("glass", [(surface, (0.0, 0.0, 0.0, 0.25))])

    opaque, glass = Gltf.of_text(document.to_gltf()).content["materials"]
    # 0.2140 is what tables of sRGB have for one half
    expected = pytest.approx([0.2140, 1.0, 0.0, 1.0], abs=1e-4)
    assert opaque["pbrMetallicRoughness"]["baseColorFactor"] == expected
    assert "alphaMode" not in opaque and glass["alphaMode"] == "BLEND"


def test_a_ball_is_there_while_it_is_thrown() -> None:
    motion, _ = random_motion(character("humanoid"))
    gone = np.full(3, np.nan)
    centres = np.array([gone, (1.0, 2.0, 3.0), (1.5, 2.0, 3.5), gone])
    turns = np.where(np.isnan(centres[:, :1]), np.nan, np.array([0.0, 0.0, 0.0, 1.0]))
    ball = BallTrajectory("ball_1", Shape(ShapeType.SPHERE, (0.25,)), centres, turns)

    gltf = written(replace(motion, balls=(ball,)), ground=True)

    assert_valid(gltf)
    node = gltf.node("ball_1")
    sizes = [np.linalg.norm(gltf.poses(t / motion.rate)[node][:3, 0]) for t in range(FRAMES)]
    assert sizes == [0.0, pytest.approx(1.0), pytest.approx(1.0), 0.0]
    place = gltf.poses(2.0 / motion.rate)[node][:3, 3]
    np.testing.assert_allclose(place, (2.0, 3.5, 1.5), atol=SINGLE)
    mesh = gltf.content["meshes"][gltf.content["nodes"][node]["mesh"]]
    accessor = mesh["primitives"][0]["attributes"]["POSITION"]
    assert gltf.content["accessors"][accessor]["max"] == pytest.approx([0.25] * 3, abs=2e-3)
    assert gltf.content["nodes"][gltf.node("ground")]["mesh"] is not None


def test_several_characters_move_together_under_names_of_their_own() -> None:
    left, expected = random_motion(character("humanoid"), seed=1)
    right, other = random_motion(character("humanoid"), seed=2)
    characters = (
        replace(left.characters[0], name="left"),
        replace(right.characters[0], name="right"),
    )

    gltf = written(replace(left, characters=characters))

    assert_valid(gltf)
    assert len(gltf.content["animations"]) == 1
    last = gltf.poses(FRAMES / left.rate)
    for name, poses in (("left", expected), ("right", other)):
        place = last[gltf.node(f"{name}_left_ankle")][:3, 3]
        np.testing.assert_allclose(place, AXES @ poses.origins[-1, -1], atol=4 * SINGLE)


def test_text_and_binary_are_the_same_document() -> None:
    motion, _ = random_motion(character("pendulum"))
    document = make_document(motion, motion.sample_times())

    text, binary = Gltf.of_text(document.to_gltf()), Gltf.of_glb(document.to_glb())

    assert text.buffer == binary.buffer
    del text.content["buffers"][0]["uri"]
    assert text.content == binary.content


def test_a_motion_that_begins_later_begins_at_zero() -> None:
    motion, expected = random_motion(character("humanoid"))

    gltf = Gltf.of_glb(make_document(motion, motion.sample_times(2.0 / motion.rate)).to_glb())

    assert_valid(gltf)
    place = gltf.poses(0.0)[gltf.node("base")][:3, 3]
    np.testing.assert_allclose(place, AXES @ expected.origins[2, 0], atol=4 * SINGLE)
