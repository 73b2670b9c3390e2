"""The shapes that are seen of each link are those that the engine reads from the same URDF."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.loading import load_character
from msgs_config.character.model import Pose, Shape, ShapeType
from msgs_config.character.urdf.robot_description import robot_description
from msgs_config.geometry import rotations
from sim_node.physics.bullet.c_library import captured_output
from tests.support.engines import Engine, pybullet
from tests.support.urdf import refusal

ROBOTS = [
    ("humanoid/humanoid.urdf", 1.0),
    ("humanoid/humanoid.urdf", 0.25),
    ("franka_panda/panda.urdf", 1.0),
    ("kuka_iiwa/model.urdf", 1.0),
    ("kuka_iiwa/model.urdf", 2.0),
    ("laikago/laikago_toes_zup.urdf", 1.0),
    ("r2d2.urdf", 1.0),
    ("r2d2.urdf", 0.5),
    ("cartpole.urdf", 1.0),
    ("racecar/racecar.urdf", 1.0),
]
TYPES = {
    pybullet.GEOM_SPHERE: ShapeType.SPHERE,
    pybullet.GEOM_BOX: ShapeType.BOX,
    pybullet.GEOM_CYLINDER: ShapeType.CYLINDER,
    pybullet.GEOM_MESH: ShapeType.MESH,
    pybullet.GEOM_CAPSULE: ShapeType.CAPSULE,
}
GREY = Shape(ShapeType.SPHERE, (1.0,)).color_rgba


@dataclass(frozen=True)
class EngineShape:
    """A visual shape as the engine reports it, in the link frame."""

    type: ShapeType
    size: tuple[float, ...]
    mesh: str
    position: FloatArray
    turn_xyzw: FloatArray
    color_rgba: tuple[float, ...]


def engine_shapes(path: str, scale: float) -> dict[str, list[EngineShape]]:
    """The visual shapes of each link by its name, from the engine's own reading of the file."""
    client = Engine()
    with captured_output():
        body = pybullet.loadURDF(path, globalScaling=scale, physicsClientId=client)
    names = {-1: pybullet.getBodyInfo(body, physicsClientId=client)[0].decode()}
    for index in range(pybullet.getNumJoints(body, physicsClientId=client)):
        names[index] = pybullet.getJointInfo(body, index, physicsClientId=client)[12].decode()
    shapes: dict[str, list[EngineShape]] = {name: [] for name in names.values()}
    for data in pybullet.getVisualShapeData(body, physicsClientId=client):
        _, link, kind, size, mesh, position, turn, color = data[:8]
        shape = EngineShape(
            TYPES[kind],
            in_our_order(TYPES[kind], size),
            mesh.decode(),
            np.array(position),
            np.array(turn),
            color,
        )
        shapes[names[link]].append(shape)
    client.close()
    return shapes


def in_our_order(kind: ShapeType, size: tuple[float, ...]) -> tuple[float, ...]:
    """The engine gives radius first for a sphere only, and the length of other round shapes."""
    if kind is ShapeType.SPHERE:
        return size[:1]
    if kind in (ShapeType.CYLINDER, ShapeType.CAPSULE):
        return (size[1], size[0])
    return size


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "scale"), ROBOTS)
def test_shapes_are_those_of_the_engine(tmp_path: Path, robot: str, scale: float) -> None:
    # Arrange
    urdf = f"package://pybullet_data/{robot}"
    (tmp_path / "robot.yaml").write_text(f"urdf: {urdf}\nscale: {scale}\njoint_damping: none\n")

    # Act
    character = load_character(str(tmp_path / "robot.yaml"))

    # Assert
    expected = engine_shapes(str(character.loading.urdf_path), scale)
    assert any(link.shapes for link in character.links)
    for link in character.links:
        if not expected[link.name]:
            continue  # the engine says nothing of a link without a visual shape
        assert len(link.shapes) == len(expected[link.name])
        for shape, other in zip(link.shapes, expected[link.name], strict=True):
            assert shape.type is other.type
            assert shape.size == pytest.approx(other.size, rel=1e-6)
            if shape.type is ShapeType.MESH:
                assert Path(shape.mesh).samefile(other.mesh)
            assert shape.pose.position == pytest.approx(other.position, abs=1e-6)
            turn = np.array(shape.pose.orientation_xyzw)
            assert rotations.angle_between(turn, other.turn_xyzw) < 1e-6
            if shape.color_rgba != GREY:
                assert shape.color_rgba == pytest.approx(other.color_rgba, abs=1e-6)


def test_colours_come_from_materials_within_a_link_and_by_name() -> None:
    robot = load_character("package://pybullet_data/r2d2.urdf")
    shapes = {link.name: link.shapes for link in robot.links}

    assert shapes["base_link"][0].color_rgba == (0.0, 0.0, 0.8, 1.0)
    assert shapes["right_base"][0].color_rgba == (1.0, 1.0, 1.0, 1.0)


URDF = """
<robot name="block">
  <material name="paint"><color rgba="0.1 0.2 0.3 0.4"/></material>
  <link name="block">
    <inertial><mass value="1"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    {parts}
  </link>
</robot>
"""
BOX = '<geometry><box size="1 2 3"/></geometry>'


def shapes_of(directory: Path, parts: str) -> tuple[Shape, ...]:
    """The shapes of a link that has these parts."""
    path = directory / "block.urdf"
    path.write_text(URDF.format(parts=parts))
    return load_character(str(path)).links[0].shapes


def test_a_link_without_visual_shapes_shows_what_it_collides_with(tmp_path: Path) -> None:
    (shape,) = shapes_of(tmp_path, f'<collision><origin xyz="1 0 0"/>{BOX}</collision>')

    assert shape == Shape(ShapeType.BOX, (1.0, 2.0, 3.0), Pose((1.0, 0.0, 0.0)))


def test_visual_shapes_hide_collision_shapes(tmp_path: Path) -> None:
    visual = '<visual><geometry><sphere radius="0.5"/></geometry><material name="paint"/></visual>'

    (shape,) = shapes_of(tmp_path, f"<collision>{BOX}</collision>{visual}")

    assert shape == Shape(ShapeType.SPHERE, (0.5,), color_rgba=(0.1, 0.2, 0.3, 0.4))


def test_a_link_may_have_no_shape(tmp_path: Path) -> None:
    assert shapes_of(tmp_path, "") == ()


MALFORMED = {
    "no geometry": ("<visual/>", "<visual> has nothing for a shape"),
    "an empty geometry": ("<visual><geometry/></visual>", "<visual> has nothing"),
    "a cone": ("<visual><geometry><cone/></geometry></visual>", "<cone> for a shape"),
    "a box of no size": ("<visual><geometry><box/></geometry></visual>", "size of <box>"),
    "a flat list": (
        '<visual><geometry><box size="1 2"/></geometry></visual>',
        "it must be 3 finite numbers",
    ),
    "a negative radius": (
        '<visual><geometry><sphere radius="-1"/></geometry></visual>',
        "at least 0",
    ),
    "a colour of three": (
        f'<visual>{BOX}<material name="x"><color rgba="1 1 1"/></material></visual>',
        "it must be 4 finite numbers",
    ),
    "a colour of none": (
        f'<visual>{BOX}<material name="x"><color/></material></visual>',
        "rgba of <color>",
    ),
}


@pytest.mark.parametrize("color", ["1 1 1", "red", "1 1 1 nan"])
def test_a_malformed_colour_of_a_material_is_refused(tmp_path: Path, color: str) -> None:
    path = tmp_path / "block.urdf"
    path.write_text(URDF.format(parts="").replace("0.1 0.2 0.3 0.4", color))

    assert "material 'paint': rgba of <color>" in refusal(path)


def test_what_is_not_in_a_link_may_be_anything(tmp_path: Path) -> None:
    """As the elements are that other programs read."""
    other = '<gazebo><mesh filename="x"/><material>Grey<color rgba="grey"/></material></gazebo>'
    path = tmp_path / "block.urdf"
    path.write_text(URDF.format(parts="").replace("</link>", f"</link>{other}"))

    character = load_character(str(path))

    assert character.links[0].shapes == ()
    assert robot_description(character) is not None


@pytest.mark.parametrize("case", MALFORMED)
def test_a_malformed_shape_is_refused_in_one_line(tmp_path: Path, case: str) -> None:
    parts, words = MALFORMED[case]

    (tmp_path / "block.urdf").write_text(URDF.format(parts=parts))

    line = refusal(tmp_path / "block.urdf")

    assert str(tmp_path / "block.urdf") in line
    assert "'block'" in line
    assert words in line
