"""Scenes as glTF, read by an own reader and by trimesh, against what Bullet has."""

import io
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from actuated_characters.export.gltf_scene import make_document
from actuated_characters.render.engine.shape_meshes import surface_of
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

    raw = make_document(still, np.zeros(1)).to_glb()

    scene = trimesh.load_scene(io.BytesIO(raw), file_type="glb")
    (left, bottom, back), (right, top, front) = scene.bounds
    assert bottom == pytest.approx(0.0, abs=0.03)  # y is up
    assert top - bottom == pytest.approx(1.6, abs=0.1)
    assert left == pytest.approx(-right, abs=1e-3)
    assert front > -back  # the toes are before the heels
    sizes = [shape for link in whole.links for shape in link.shapes]
    expected = sum(abs(_volume(shape)) for shape in sizes)
    assert scene.to_mesh().volume == pytest.approx(expected, rel=0.03)


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
    ball = BallTrajectory("ball_1", 0.25, centres, turns)

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
