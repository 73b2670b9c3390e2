"""Skins: closed surfaces around a character's shapes that follow its links."""

from dataclasses import replace
from functools import cache
from itertools import combinations, product

import numpy as np
import pytest
import trimesh

from actuated_characters.render.drawn_shapes import drawn_shapes
from actuated_characters.render.engine.camera_pose import CameraPose
from actuated_characters.render.engine.posed_characters import PosedCharacters
from actuated_characters.render.engine.renderer import FrameSpec, Picture, Renderer
from actuated_characters.render.skin.blended_body import blend
from actuated_characters.render.skin.choosing import skin_of
from actuated_characters.render.skin.cores import core_of
from actuated_characters.render.skin.making import MOST_TRIANGLES
from actuated_characters.render.skin.palette import skin_colors
from actuated_characters.render.skin.skin import PosedSkin, Skin
from actuated_characters.render.skin.spread_pose import spread_pose
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character, Placement, Shape, ShapeType
from msgs_config.geometry import rotations
from tests.support.physics import character

SPIDER = """<robot name="spider">
<link name="body"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
iyz="0"/></inertial><visual><geometry><cylinder radius="0.2" length="0.12"/></geometry></visual>
</link>{legs}</robot>"""
LEG = """<link name="leg{k}"><inertial><mass value="0.3"/><inertia ixx="1" iyy="1" izz="1" ixy="0"
ixz="0" iyz="0"/></inertial><visual><origin xyz="0.3 0 0"/><geometry><box size="0.5 0.06 0.05"/>
</geometry></visual></link><joint name="hip{k}" type="revolute"><parent link="body"/>
<child link="leg{k}"/><origin xyz="{x} {y} 0" rpy="0 0 {yaw}"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="9" velocity="9"/></joint>"""


@cache
def skin_named(name: str) -> Skin:
    return made(character(name))


def made(whole: Character) -> Skin:
    found = skin_of(whole, drawn_shapes(whole))
    assert found is not None
    return found


@pytest.fixture(scope="module", params=["humanoid", "spider"])
def skin(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Skin:
    """Of a humanoid, and of what a URDF makes of a cylinder and six boxes."""
    if request.param == "humanoid":
        return skin_named("humanoid")
    path = tmp_path_factory.mktemp("spider") / "spider.urdf"
    yaws = np.arange(6) * np.pi / 3.0
    legs = [
        LEG.format(k=k, x=0.22 * np.cos(yaw), y=0.22 * np.sin(yaw), yaw=yaw)
        for k, yaw in enumerate(yaws.tolist())
    ]
    path.write_text(SPIDER.format(legs="".join(legs)))
    return made(load_character(str(path)))


def mesh_of(skin: Skin) -> trimesh.Trimesh:
    return trimesh.Trimesh(skin.surface.vertices, skin.surface.triangles, process=False)


def count_of_pieces(skin: Skin) -> int:
    """By giving each vertex the least number of those that it is connected with."""
    number, triangles = np.arange(len(skin.surface.vertices)), skin.surface.triangles
    while True:
        least = np.repeat(number[triangles].min(axis=1), 3)
        before = number.copy()
        np.minimum.at(number, triangles.ravel(), least)
        if (number == before).all():
            return len(set(number.tolist()))


def turns_around(skin: Skin, point: FloatArray) -> float:
    """How often the surface goes around a point: the sum of its triangles' solid angles.

    Van Oosterom and Strackee 1983, "The solid angle of a plane triangle".
    """
    a, b, c = np.moveaxis((skin.surface.vertices - point)[skin.surface.triangles], 1, 0)
    la, lb, lc = (np.linalg.norm(each, axis=1) for each in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return float(2.0 * np.arctan2(volume, below).sum() / (4.0 * np.pi))


def test_it_is_one_body_without_a_hole_or_a_triangle_inside_out(skin: Skin) -> None:
    mesh = mesh_of(skin)

    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0.0
    assert count_of_pieces(skin) == 1
    assert len(skin.surface.triangles) <= MOST_TRIANGLES


def test_its_normals_are_those_of_its_triangles(skin: Skin) -> None:
    mesh = mesh_of(skin)

    np.testing.assert_allclose(np.linalg.norm(skin.surface.normals, axis=1), 1.0)
    along = (mesh.face_normals[:, np.newaxis] * skin.surface.normals[skin.surface.triangles]).sum(2)
    assert np.quantile(along, 0.01) > 0.5
    assert along.mean() > 0.95


def test_the_middle_of_each_shape_is_within_it() -> None:
    humanoid = character("humanoid")
    skin = skin_named("humanoid")
    for row, shapes in enumerate(drawn_shapes(humanoid)):
        for shape in shapes:
            local = rotations.rotate(skin.turns_xyzw[row], core_of(shape).ends.mean(axis=0))
            assert turns_around(skin, skin.origins[row] + local) == pytest.approx(1.0)
    assert turns_around(skin, skin.origins[0] + (0.0, 0.0, 3.0)) == pytest.approx(0.0, abs=1e-9)


def test_what_no_joint_connects_is_apart_in_its_pose() -> None:
    humanoid = character("humanoid")
    cores = [[core_of(shape) for shape in own] for own in drawn_shapes(humanoid)]
    posed = PosedCharacters([humanoid])
    origins, turns = posed.frames(spread_pose(humanoid, cores))
    joined = {(link.parent, row) for row, link in enumerate(humanoid.links)}

    for one, other in combinations(range(len(cores)), 2):
        if (one, other) in joined:
            continue
        for core in cores[one]:
            ends = core.moved(origins[one], turns[one]).ends
            points = ends[0] + np.linspace(0.0, 1.0, 9)[:, np.newaxis] * (ends[1] - ends[0])
            for against in cores[other]:
                placed = against.moved(origins[other], turns[other])
                gap = min(placed.distance(point) for point in points) - core.radius
                assert gap > 0.0, (humanoid.links[one].name, humanoid.links[other].name)


def test_its_vertices_lie_on_the_body_that_it_is_of() -> None:
    body = blend(character("humanoid"), drawn_shapes(character("humanoid")))

    depths = [body.depth(*vertex) for vertex in skin_named("humanoid").surface.vertices.tolist()]

    assert np.abs(depths).max() < 5e-4  # m


# Following the links


def test_weights_are_shares_and_a_triangle_is_of_a_link_that_moves_it(skin: Skin) -> None:
    assert (skin.weights >= 0.0).all()
    np.testing.assert_allclose(skin.weights.sum(axis=1), 1.0)
    corners = skin.bones[skin.surface.triangles].reshape(len(skin.owners), -1)
    assert (corners == skin.owners[:, np.newaxis]).any(axis=1).mean() > 0.999


def test_it_moves_with_all_links_as_one_of_them_does(skin: Skin) -> None:
    turn = rotations.exp(np.array((0.3, -0.7, 1.1)))
    away = np.array((1.0, -2.0, 0.5))
    origins = rotations.rotate(turn, skin.origins) + away

    moved = PosedSkin(skin).surface(origins, rotations.multiply(turn, skin.turns_xyzw))

    expected = rotations.rotate(turn, skin.surface.vertices) + away
    np.testing.assert_allclose(moved.vertices, expected, atol=1e-12)
    expected = rotations.rotate(turn, skin.surface.normals)
    np.testing.assert_allclose(moved.normals, expected, atol=1e-12)


def bent_knee(humanoid_skin: Skin, angle: float) -> tuple[FloatArray, int]:
    """The skin's vertices where the right knee is bent, and the row of its link."""
    humanoid = character("humanoid")
    names = [link.name for link in humanoid.links]
    knee = names.index("right_knee")
    turn = rotations.exp(np.array((0.0, 0.0, angle)))
    turns, origins = humanoid_skin.turns_xyzw.copy(), humanoid_skin.origins.copy()
    for row, link in enumerate(humanoid.links):
        if row == knee or link.parent == knee:
            turns[row] = rotations.multiply(turns[knee] if row == knee else turns[row], turn)
    return PosedSkin(humanoid_skin).surface(origins, turns).vertices, knee


def test_a_joint_moves_what_is_near_or_beyond_it_alone() -> None:
    whole = skin_named("humanoid")

    vertices, knee = bent_knee(whole, 1.0)

    moved = np.linalg.norm(vertices - whole.surface.vertices, axis=1) > 1e-9
    names = [link.name for link in character("humanoid").links]
    below = {names.index("right_knee"), names.index("right_ankle")}
    assert set(whole.bones[moved, 0].tolist()) <= below | {names.index("right_hip")}
    far = np.linalg.norm(whole.surface.vertices - whole.origins[knee], axis=1) > 0.25
    assert not (moved & far & (whole.bones[:, 0] == names.index("right_hip"))).any()


def test_its_parts_are_the_whole_each_triangle_once() -> None:
    whole, humanoid = skin_named("humanoid"), character("humanoid")

    parts = [which for which, _ in whole.colored(skin_colors(humanoid))]

    assert len(parts) == 2
    assert (np.sum(parts, axis=0) == 1).all()


# Who has one, and its colours


def test_a_robot_of_meshes_or_on_a_stand_has_none() -> None:
    for name in ("laikago", "kuka", "lift", "pendulum"):
        assert skin_of(character(name), drawn_shapes(character(name))) is None, name


def test_characters_of_one_model_share_a_skin_wherever_they_stand() -> None:
    humanoid = character("humanoid")
    elsewhere = load_character("humanoid").placed(Placement(1.0, 2.0, 0.0, 2.5))
    longer = replace(humanoid.links[3], shapes=(Shape(ShapeType.SPHERE, (0.2,)),))
    other = replace(humanoid, links=(*humanoid.links[:3], longer, *humanoid.links[4:]))

    assert made(elsewhere) is made(humanoid)
    assert made(other) is not made(humanoid)


def test_right_limbs_have_another_colour_wherever_the_character_stands() -> None:
    humanoid = character("humanoid")
    for placed in (humanoid, humanoid.placed(Placement(1.0, 2.0, 0.0, 2.5))):
        colors = dict(zip((k.name for k in placed.links), skin_colors(placed), strict=True))
        for limb in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist"):
            assert colors[f"right_{limb}"] != colors[f"left_{limb}"] == colors["root"]
    assert len({tuple(skin_colors(humanoid, number)) for number in range(6)}) == 6


# In pictures

VIEW = CameraPose((0.0, 0.0, 0.72), distance=4.2, yaw=0.6, pitch=0.25)
SIZE = (160, 200)


def silhouette(picture: Picture) -> BoolArray:
    """Where there is not the background."""
    seen: BoolArray = (picture != picture[0, 0]).any(axis=2)
    return seen


def take(*, skinned: bool = True, ghost_at: float | None = None) -> Picture:
    """The humanoid at rest, its ghost so many m to its left."""
    humanoid = character("humanoid")
    rest = np.array(humanoid.rest_position)
    ghost = None if ghost_at is None else rest + ghost_at * np.eye(len(rest))[1]
    camera = Renderer(humanoid, ground=False, skinned=skinned)
    return camera.picture(FrameSpec(rest, VIEW, ghost=ghost), SIZE)


def test_a_picture_shows_the_skin_where_the_shapes_are_and_between_them() -> None:
    ours, theirs = silhouette(take()), silhouette(take(skinned=False))

    assert (ours & theirs).sum() > 0.95 * theirs.sum()
    assert 1.05 * theirs.sum() < ours.sum() < 1.5 * theirs.sum()


def test_a_reference_in_the_same_place_is_a_line_along_the_edge_of_the_body() -> None:
    alone = take()
    body = silhouette(alone)
    inner = body.copy()
    for axis, step in product((0, 1), range(-3, 4)):
        inner &= np.roll(body, step, axis)

    changed = (take(ghost_at=0.0) != alone).any(axis=2)

    assert (changed & inner).sum() < 0.03 * inner.sum()  # around gaps that are less than a pixel
    assert (changed & body).sum() > 0.8 * (body & ~inner).sum() / 3.0


def test_a_reference_beside_the_body_tints_what_is_free_and_no_more_of_the_body_than_a_line() -> (
    None
):
    alone = take()
    body = silhouette(alone)

    changed = (take(ghost_at=0.1) != alone).any(axis=2)

    assert (changed & ~body).sum() > 0.2 * body.sum()
    assert 0 < (changed & body).sum() < 0.25 * body.sum()
