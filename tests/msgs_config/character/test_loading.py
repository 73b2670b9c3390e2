"""A character may be a URDF alone, which then stands and holds; what seems overlooked is named."""

from pathlib import Path

import numpy as np
import pytest

from msgs_config.character.file import shipped_characters
from msgs_config.character.loading import load_character
from msgs_config.character.model import Gains
from msgs_config.errors import CharacterError, one_of
from tests.support.urdf import inertial, joint, link, robot, write_character

HINGE = joint("hinge", "trunk", "arm")
ARM = robot(link("trunk"), link("arm"), HINGE)


def test_it_is_the_character_of_a_file_that_only_names_it(tmp_path: Path) -> None:
    yaml = "inertia: filled\non_ground: true\nautomatic_gains: 5\n"
    named = load_character(str(write_character(tmp_path, ARM, yaml)))
    urdf = tmp_path / "robot.urdf"

    alone = load_character(str(urdf))

    assert (alone.name, alone.file) == ("robot", urdf)
    assert alone.loading == named.loading
    assert alone.links == named.links
    assert alone.gains == named.gains
    assert alone.gains["hinge"] != Gains()
    assert alone.rest_position == named.rest_position
    assert alone.layout.has_floating_base
    assert not np.any(alone.rest_position)
    assert alone.warnings == named.warnings
    assert any("critically damped at 5 Hz" in line for line in alone.warnings)


def test_joints_without_gains_in_a_file_are_limp_and_named(tmp_path: Path) -> None:
    named = load_character(str(write_character(tmp_path, ARM)))

    assert named.gains["hinge"] == Gains()
    assert not np.any(named.rest_position)
    assert named.warnings == (
        "joints without gains in robot.yaml are limp: hinge",
        "left out: velocity limits, which nothing keeps (1): hinge",
    )


@pytest.mark.parametrize(
    ("base", "inside", "yaml", "floats"),
    [
        ("world", "", "", False),
        ("world", inertial(), "", True),
        ("base", "", "", False),
        ("base", inertial(), "", True),
        ("world", "", "fixed_base: false\n", True),
    ],
)
def test_a_base_without_mass_is_fixed_unless_the_file_lets_it_float(
    tmp_path: Path, base: str, inside: str, yaml: str, floats: bool
) -> None:
    urdf = robot(link(base, inside), link("arm"), joint("hinge", base, "arm"))

    character = load_character(str(write_character(tmp_path, urdf, yaml)))

    assert character.layout.has_floating_base == floats


def test_it_may_be_relative_to_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_character(tmp_path, ARM)
    monkeypatch.chdir(tmp_path)

    assert load_character("robot.urdf").file == tmp_path / "robot.urdf"


def test_it_may_lie_in_a_package() -> None:
    character = load_character("package://pybullet_data/r2d2.urdf")

    assert character.file.is_absolute()
    assert character.links[0].name == "base_link"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("gone.urdf", "No such file"),
        ("package://no_such_package/x.urdf", "'no_such_package'"),
        ("a\0.urdf", "must be a path"),
        ("a\0.yaml", "not a text file"),
        ("arm.xacro", "No such file"),
        ("arm.txt", "or the path of a .yaml, .urdf, .xacro or .xml file"),
    ],
)
def test_one_that_is_not_there_is_refused(name: str, words: str) -> None:
    with pytest.raises(CharacterError, match=words):
        load_character(name)


# What the author may have overlooked

BARE = robot(
    link("base", ""),
    link("upper"),
    link("lower", ""),
    joint("shoulder", "base", "upper"),
    joint("elbow", "upper", "lower"),
)
TWO_HINGES = BARE.replace(link("lower", ""), link("lower"))
FIXED = "fixed_base: true\n"


def test_joints_without_gains_are_named(tmp_path: Path) -> None:
    yaml = FIXED + "joints: {shoulder: {stiffness: 1}}\n"

    character = load_character(str(write_character(tmp_path, TWO_HINGES, yaml)))

    assert "joints without gains in robot.yaml are limp: elbow" in character.warnings


def test_joints_that_move_no_mass_are_named(tmp_path: Path) -> None:
    character = load_character(str(write_character(tmp_path, BARE)))

    assert character.warnings == (
        "joints without gains in robot.yaml are limp: shoulder",
        "base link 'base' has no mass, so that it is fixed",
        "joints that move no mass are fixed at 0: elbow",
        "links without <inertial> are frames of others: lower of upper",
        "left out: velocity limits, which nothing keeps (2): shoulder, elbow",
    )


@pytest.mark.parametrize("name", shipped_characters())
def test_nothing_is_overlooked_in_the_characters_that_ship(name: str) -> None:
    assert load_character(name).warnings == ()


@pytest.mark.parametrize("angle", [1.1, -30.0])
def test_a_rest_pose_beyond_the_limits_is_refused(tmp_path: Path, angle: float) -> None:
    path = write_character(tmp_path, TWO_HINGES, FIXED + f"rest_pose: {{elbow: {angle}}}\n")

    with pytest.raises(CharacterError, match=rf"rest_pose\.elbow is {angle:g}; .* -1 to 1"):
        load_character(str(path))


def test_a_hinge_without_a_limit_is_named(tmp_path: Path) -> None:
    urdf = robot(link("trunk"), link("arm"), joint("shoulder", "trunk", "arm", limit=""))

    with pytest.raises(CharacterError, match="joint 'shoulder' is revolute and has no <limit>"):
        load_character(str(write_character(tmp_path, urdf)))


def test_a_slip_of_the_pen_is_told_the_nearest_name() -> None:
    names = ["root_assistance", "rate", "clip"]

    line = one_of("parameter", "root_asistance", names)
    assert "'; did you mean 'root_assistance'? there" in line
    assert "did you mean" not in one_of("parameter", "xyz", names)
