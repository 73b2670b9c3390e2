"""The shapes of a terrain, against what ROS' own parser finds and against geometry."""

from pathlib import Path

import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Shape, ShapeType, UrdfOptions
from msgs_config.character.terrain import terrain_shapes
from msgs_config.errors import CharacterError
from msgs_config.geometry import rotations
from tests.support.description import link_frames, origin_matrix, parse

POSE = '<origin xyz="{0} 0.2 0.3" rpy="{0} -0.4 0.7"/>'
LINKS = "".join(
    f'<link name="{name}"><collision>{POSE.format(x)}<geometry>{shape}</geometry></collision>'
    '<visual><geometry><sphere radius="9"/></geometry></visual></link>'
    for name, x, shape in (
        ("tip", 0.1, '<sphere radius="0.3"/>'),
        ("base", 0.2, '<box size="1 2 3"/>'),
        ("arm", 0.3, '<cylinder radius="0.1" length="0.5"/>'),
    )
)
JOINTS = "".join(
    f'<joint name="{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
    f'{POSE.format(0.9)}<axis xyz="0 1 0"/><limit effort="1" velocity="1" lower="-1" upper="1"/>'
    "</joint>"
    for parent, child, kind in (("arm", "tip", "revolute"), ("base", "arm", "fixed"))
)


def terrain(folder: Path, content: str, scale: float = 1.0) -> list[Shape]:
    text = f'<robot name="ground">{content}</robot>'
    return terrain_shapes(UrdfOptions(folder / "ground.urdf", text, scale=scale, fixed_base=True))


def matrix(shape: Shape) -> FloatArray:
    whole = np.eye(4)
    whole[:3, :3] = rotations.matrix(np.array(shape.pose.orientation_xyzw))
    whole[:3, 3] = shape.pose.position
    return whole


@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_shapes_that_collide_lie_where_the_links_are(tmp_path: Path, scale: float) -> None:
    robot = parse(f'<robot name="ground">{LINKS}{JOINTS}</robot>')
    frames = link_frames(robot, {"tip": 0.0})

    found = terrain(tmp_path, LINKS + JOINTS, scale)

    kinds = {ShapeType.SPHERE: "tip", ShapeType.BOX: "base", ShapeType.CYLINDER: "arm"}
    assert sorted(kinds[shape.type] for shape in found) == ["arm", "base", "tip"]
    for shape in found:
        (collision,) = robot.link_map[kinds[shape.type]].collisions
        expected = frames[kinds[shape.type]] @ origin_matrix(collision.origin)
        expected[:3, 3] *= scale
        np.testing.assert_allclose(matrix(shape), expected, atol=1e-12)
        if shape.type is ShapeType.BOX:
            assert shape.size == pytest.approx((scale, 2.0 * scale, 3.0 * scale))


@pytest.mark.parametrize("normal", ["0 0 1", "0 0 -2", "1 2 3"])
def test_a_plane_is_the_upper_side_of_a_large_box(tmp_path: Path, normal: str) -> None:
    shape = f'<geometry><plane normal="{normal}"/></geometry>'

    (box,) = terrain(
        tmp_path, f'<link name="a"><collision><origin xyz="1 2 3"/>{shape}</collision></link>'
    )

    assert box.type is ShapeType.BOX and min(box.size[:2]) >= 100.0
    upwards = np.array([float(part) for part in normal.split()])
    upwards /= np.linalg.norm(upwards)
    np.testing.assert_allclose(matrix(box)[:3, 2], upwards, atol=1e-12)
    upper = matrix(box) @ (0.0, 0.0, 0.5 * box.size[2], 1.0)
    np.testing.assert_allclose(upper[:3], (1.0, 2.0, 3.0), atol=1e-12)


def test_a_terrain_without_links_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CharacterError, match=r"ground\.urdf: not a usable URDF: it has no link"):
        terrain(tmp_path, "")
