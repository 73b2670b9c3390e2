"""Characters: what ships is what the design says, and a bad file gets one clear line.

The URDF's own text, read by Python's XML parser, is the judge of what the loader makes of it.
"""

import math
import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from msgs_config import files
from msgs_config.arrays import FloatArray
from msgs_config.character.file import CHARACTERS_DIRECTORY, shipped_characters
from msgs_config.character.layout import JointType
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character, Gains, SoftLimit
from msgs_config.geometry.rotations import matrix
from tests.support.urdf import inertial, joint, link, load_elsewhere, refusal, robot

SHIPPED = shipped_characters()
NAMES = ", ".join(SHIPPED)
HUMANOID_JOINTS = {  # as the engine's URDF lists them, each limb from the trunk outwards
    "chest": 3,
    "neck": 3,
    "right_shoulder": 3,
    "right_elbow": 1,
    "left_shoulder": 3,
    "left_elbow": 1,
    "right_hip": 3,
    "right_knee": 1,
    "right_ankle": 3,
    "left_hip": 3,
    "left_knee": 1,
    "left_ankle": 3,
}
BASE_DOFS = ("root_x", "root_y", "root_z", "root_rx", "root_ry", "root_rz")

URDF = (CHARACTERS_DIRECTORY / "lift.urdf").read_text()
PREAMBLE = "urdf: lift.urdf\nfixed_base: true\ninertia: file\n"

WriteCharacter = Callable[..., Path]


@pytest.fixture(scope="module", params=SHIPPED)
def character(request: pytest.FixtureRequest) -> Character:
    return load_character(request.param)


@pytest.fixture(scope="module")
def humanoid() -> Character:
    return load_character("humanoid")


@pytest.fixture
def write(tmp_path: Path) -> WriteCharacter:
    """Writes a character's file, and the URDF `lift.urdf` beside it; returns the file's path."""

    def write_files(yaml_text: str, urdf: str = URDF) -> Path:
        path = tmp_path / "custom.yaml"
        path.write_text(yaml_text, encoding="utf-8")
        (tmp_path / "lift.urdf").write_text(urdf, encoding="utf-8")
        return path

    return write_files


# What ships


def test_the_humanoid_has_34_entries_of_which_28_have_motors(humanoid: Character) -> None:
    layout = humanoid.layout
    expected = list(BASE_DOFS)
    for name, entries in HUMANOID_JOINTS.items():
        expected += [name] if entries == 1 else [f"{name}_{axis}" for axis in "xyz"]

    assert list(layout.dof_names) == expected
    assert layout.size == 34
    assert layout.has_floating_base
    assert layout.mask(layout.actuated_joint_names).sum() == 28


def test_the_humanoid_weighs_45_kg(humanoid: Character) -> None:
    assert humanoid.mass == pytest.approx(45.0, abs=1e-3)


def test_the_humanoid_has_the_usual_limits_and_none_on_its_base(humanoid: Character) -> None:
    limits = dict(zip(humanoid.vector_names, humanoid.effort_limits(), strict=True))

    assert limits.pop("root") == limits.pop("root_r") == math.inf
    assert limits.pop("chest") == 200.0
    assert limits.pop("neck") == 50.0
    for side in ("left", "right"):
        expected = {"hip": 200, "knee": 150, "ankle": 90, "shoulder": 100, "elbow": 60}
        for name, limit in expected.items():
            assert limits.pop(f"{side}_{name}") == limit
    assert not limits


def test_the_humanoid_bends_knees_backwards_and_elbows_forwards_only(humanoid: Character) -> None:
    lower, upper = humanoid.position_bounds()
    for index, name in enumerate(humanoid.layout.dof_names):
        if name.endswith("_knee"):
            assert (lower[index], upper[index]) == (-3.14, 0.0)
        elif name.endswith("_elbow"):
            assert (lower[index], upper[index]) == (0.0, 3.14)
        else:
            assert (lower[index], upper[index]) == (-math.inf, math.inf)


def test_the_humanoid_stands_upright_with_straight_legs_and_its_soles_on_the_ground(
    humanoid: Character,
) -> None:
    urdf = ElementTree.fromstring(humanoid.loading.urdf_text.rstrip("\0 \n"))  # ends in a NUL
    below = ["joint[@name='right_hip']", "joint[@name='right_knee']", "joint[@name='right_ankle']"]
    heights = [y_of(urdf, f"{path}/origin", "xyz") for path in below]
    heights.append(y_of(urdf, "link[@name='right_ankle']/collision/origin", "xyz"))
    half_a_foot = 0.5 * y_of(urdf, "link[@name='right_ankle']/collision/geometry/box", "size")
    rest = dict(zip(humanoid.layout.dof_names, humanoid.rest_position, strict=True))

    sole_below_base = 0.25 * (half_a_foot - sum(heights))

    assert rest.pop("root_z") == pytest.approx(sole_below_base, abs=0.002)
    assert rest.pop("root_rx") == pytest.approx(0.5 * math.pi)  # y is up in the file
    assert not any(rest.values())


def y_of(urdf: ElementTree.Element, path: str, attribute: str) -> float:
    element = urdf.find(path)
    assert element is not None
    return float(element.attrib[attribute].split()[1])


def test_the_humanoid_has_the_root_assistance_of_the_lecture(humanoid: Character) -> None:
    assert humanoid.gains["root"] == Gains(stiffness=4000.0, damping=400.0)
    assert humanoid.gains["root_r"] == Gains(stiffness=1000.0, damping=100.0)


def test_the_arm_has_seven_hinges_and_two_fingers_within_the_limits_of_its_urdf() -> None:
    arm = load_character("franka_panda")
    elements = {
        element.get("name"): element
        for element in ElementTree.fromstring(arm.loading.urdf_text).iter("joint")
    }

    assert not arm.layout.has_floating_base
    kinds = [joint.type for joint in arm.moving_joints]
    assert kinds == [JointType.REVOLUTE] * 7 + [JointType.PRISMATIC] * 2
    assert arm.layout.size == 9
    for moving in arm.moving_joints:
        limit = elements[moving.name].find("limit")
        assert limit is not None
        assert moving.lower == float(limit.attrib["lower"])
        assert moving.upper == float(limit.attrib["upper"])
        assert moving.effort_limit == float(limit.attrib["effort"])


def test_the_lift_is_a_kilogram_on_a_vertical_slider_and_critically_damped() -> None:
    lift = load_character("lift")
    (slider,) = lift.moving_joints
    gains = lift.gains["height"]

    assert (slider.name, slider.type) == ("height", JointType.PRISMATIC)
    assert slider.axis_in_child == pytest.approx((0.0, 0.0, 1.0))
    assert lift.mass == pytest.approx(1.0)
    assert lift.rest_position == (1.0,)
    assert gains.damping == pytest.approx(2.0 * math.sqrt(gains.stiffness * lift.mass))


def test_the_pendulum_is_a_thin_rod_on_a_hinge_that_turns_for_ever() -> None:
    pendulum = load_character("pendulum")
    (hinge,) = pendulum.moving_joints
    rod = pendulum.links[-1]

    assert (hinge.name, hinge.type) == ("hinge", JointType.REVOLUTE)
    assert (hinge.lower, hinge.upper) == (-math.inf, math.inf)
    assert hinge.axis_in_child == pytest.approx((0.0, 1.0, 0.0))
    assert pendulum.mass == pytest.approx(1.0)
    assert rod.inertial_pose.position == pytest.approx((0.0, 0.0, -0.5))
    assert rod.inertia_diagonal[1] == pytest.approx(1.0 / 12.0)  # m l^2 / 12 about its middle


def test_every_array_of_a_character_fits_its_layout(character: Character) -> None:
    layout = character.layout
    lower, upper = character.position_bounds()

    assert len(character.rest_position) == layout.size
    assert len(character.vector_names) == len(character.effort_limits())
    assert len(character.vector_names) == len(layout.vector_starts)
    assert set(character.gains) == set(character.vector_names)
    assert np.all(character.effort_limits() > 0.0)
    assert np.all((lower <= character.rest_position) & (character.rest_position <= upper))


def test_every_joint_of_a_shipped_character_is_driven(character: Character) -> None:
    for name in character.layout.actuated_joint_names:
        assert character.gains[name].stiffness > 0.0
        assert character.gains[name].damping > 0.0


def test_every_link_has_a_real_mass_and_inertia(character: Character) -> None:
    for body in character.links:
        assert body.mass >= 0.0
        assert all(moment >= 0.0 for moment in body.inertia_diagonal)
        assert np.linalg.norm(body.inertial_pose.orientation_xyzw) == pytest.approx(1.0)
        assert np.linalg.norm(body.joint.pose_in_parent.orientation_xyzw) == pytest.approx(1.0)


def test_a_character_that_is_loaded_twice_is_the_same(character: Character) -> None:
    assert load_character(character.name) == character


# The order of links


def assert_depth_first(parents: list[int]) -> None:
    """A link's parent is the link before it or one of that one's ancestors."""
    assert parents[0] == -1
    branch = [0]
    for index, parent in enumerate(parents[1:], start=1):
        while branch and branch[-1] != parent:
            branch.pop()
        assert branch, f"link {index} comes outside its parent's branch"
        branch.append(index)


def test_the_links_of_a_shipped_character_are_depth_first(character: Character) -> None:
    assert_depth_first([body.parent for body in character.links])


LISTINGS = {
    "by level": ["trunk", "leg", "arm", "foot", "hand"],
    "children before parents": ["trunk", "hand", "foot", "leg", "arm"],
    "the base last": ["leg", "arm", "foot", "hand", "trunk"],
    "backwards": ["hand", "foot", "arm", "leg", "trunk"],
}


@pytest.mark.slow
@pytest.mark.parametrize("listing", LISTINGS)
def test_a_urdf_may_list_its_links_in_any_order(write: WriteCharacter, listing: str) -> None:
    urdf = robot(
        *(link(name) for name in LISTINGS[listing]),
        joint("ankle", "leg", "foot"),
        joint("hip", "trunk", "leg"),
        joint("shoulder", "trunk", "arm"),
        joint("wrist", "arm", "hand"),
    )

    links = load_elsewhere(write("urdf: lift.urdf\ninertia: file\n", urdf))[0]["links"]

    assert_depth_first([parent for _, _, parent in links])
    assert {name: links[parent][0] for name, _, parent in links[1:]} == {
        "leg": "trunk",
        "arm": "trunk",
        "foot": "leg",
        "hand": "arm",
    }
    assert {name: of_joint for name, of_joint, _ in links} == {
        "trunk": "root",
        "leg": "hip",
        "arm": "shoulder",
        "foot": "ankle",
        "hand": "wrist",
    }


# Frames and masses


def from_rpy(roll: float, pitch: float, yaw: float) -> FloatArray:
    """The matrix of URDF's fixed-axis angles: about x first, then y, then z of the parent."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    product: FloatArray = about_z @ about_y @ about_x
    return product


def test_frames_are_those_of_the_links_whatever_their_inertial_frames(
    write: WriteCharacter,
) -> None:
    trunk_origin = '<origin xyz="0.1 -0.2 0.3" rpy="0.4 0.5 -0.6"/>'
    arm_origin = '<origin xyz="0.01 0.02 0.03" rpy="-0.7 0.8 0.9"/>'
    joint_origin = '<origin xyz="1 2 3" rpy="0.3 -0.4 1.2"/><axis xyz="0.6 0 -0.8"/>'
    urdf = robot(
        link("trunk", inertial(1, 2, trunk_origin)),
        link("arm", inertial(2, 2, arm_origin)),
        joint("shoulder", "trunk", "arm", inside=joint_origin),
    )

    trunk, arm = load_character(str(write("urdf: lift.urdf\ninertia: file\n", urdf))).links

    assert trunk.inertial_pose.position == pytest.approx((0.1, -0.2, 0.3), abs=1e-6)
    assert arm.inertial_pose.position == pytest.approx((0.01, 0.02, 0.03), abs=1e-6)
    assert arm.joint.pose_in_parent.position == pytest.approx((1.0, 2.0, 3.0), abs=1e-6)
    assert arm.joint.axis_in_child == pytest.approx((0.6, 0.0, -0.8), abs=1e-6)
    turn = matrix(np.array(arm.joint.pose_in_parent.orientation_xyzw))
    np.testing.assert_allclose(turn, from_rpy(0.3, -0.4, 1.2), atol=1e-6)
    assert (trunk.mass, arm.mass) == (1.0, 2.0)
    for body, angles in ((trunk, (0.4, 0.5, -0.6)), (arm, (-0.7, 0.8, 0.9))):
        axes = matrix(np.array(body.inertial_pose.orientation_xyzw))
        tensor = axes @ np.diag(body.inertia_diagonal) @ axes.T  # in the link frame
        given = from_rpy(*angles)
        expected = given @ np.diag([2.0, 1.0, 1.0]) @ given.T
        np.testing.assert_allclose(tensor, expected, atol=1e-5)


def test_a_scale_of_two_doubles_every_length(write: WriteCharacter) -> None:
    origin = '<origin xyz="1 2 3"/>'
    urdf = robot(
        link("trunk"),
        link("arm", inertial(1, 1, '<origin xyz="0.1 0.2 0.3"/>')),
        joint("shoulder", "trunk", "arm", inside=origin),
    )

    arm = load_character(str(write("urdf: lift.urdf\ninertia: file\nscale: 2\n", urdf))).links[1]

    assert arm.joint.pose_in_parent.position == pytest.approx((2.0, 4.0, 6.0), abs=1e-6)
    assert arm.inertial_pose.position == pytest.approx((0.2, 0.4, 0.6), abs=1e-6)


def test_the_file_of_a_character_overrides_the_limit_of_its_urdf(write: WriteCharacter) -> None:
    of_urdf = load_character(str(write(PREAMBLE)))
    of_file = load_character(str(write(PREAMBLE + "joints: {height: {effort_limit: 12.5}}\n")))

    assert of_urdf.effort_limits().tolist() == [1e6]
    assert of_file.effort_limits().tolist() == [12.5]


@pytest.mark.parametrize("entry", ["", "{}", "null"])
def test_a_joint_without_gains_has_none(write: WriteCharacter, entry: str) -> None:
    character = load_character(str(write(PREAMBLE + f"joints:\n  height: {entry}\n")))

    assert character.gains == {"height": Gains(0.0, 0.0)}


def test_a_character_is_found_from_its_own_directory(write: WriteCharacter) -> None:
    path = write(PREAMBLE)

    character = load_character(str(path))

    assert character.name == "custom"
    assert character.file == path
    assert character.loading.urdf_path == path.parent / "lift.urdf"
    assert character.loading.urdf_text == URDF


def test_an_edited_urdf_is_read_anew(write: WriteCharacter) -> None:
    before = load_character(str(write(PREAMBLE)))
    after = load_character(str(write(PREAMBLE, URDF.replace('mass value="1.0"', 'mass value="2"'))))

    assert (before.mass, after.mass) == (1.0, 2.0)


# Passive damping and soft limits

DAMPED_LIFT = URDF.replace("<limit", '<dynamics damping="2.5"/><limit')
BALL = robot(link("trunk"), link("arm"), joint("shoulder", "trunk", "arm", "spherical"))
BALL_FILE = "urdf: lift.urdf\ninertia: file\njoints: {{shoulder: {{soft_limit: {}}}}}\n"
LIMIT = "{lower: [-1, -0.5, 0], upper: [1, 0.5, 2], stiffness: 40, damping: 2}"


@pytest.mark.parametrize(
    ("more", "damping"),
    [
        ("", 2.5),
        ("joint_damping: file", 2.5),
        ("joint_damping: none", 0.0),
        ("joints: {height: {passive_damping: 4}}", 4.0),
        ("joint_damping: none\njoints: {height: {passive_damping: 4}}", 4.0),
    ],
)
def test_passive_damping_is_the_urdfs_or_the_files(
    write: WriteCharacter, more: str, damping: float
) -> None:
    character = load_character(str(write(PREAMBLE + more + "\n", DAMPED_LIFT)))

    assert "dynamics" in DAMPED_LIFT
    assert character.passive_damping().tolist() == [damping]


def test_a_ball_joint_has_the_passive_damping_of_its_file_alone(write: WriteCharacter) -> None:
    urdf = BALL.replace("<limit", '<dynamics damping="2.5"/><limit')
    preamble = "urdf: lift.urdf\ninertia: file\nfixed_base: true\n"

    of_urdf = load_character(str(write(preamble, urdf)))
    damped = preamble + "joints: {shoulder: {passive_damping: 3}}"
    of_file = load_character(str(write(damped, urdf)))

    assert of_urdf.passive_damping().tolist() == [0.0] * 3
    assert of_file.passive_damping().tolist() == [3.0] * 3


def test_a_soft_limit_is_as_its_file_says(write: WriteCharacter) -> None:
    character = load_character(str(write(BALL_FILE.format(LIMIT), BALL)))

    limit = SoftLimit((-1.0, -0.5, 0.0), (1.0, 0.5, 2.0), stiffness=40.0, damping=2.0)
    assert character.moving_joints[1].soft_limit == limit


WRONG_LIMITS = {
    "no bounds": ("{stiffness: 1}", ["soft_limit.lower", "3 finite numbers"]),
    "two numbers": (LIMIT.replace("[-1, -0.5, 0]", "[-1, 0]"), ["lower", "3 finite numbers"]),
    "a word": (LIMIT.replace("[-1,", "[low,"), ["lower", "3 finite numbers"]),
    "a flag": (LIMIT.replace("[-1,", "[no,"), ["lower", "3 finite numbers"]),
    "not a number": (LIMIT.replace("[-1,", "[.nan,"), ["lower", "3 finite numbers"]),
    "beyond half a turn": (LIMIT.replace("[1,", "[3.2,"), ["upper", "from -3.14159 to 3.14159"]),
    "crossed": (LIMIT.replace("[1,", "[-2,"), ["soft_limit.lower", "'upper'"]),
    "no stiffness": (LIMIT.replace("stiffness: 40, ", ""), ["stiffness"]),
    "a negative damping": (LIMIT.replace("damping: 2", "damping: -2"), ["damping", "-2"]),
    "an unknown key": (LIMIT.replace("damping", "dumping"), ["'joints.shoulder.soft_limit.dump"]),
    "no mapping": ("3", ["soft_limit", "mapping"]),
    "nothing": ("", ["lower"]),
    "a rest pose outside": (LIMIT.replace("[-1,", "[0.5,"), ["rest_pose.shoulder_x", "0.5 to 1"]),
}


@pytest.mark.parametrize("case", WRONG_LIMITS)
def test_a_wrong_soft_limit_is_refused_with_what_would_be_right(
    write: WriteCharacter, case: str
) -> None:
    text, words = WRONG_LIMITS[case]
    path = write(BALL_FILE.format(text), BALL)

    line = refusal(path)

    assert str(path) in line
    for word in words:
        assert word in line


def test_a_urdf_that_drives_its_joints_by_damping_is_refused(write: WriteCharacter) -> None:
    path = write(PREAMBLE, DAMPED_LIFT.replace("2.5", "-2.5"))

    line = refusal(path)

    assert "lift.urdf" in line and "'height'" in line and "joint_damping: none" in line


# Refusals


def test_an_unknown_character_is_refused_with_those_that_exist() -> None:
    assert f"unknown character 'hummanoid'; did you mean 'humanoid'? there are: {NAMES}" in refusal(
        "hummanoid"
    )


@pytest.mark.parametrize("name", ["gone.yaml", "gone.yml", "folder.yaml"])
def test_what_is_no_file_is_refused_by_path(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder.yaml").mkdir()

    reason = "not a file" if name == "folder.yaml" else "No such file"
    assert f"{tmp_path / name}: {reason}" in refusal(tmp_path / name)


REFUSED = {
    "bad YAML": ("urdf: [", ["line"]),
    "a tab where YAML has none": ("joints:\n\t- x", ["line 2"]),
    "an empty file": ("", ["mapping"]),
    "a list": ("- urdf: lift.urdf", ["mapping"]),
    "a text": ("lift.urdf", ["mapping"]),
    "two documents": (PREAMBLE + "---\n" + PREAMBLE, []),
    "a value that holds itself": (PREAMBLE + "scale: &a [*a]", ["nested too deep"]),
    "an anchor that is not there": (PREAMBLE + "scale: *a", []),
    "no URDF": ("fixed_base: true", ["urdf"]),
    "a URDF that is no text": ("urdf: 3", ["urdf", "3"]),
    "an unknown key": (PREAMBLE + "skale: 2", ["'skale'", "scale"]),
    "a key that is no text": (PREAMBLE + "3: 2", ["'3'"]),
    "an unknown key of a joint": (
        PREAMBLE + "joints: {height: {kp: 3}}",
        ["joints.height.kp", "stiffness, damping, integral, effort_limit"],
    ),
    "an unknown joint": (PREAMBLE + "joints: {knee: {stiffness: 1}}", ["'knee'", "height"]),
    "an unknown rest entry": (PREAMBLE + "rest_pose: {knee: 1}", ["rest_pose", "'knee'", "height"]),
    "a negative stiffness": (
        PREAMBLE + "joints: {height: {stiffness: -1}}",
        ["height", "stiffness", "-1"],
    ),
    "a damping that is no number": (
        PREAMBLE + "joints: {height: {damping: .nan}}",
        ["height", "damping", "nan"],
    ),
    "an infinite stiffness": (
        PREAMBLE + "joints: {height: {stiffness: .inf}}",
        ["height", "stiffness", "inf"],
    ),
    "a stiffness that is a flag": (
        PREAMBLE + "joints: {height: {stiffness: yes}}",
        ["height", "stiffness", "True"],
    ),
    "a stiffness beyond every float": (
        PREAMBLE + "joints: {height: {stiffness: 1" + "0" * 400 + "}}",
        ["height", "stiffness"],
    ),
    "a negative limit": (
        PREAMBLE + "joints: {height: {effort_limit: -1}}",
        ["height", "effort_limit", "-1"],
    ),
    "a soft limit of a slider": (
        PREAMBLE + f"joints: {{height: {{soft_limit: {LIMIT}}}}}",
        ["joints.height.soft_limit", "ball joints", "prismatic"],
    ),
    "a passive damping below zero": (
        PREAMBLE + "joints: {height: {passive_damping: -1}}",
        ["height", "passive_damping", "-1"],
    ),
    "a third way to damp": (PREAMBLE + "joint_damping: much", ["'much'", "'file' or 'none'"]),
    "a rest entry that is no number": (PREAMBLE + "rest_pose: {height: .nan}", ["height", "nan"]),
    "joints that are a list": (PREAMBLE + "joints: [height]", ["joints", "mapping"]),
    "a joint that is a number": (PREAMBLE + "joints: {height: 3}", ["height", "mapping"]),
    "a scale of zero": (PREAMBLE + "scale: 0", ["scale"]),
    "a third up axis": (PREAMBLE + "up_axis: x", ["up_axis", "'x'", "'z' or 'y'"]),
    "a flag that is a number": (PREAMBLE + "self_collision: 1", ["self_collision", "true or"]),
    "a root assistance of a fixed base": (
        PREAMBLE + "root_assistance: {force: {stiffness: 1}}",
        ["root_assistance", "floating"],
    ),
    "an unknown part of the root assistance": (
        "urdf: lift.urdf\nroot_assistance: {kraft: {stiffness: 1}}",
        ["root_assistance.kraft", "force, torque"],
    ),
    "clips of unknown joints": (
        PREAMBLE + "clips: {files: 'a_*.txt', joints: [knee]}",
        ["clips.joints", "'knee'", "height"],
    ),
    "clips without a star": (PREAMBLE + "clips: {files: a.txt, joints: [height]}", ["clips.files"]),
    "clips with another sign": (
        PREAMBLE + "clips: {files: 'a_*.txt', joints: [height], signs: {height: 2}}",
        ["clips.signs.height is 2", "1 or -1"],
    ),
    "clips with offsets of unknown joints": (
        PREAMBLE + "clips: {files: 'a_*.txt', joints: [height], offsets: {knee: 0.1}}",
        ["clips.offsets", "'knee'", "joint of one angle", "height"],
    ),
    "clips with half a base": (
        PREAMBLE + "clips: {files: 'a_*.txt', joints: [height], base_rotation: [0, 1]}",
        ["clips.base_rotation", "3 finite numbers"],
    ),
    "clips with other quaternions": (
        PREAMBLE + "clips: {files: 'a_*.txt', joints: [height], quaternion: zyx}",
        ["clips.quaternion", "'wxyz' or 'xyzw'"],
    ),
    "clips without joints": (PREAMBLE + "clips: {files: 'a_*.txt'}", ["clips.joints"]),
    "a package that is not installed": (
        "urdf: package://no_such_package/x.urdf",
        ["'no_such_package'"],
    ),
    "a package without a name": ("urdf: package://", ["package"]),
    "a package that is a path": ("urdf: package://../x.urdf", ["'..'"]),
    "a path with a NUL in it": ('urdf: "lift\\0.urdf"', []),
    "a key of two lines": (PREAMBLE + '"a\\nb": 1', []),
    "a joint of two lines": (PREAMBLE + 'joints: {"a\\nb": {}}', []),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_bad_file_is_refused_in_one_line_that_names_it(write: WriteCharacter, case: str) -> None:
    text, words = REFUSED[case]
    path = write(text)

    line = refusal(path)

    assert str(path) in line
    for word in words:
        assert word in line


@pytest.mark.parametrize(
    "tag",
    [
        "!!python/object/apply:os.mkdir",
        "!!python/name:os.mkdir",
        "!anything",
    ],
)
def test_yaml_that_asks_for_python_is_refused_and_not_run(
    write: WriteCharacter, tmp_path: Path, tag: str
) -> None:
    victim = tmp_path / "victim"
    path = write(PREAMBLE + f"scale: {tag} ['{victim}']\n")

    line = refusal(path)

    assert str(path) in line
    assert not victim.exists()


def test_a_file_that_is_no_text_is_refused(write: WriteCharacter) -> None:
    path = write(PREAMBLE)
    path.write_bytes(b"urdf: \xff\xfe\n")

    line = refusal(path)

    assert str(path) in line
    assert "not a text file" in line


@pytest.mark.parametrize("name", ["custom.yaml", "lift.urdf"])
def test_a_file_over_the_limit_is_refused_by_path(
    write: WriteCharacter, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    path = write(PREAMBLE, URDF).parent / name
    monkeypatch.setattr(files, "MAX_FILE_BYTES", 2**20)
    with path.open("a") as file:
        file.write(" " * 2**20)

    line = refusal(path.parent / "custom.yaml")

    assert str(path) in line
    assert "larger than 1 MiB" in line


def test_a_missing_urdf_is_refused_by_path(write: WriteCharacter) -> None:
    path = write("urdf: elsewhere/nothing.urdf")

    assert f"{path.parent / 'elsewhere' / 'nothing.urdf'}: No such file" in refusal(path)


LINKS = link("a") + link("b") + link("c")
BROKEN = {
    "nothing": "",
    "no XML": "not XML",
    "an end too soon": "<robot name='x'><link",
    "no links": "<robot name='x'/>",
    "another format": "<sdf version='1.6'/>",
    "two links of one name": robot(link("a"), link("a")),
    "two joints of one name": robot(LINKS, joint("j", "a", "b"), joint("j", "b", "c")),
    "a joint to nothing": robot(link("a"), joint("j", "a", "nothing")),
    "a joint from nothing": robot(link("a"), joint("j", "nothing", "a")),
    "a circle": robot(link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a")),
    "a circle beside the base": robot(LINKS, joint("j", "b", "c"), joint("k", "c", "b")),
    "a joint of a link to itself": robot(
        link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "b")
    ),
    "two bases": robot(LINKS, joint("j", "a", "b")),
    "two parents of a link": robot(
        LINKS, joint("j", "a", "b"), joint("k", "a", "c"), joint("m", "b", "c")
    ),
    "a type that is none": robot(link("a"), link("b"), joint("j", "a", "b", kind="screw")),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_urdf_is_refused_by_path(write: WriteCharacter, case: str) -> None:
    path = write("urdf: lift.urdf\ninertia: file\n", BROKEN[case])

    (outcome,) = load_elsewhere(path)

    line = outcome["refused"]
    assert str(path.parent / "lift.urdf") in line
    assert "\n" not in line


@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_a_joint_of_a_type_that_is_not_supported_is_refused_by_name(
    write: WriteCharacter, kind: str
) -> None:
    path = write(PREAMBLE, robot(link("rail"), link("mass"), joint("skid", "rail", "mass", kind)))

    line = refusal(path)

    assert str(path.parent / "lift.urdf") in line
    assert "'skid'" in line
    assert "revolute, continuous, prismatic, spherical or fixed" in line


@pytest.mark.parametrize(
    "joints",
    [
        [joint("root", "a", "b"), joint("j", "b", "c")],
        [joint("j", "a", "b", "spherical"), joint("j_y", "b", "c")],
    ],
    ids=["a joint named as the base", "a hinge named as a part of a ball joint"],
)
def test_entries_of_one_name_are_refused_by_path(write: WriteCharacter, joints: list[str]) -> None:
    path = write("urdf: lift.urdf", robot(link("a"), link("b"), link("c"), *joints))

    assert re.search(r"custom\.yaml|lift\.urdf", refusal(path))
