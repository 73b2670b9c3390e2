"""What is drawn of a character: shapes that the renderer can draw, their extents and colours."""

from itertools import pairwise
from math import pi
from pathlib import Path

import numpy as np
import pytest

from actuated_characters.render.drawn_shapes import branch_colors, drawn_shapes
from actuated_characters.render.engine.outlines import outline
from actuated_characters.render.engine.surfaces import round_surface
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character, Pose, Shape, ShapeType
from tests.support.physics import character

RADIUS, LENGTH = 0.3, 1.1
VOLUMES = {
    Shape(ShapeType.SPHERE, (RADIUS,)): 4.0 / 3.0 * pi * RADIUS**3,
    Shape(ShapeType.CYLINDER, (RADIUS, LENGTH)): pi * RADIUS**2 * LENGTH,
    Shape(ShapeType.CAPSULE, (RADIUS, LENGTH)): pi * RADIUS**2 * (LENGTH + 4.0 / 3.0 * RADIUS),
}
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 0\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\n"


def one_link(folder: Path, content: str) -> Character:
    """A character of one link."""
    path = folder / "thing.urdf"
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    path.write_text(
        f'<robot name="thing"><link name="thing">{mass}</inertial>{content}</link></robot>'
    )
    return load_character(str(path))


# Round surfaces


@pytest.mark.parametrize("shape", VOLUMES, ids=lambda shape: shape.type.value)
def test_a_round_surface_encloses_the_volume_of_its_shape(shape: Shape) -> None:
    vertices, _, triangles = round_surface(shape)

    corners = vertices[triangles]
    # by Gauss's theorem, of tetrahedra with the origin: positive if the corners turn the right way
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert 0.95 * VOLUMES[shape] < volume < VOLUMES[shape]


@pytest.mark.parametrize("shape", VOLUMES, ids=lambda shape: shape.type.value)
def test_the_normals_of_a_round_surface_point_outwards(shape: Shape) -> None:
    vertices, normals, triangles = round_surface(shape)

    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    corners = vertices[triangles]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    solid = np.linalg.norm(facing, axis=1) > 1e-12  # at a pole, triangles have no area
    turned = np.einsum("ij,ikj->ik", facing[solid], normals[triangles][solid])
    assert (turned > 0.0).all()


@pytest.mark.parametrize("shape", VOLUMES, ids=lambda shape: shape.type.value)
def test_an_outline_holds_the_surface_wherever_the_shape_lies(shape: Shape) -> None:
    x = np.sin(0.5)
    moved = Shape(shape.type, shape.size, Pose((1.0, 2.0, 3.0), (x, 0.0, 0.0, np.cos(0.5))))
    # turned about x by 1 rad
    turn = np.array([(1, 0, 0), (0, np.cos(1), -np.sin(1)), (0, np.sin(1), np.cos(1))])
    vertices = round_surface(shape).vertices @ turn.T + (1.0, 2.0, 3.0)

    centres, radii = outline(moved)

    along_z = vertices[:, 2]
    assert (centres[:, 2] - radii).min() <= along_z.min() + 1e-9
    assert (centres[:, 2] + radii).max() >= along_z.max() - 1e-9
    assert (centres[:, 0] + radii).max() == pytest.approx(vertices[:, 0].max(), abs=1e-9)


# Meshes


def test_the_outline_of_a_mesh_is_the_box_around_its_vertices_scaled(tmp_path: Path) -> None:
    (tmp_path / "square.obj").write_text(SQUARE)
    seen = '<visual><geometry><mesh filename="square.obj" scale="2 3 1"/></geometry></visual>'
    ((shape,),) = drawn_shapes(one_link(tmp_path, seen))

    corners, radii = outline(shape)

    np.testing.assert_array_equal(
        (corners.min(axis=0), corners.max(axis=0)), [(0, 0, 0), (2, 6, 0)]
    )
    assert not radii.any()


def test_the_outline_of_an_stl_file_is_that_of_the_same_obj_file() -> None:
    (shapes,) = {link.shapes for link in character("kuka").links if link.name == "lbr_iiwa_link_3"}
    kuka = Path(shapes[0].mesh)
    stl, obj = (
        Shape(ShapeType.MESH, (1.0, 1.0, 1.0), mesh=str(kuka.with_suffix(suffix)))
        for suffix in (".stl", ".obj")
    )

    np.testing.assert_allclose(outline(stl)[0], outline(obj)[0], atol=1e-3)


def test_where_a_mesh_cannot_be_read_the_link_looks_like_what_it_collides_with(
    tmp_path: Path,
) -> None:
    (tmp_path / "seen.dae").write_text("<COLLADA/>")
    seen = '<visual><geometry><mesh filename="seen.dae"/></geometry></visual>'
    collides = '<collision><geometry><box size="1 2 3"/></geometry></collision>'

    ((shape,),) = drawn_shapes(one_link(tmp_path, seen + collides))

    assert (shape.type, shape.size) == (ShapeType.BOX, (1.0, 2.0, 3.0))


def test_a_character_without_any_shape_is_a_point_for_each_link(tmp_path: Path) -> None:
    ((shape,),) = drawn_shapes(one_link(tmp_path, ""))

    assert shape.type is ShapeType.SPHERE


def test_a_shape_of_no_size_is_left_out() -> None:
    laikago = character("laikago")
    toes = [row for row, link in enumerate(laikago.links) if link.name.startswith("toe")]
    assert any(min(shape.size) == 0.0 for row in toes for shape in laikago.links[row].shapes)

    drawn = drawn_shapes(laikago)

    assert all(min(shape.size) > 0.0 for shapes in drawn for shape in shapes)


# Colours


def test_arms_and_legs_of_a_humanoid_have_a_colour_each() -> None:
    humanoid = character("humanoid")
    colors = dict(zip((link.name for link in humanoid.links), branch_colors(humanoid), strict=True))

    limbs = [colors[f"{side}_{limb}"] for side in ("left", "right") for limb in ("hip", "shoulder")]
    assert len(set(limbs)) == 4


def test_a_link_can_be_told_from_its_parent() -> None:
    for name in ("humanoid", "laikago", "lift"):
        whole = character(name)
        colors = branch_colors(whole)
        for row, link in enumerate(whole.links):
            if link.parent >= 0 and link.joint.type.suffixes:
                assert colors[row] != colors[link.parent], (name, link.name)


def test_colours_that_a_urdf_gives_are_kept() -> None:
    kuka = character("kuka")

    drawn = [shape.color_rgba for shapes in drawn_shapes(kuka) for shape in shapes]

    assert drawn == [shape.color_rgba for link in kuka.links for shape in link.shapes]
    assert any(a != b for a, b in pairwise(drawn))
