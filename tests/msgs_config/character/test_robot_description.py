"""The description of a character, as ROS' own URDF parser reads it (`urdf_parser_py`)."""

import math
from collections.abc import Iterator
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from urdf_parser_py import urdf as ros

from msgs_config.character.layout import JointType
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character, ShapeType
from msgs_config.character.robot_description import robot_description
from tests.support import urdf

DESCRIBED = ["franka_panda", "kuka", "laikago", "lift", "pendulum"]
TYPES = {
    JointType.REVOLUTE: ("revolute", "continuous"),
    JointType.PRISMATIC: ("prismatic",),
    JointType.FIXED: ("fixed",),
}


@pytest.fixture(scope="module", params=DESCRIBED)
def character(request: pytest.FixtureRequest) -> Character:
    return load_character(request.param)


def parsed(character: Character) -> ros.Robot:
    text = robot_description(character)
    assert text is not None
    with redirect_stderr(StringIO()):  # it names what is PyBullet's own, such as <contact>
        return ros.URDF.from_xml_string(text)


def test_the_description_has_the_characters_links_and_joints(character: Character) -> None:
    robot = parsed(character)

    assert {link.name for link in robot.links} == {link.name for link in character.links}
    assert robot.get_root() == character.links[0].name
    for link in character.links[1:]:
        joint = robot.joint_map[link.joint.name]
        assert joint.child == link.name
        assert joint.parent == character.links[link.parent].name
        assert joint.type in TYPES[link.joint.type]


def test_the_description_has_the_characters_limits_and_axes(character: Character) -> None:
    robot = parsed(character)

    for joint in (joint for joint in character.moving_joints if joint.name in robot.joint_map):
        described = robot.joint_map[joint.name]
        length = math.hypot(*described.axis)
        assert joint.axis_in_child == pytest.approx(
            [part / length for part in described.axis], abs=1e-6
        )
        if described.type != "continuous":
            assert (described.limit.lower, described.limit.upper) == (joint.lower, joint.upper)
        if described.limit is not None and joint.effort_limit != math.inf:
            assert described.limit.effort == joint.effort_limit


def test_the_description_puts_joints_where_the_character_has_them(character: Character) -> None:
    robot = parsed(character)

    for link in character.links[1:]:
        origin = robot.joint_map[link.joint.name].origin
        position = origin.xyz if origin is not None else (0.0, 0.0, 0.0)
        assert link.joint.pose_in_parent.position == pytest.approx(position, abs=1e-6)


def meshes(robot: ros.Robot) -> Iterator[str]:
    for link in robot.links:
        for part in (*link.visuals, *link.collisions):
            if isinstance(part.geometry, ros.Mesh):
                yield part.geometry.filename


def test_every_mesh_of_the_description_is_a_file(character: Character) -> None:
    names = list(meshes(parsed(character)))

    assert bool(names) == any(
        shape.type is ShapeType.MESH for link in character.links for shape in link.shapes
    )
    for name in names:
        uri = urlsplit(name)
        assert (uri.scheme, uri.netloc) == ("file", "")
        assert Path(unquote(uri.path)).is_file()


def test_limits_of_the_characters_file_are_in_its_description() -> None:
    robot = parsed(load_character("laikago"))

    knee = robot.joint_map["FL_lower_leg_2_upper_leg_joint"]
    assert (knee.type, knee.limit.lower, knee.limit.upper) == ("revolute", -2.164, 0.0)


def test_a_file_that_ends_in_a_nul_is_described_without_it(tmp_path: Path) -> None:
    (tmp_path / "block.urdf").write_bytes(b'<robot name="block"><link name="block"/></robot>\n\0')

    assert parsed(load_character(str(tmp_path / "block.urdf"))).get_root() == "block"


def test_a_path_with_blanks_is_escaped(tmp_path: Path) -> None:
    # Arrange
    folder = tmp_path / "my robot, 50%"
    folder.mkdir()
    (folder / "cube.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (folder / "block.urdf").write_text(
        '<robot name="block"><link name="block"><visual><geometry><mesh filename="cube.obj"/>'
        "</geometry></visual></link></robot>"
    )

    # Act
    (name,) = meshes(parsed(load_character(str(folder / "block.urdf"))))

    # Assert
    assert " " not in name
    assert Path(unquote(urlsplit(name).path)) == folder / "cube.obj"


LINKS = urdf.link("a") + urdf.link("b")
CAPSULE = '<collision><geometry><capsule radius="1" length="1"/></geometry></collision>'
NO_URDF = {
    "a ball joint": LINKS + urdf.joint("j", "a", "b", "spherical"),
    "a capsule": urdf.link("a", CAPSULE),
    "a limit without effort": LINKS
    + urdf.joint("j", "a", "b", limit='<limit lower="-1" upper="1"/>'),
}


@pytest.mark.parametrize("case", NO_URDF)
def test_what_urdf_does_not_know_has_no_description(tmp_path: Path, case: str) -> None:
    path = urdf.write_character(tmp_path, urdf.robot(NO_URDF[case]))

    assert robot_description(load_character(str(path))) is None


@pytest.mark.parametrize("yaml", ["scale: 2\n", ""])
def test_a_character_of_another_size_than_its_urdf_has_no_description(
    tmp_path: Path, yaml: str
) -> None:
    character = load_character(
        str(urdf.write_character(tmp_path, urdf.robot(urdf.link("block")), yaml))
    )

    assert (robot_description(character) is None) == bool(yaml)


def test_the_humanoid_has_no_description() -> None:
    assert robot_description(load_character("humanoid")) is None
