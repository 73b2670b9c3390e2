"""The description of a character, as ROS' own URDF parser reads it (`urdf_parser_py`)."""

import math
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest
from urdf_parser_py import urdf as ros

from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointType
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character, ShapeType
from msgs_config.character.urdf.described_joints import DescribedJoints, pose_rows
from msgs_config.character.urdf.robot_description import robot_description
from msgs_config.geometry import rotations
from tests.support import urdf
from tests.support.description import about, link_frames, origin_matrix, parse
from tests.support.physics import DATA, FLOATING_TURNED_FRAMES

DESCRIBED = ["franka_panda", "kuka", "laikago", "lift", "pendulum"]
MADE = ["humanoid", FLOATING_TURNED_FRAMES]  # ball joints, capsules or a scale
FIXED_Y_UP = str(DATA / "turned_frames_fixed_y_up.yaml")
TYPES = {
    JointType.REVOLUTE: ("revolute", "continuous"),
    JointType.PRISMATIC: ("prismatic",),
    JointType.FIXED: ("fixed",),
}


@pytest.fixture(scope="module", params=DESCRIBED)
def character(request: pytest.FixtureRequest) -> Character:
    return load_character(request.param)


def parsed(character: Character, base_frame: str = "base_link") -> ros.Robot:
    return parse(robot_description(character, base_frame))


def test_the_description_has_the_characters_links_and_joints(character: Character) -> None:
    robot = parsed(character)

    assert robot.links[0].name == "base_link"
    assert {link.name for link in robot.links[1:]} == {link.name for link in character.links}
    assert robot.get_root() == "base_link"
    assert robot.child_map["base_link"] == [("base_link_joint", character.links[0].name)]
    assert robot.joint_map["base_link_joint"].type == "fixed"
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

    robot = parsed(load_character(str(tmp_path / "block.urdf")))
    assert [link.name for link in robot.links] == ["base_link", "block"]


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
ORIGIN = '<origin xyz="{}" rpy="{}"/>'
CAPSULE = '<collision><geometry><capsule radius="1" length="3"/></geometry></collision>'
NO_URDF = {
    "a ball joint": LINKS + urdf.joint("j", "a", "b", "spherical"),
    "a capsule": urdf.link("a", CAPSULE),
    "a limit without effort": LINKS
    + urdf.joint("j", "a", "b", limit='<limit lower="-1" upper="1"/>'),
}
LEGAL_TYPES = {"revolute", "continuous", "prismatic", "fixed"}


@pytest.mark.parametrize("case", NO_URDF)
def test_what_urdf_does_not_know_is_described_in_its_words(tmp_path: Path, case: str) -> None:
    path = urdf.write_character(tmp_path, urdf.robot(NO_URDF[case]))

    robot = parsed(load_character(str(path)))

    assert {joint.type for joint in robot.joints} <= LEGAL_TYPES
    for joint in robot.joints:
        if joint.limit is not None:
            assert joint.limit.effort >= 0.0 and joint.limit.velocity > 0.0
    if case == "a capsule":
        (link,) = [link for link in robot.links if link.name == "a"]
        kinds = [type(part.geometry) for part in link.collisions]
        assert kinds == [ros.Cylinder, ros.Sphere, ros.Sphere]
        assert [part.origin.xyz[2] for part in link.collisions] == [0.0, 1.5, -1.5]


def test_a_character_of_another_size_than_its_urdf_is_described_in_its_own(tmp_path: Path) -> None:
    box = '<collision><geometry><box size="1 2 3"/></geometry></collision>'
    text = urdf.robot(urdf.link("block", box))

    robot = parsed(load_character(str(urdf.write_character(tmp_path, text, "scale: 2\n"))))

    assert robot.link_map["block"].collisions[0].geometry.size == [2.0, 4.0, 6.0]


# Where the description has the links


@pytest.mark.parametrize("name", [*DESCRIBED, *MADE, FIXED_Y_UP])
def test_the_described_joints_put_links_where_the_dynamics_have_them(name: str) -> None:
    whole = load_character(name)
    rng = np.random.default_rng(2)
    joints, model = DescribedJoints(whole), DynamicsModel(whole)
    robot = parsed(whole)
    for scale in (0.0, 0.3, 1.0, 3.0):
        position = scale * rng.uniform(-1.0, 1.0, whole.layout.size)
        model.update(position, np.zeros(whole.layout.size))
        origins, turns = model.link_poses()

        values = dict(
            zip(
                (joint.name for joint in joints.moving),
                joints.positions(position).tolist(),
                strict=True,
            )
        )

        moving = {name for name, joint in robot.joint_map.items() if joint.type != "fixed"}
        assert values.keys() == moving
        frames = link_frames(robot, values)
        root = frames[whole.links[0].name]
        for link, origin, turn in zip(whole.links, origins, turns, strict=True):
            found = np.linalg.inv(root) @ frames[link.name]
            expected = np.eye(4)
            expected[:3, :3] = rotations.matrix(rotations.multiply(_back(turns[0]), turn))
            expected[:3, 3] = rotations.rotate(_back(turns[0]), origin - origins[0])
            np.testing.assert_allclose(found, expected, atol=1e-6 if name in DESCRIBED else 1e-9)


def _back(turn: np.ndarray) -> np.ndarray:
    return rotations.conjugate(turn)


FRAMES = urdf.robot(
    urdf.link("base", "")
    + urdf.link("trunk")
    + urdf.link("camera_mount", "")
    + urdf.link("camera", "")
    + urdf.link("arm")
    + urdf.link("wheel", "")
    # the frame within a frame comes before it, and both turn and move
    + urdf.joint("look", "camera_mount", "camera", "fixed", ORIGIN.format("0 0 1", "0.3 0 1"), "")
    + urdf.joint("mount", "trunk", "camera_mount", "fixed", ORIGIN.format("1 0 0", "1 2 3"), "")
    + urdf.joint("torso", "base", "trunk", "fixed", ORIGIN.format("0 0.5 0", "0 0 0.7"), "")
    + urdf.joint("elbow", "trunk", "arm", "continuous", ORIGIN.format("0 2 0", "0 1 0"))
    + urdf.joint("axle", "arm", "wheel", "continuous", ORIGIN.format("0 0 3", "1 0 0"))
)


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_links_that_are_parts_of_others_are_frames_of_the_description(
    tmp_path: Path, scale: float
) -> None:
    """Of a camera, of a base that takes its trunk's mass, of a wheel that weighs nothing."""
    whole = load_character(str(urdf.write_character(tmp_path, FRAMES, f"scale: {scale}\n")))
    assert {link.name for link in whole.links} == {"base", "arm"}
    joints = DescribedJoints(whole)
    expected = link_frames(parse(FRAMES), {"elbow": 0.4, "axle": 0.0})
    robot = parsed(whole)

    described = link_frames(robot, {"elbow": 0.4})
    frames = {joints.root: np.eye(4)}
    (pose,) = joints.poses(np.array([0.4]))
    rows = {
        joint.child: row for joint, row in zip(joints.fixed, pose_rows(joints.fixed), strict=True)
    }
    for joint in joints.joints:  # parents first
        row = rows.get(joint.child, pose)
        own = np.eye(4)
        own[:3, :3], own[:3, 3] = rotations.matrix(row[3:]), row[:3]
        frames[joint.child] = frames[joint.parent] @ own

    assert frames.keys() == described.keys() == expected.keys() | {"base_link"}
    for name, matrix in expected.items():
        matrix[:3, 3] *= scale
        np.testing.assert_allclose(frames[name], matrix, atol=1e-12, err_msg=name)
        np.testing.assert_allclose(described[name], matrix, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("name", MADE)
def test_the_poses_of_the_joints_are_those_of_the_description(name: str) -> None:
    whole = load_character(name)
    position = np.random.default_rng(5).uniform(-2.0, 2.0, whole.layout.size)
    joints = DescribedJoints(whole)
    values = joints.positions(position)
    robot = parsed(whole)
    frames = link_frames(
        robot, dict(zip((joint.name for joint in joints.moving), values.tolist(), strict=True))
    )

    for joint, pose in zip(joints.moving, joints.poses(values), strict=True):
        found = np.eye(4)
        found[:3, :3], found[:3, 3] = rotations.matrix(pose[3:]), pose[:3]
        expected = np.linalg.inv(frames[joint.parent]) @ frames[joint.child]
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_the_base_is_z_up_and_x_forward_where_the_model_is_y_up() -> None:
    whole = load_character("humanoid")  # which looks along x, y-up
    robot = parsed(whole)

    turn = origin_matrix(robot.joint_map["base_link_joint"].origin)[:3, :3]

    np.testing.assert_allclose(turn @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(turn @ [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], atol=1e-12)
    standing = link_frames(robot, {joint.name: 0.0 for joint in robot.joints})
    head, foot = standing["neck"][:3, 3], standing["left_ankle"][:3, 3]
    assert head[2] > 0.2 and foot[2] < -0.7  # above and below the pelvis
    assert standing["left_shoulder"][1, 3] > 0.1 > -0.1 > standing["right_shoulder"][1, 3]


def test_a_link_that_has_the_base_frames_name_is_no_second_one(tmp_path: Path) -> None:
    path = urdf.write_character(tmp_path, urdf.robot(urdf.link("base_link")))
    whole = load_character(str(path))

    assert [link.name for link in parsed(whole).links] == ["base_link"]
    assert [link.name for link in parsed(whole, "torso").links] == ["torso", "base_link"]


def test_names_of_the_joints_of_a_ball_give_way_to_those_that_are_there(tmp_path: Path) -> None:
    content = LINKS + urdf.link("b_yaw") + urdf.joint("j", "a", "b", "spherical")
    content += urdf.joint("j_yaw", "b", "b_yaw")
    whole = load_character(str(urdf.write_character(tmp_path, urdf.robot(content))))

    robot = parsed(whole)

    names = [joint.name for joint in robot.joints], [link.name for link in robot.links]
    assert all(len(set(each)) == len(each) for each in names)
    assert robot.joint_map["j_yaw"].child == "b_yaw"


def test_the_description_has_the_humanoids_masses() -> None:
    whole = load_character("humanoid")
    robot = parsed(whole)

    for link in whole.links:
        inertial = robot.link_map[link.name].inertial
        assert inertial.mass == link.mass
        tensor = inertial.inertia
        assert (tensor.ixx, tensor.iyy, tensor.izz) == link.inertia_diagonal
    sensors = {sensor.name for sensor in whole.sensors}
    assert {link.name for link in robot.links if link.inertial is None} == {
        "base_link"
    } | sensors | {
        f"{name}_{angle}"
        for name in whole.layout.actuated_joint_names
        if whole.layout.joint(name).type is JointType.SPHERICAL
        for angle in ("yaw", "pitch")
    }


# Yaw, pitch and roll

STRAIGHT = [(0.3, sign * 0.5 * math.pi, roll) for sign in (-1.0, 1.0) for roll in (0.0, 1.0, -2.5)]


@pytest.mark.parametrize(
    "angles", [(0.0, 0.0, 0.0), (3.0, -1.5, 2.0), (-1.0, 1.57, 3.0), *STRAIGHT]
)
def test_yaw_pitch_and_roll_are_the_rotation_also_where_the_pitch_is_a_quarter_turn(
    angles: tuple[float, float, float],
) -> None:
    def matrix(yaw: float, pitch: float, roll: float) -> np.ndarray:
        turned: np.ndarray = (
            about((0, 0, 1), yaw) @ about((0, 1, 0), pitch) @ about((1, 0, 0), roll)
        )
        return turned

    yaw, pitch, roll = angles
    vectors = np.array([[0.0, 0.0, yaw], [0.0, pitch, 0.0], [roll, 0.0, 0.0]])
    about_z, about_y, about_x = rotations.exp(vectors)
    turn = rotations.multiply(rotations.multiply(about_z, about_y), about_x)

    found = rotations.yaw_pitch_roll(rotations.matrix(turn))

    np.testing.assert_allclose(matrix(*found.tolist()), matrix(*angles), atol=1e-12)
    assert abs(found[1]) <= 0.5 * math.pi + 1e-12


def test_the_description_has_what_is_simulated_not_what_the_file_says(tmp_path: Path) -> None:
    """Effort limits of the character's file, masses and inertia that the URDF lacks, its axes."""
    ball = '<inertial><mass value="2"/></inertial>'
    parts = urdf.link("world", ""), urdf.link("arm", ball), urdf.link("hand", ball)
    hinge = urdf.joint("hinge", "world", "arm", inside='<axis xyz="0 3 0"/><axis xyz="1 0 0"/>')
    weld = urdf.joint("weld", "arm", "hand", limit='<limit lower="1" upper="1" effort="1"/>')
    yaml = "inertia: filled\njoints: {hinge: {effort_limit: 7}}\n"
    character = load_character(
        str(urdf.write_character(tmp_path, urdf.robot(*parts, hinge, weld, "<gazebo/>"), yaml))
    )

    text = robot_description(character)

    robot = parse(text)
    assert robot.joint_map["weld"].type == "fixed"
    assert robot.joint_map["hinge"].axis == [0.0, 1.0, 0.0]
    assert robot.joint_map["hinge"].limit.effort == 7.0
    assert (text.count("<axis"), text.count("<gazebo")) == (1, 0)
    for link in character.links[1:]:
        inertia = robot.link_map[link.name].inertial
        assert (inertia.mass, inertia.inertia.ixx) == (2.0, link.inertia_diagonal[0])


def test_a_mass_is_described_once_where_the_base_took_it(tmp_path: Path) -> None:
    parts = urdf.link("base", ""), urdf.link("trunk"), urdf.link("arm")
    fixed = urdf.joint("mount", "base", "trunk", "fixed", limit="")
    path = urdf.write_character(
        tmp_path, urdf.robot(*parts, fixed, urdf.joint("hinge", "trunk", "arm"))
    )

    robot = parse(robot_description(load_character(str(path))))

    masses = {link.name: link.inertial.mass for link in robot.links if link.inertial}
    assert masses == {"trunk": 1.0, "arm": 1.0}
