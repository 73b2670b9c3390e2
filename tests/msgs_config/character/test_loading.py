"""A character may be a URDF alone: all keys of the file that it has not are at their defaults."""

from pathlib import Path

import numpy as np
import pytest

from msgs_config.character.loading import load_character
from msgs_config.character.model import Gains
from msgs_config.errors import CharacterError

INERTIAL = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
)
JOINT = (
    '<joint name="hinge" type="revolute"><parent link="{}"/><child link="arm"/>'
    '<limit lower="-1" upper="1" effort="5" velocity="9"/></joint>'
)


def write(directory: Path, base: str, inertial: str) -> Path:
    path = directory / "arm.urdf"
    path.write_text(
        f'<robot name="arm"><link name="{base}">{inertial}</link>'
        f'<link name="arm">{INERTIAL}</link>{JOINT.format(base)}</robot>'
    )
    return path


def test_it_is_the_character_of_a_file_that_only_names_it(tmp_path: Path) -> None:
    urdf = write(tmp_path, "trunk", INERTIAL)
    (tmp_path / "named.yaml").write_text("urdf: arm.urdf\n")

    alone, named = load_character(str(urdf)), load_character(str(tmp_path / "named.yaml"))

    assert alone.loading == named.loading
    assert alone.links == named.links
    assert alone.gains == named.gains
    assert alone.rest_position == named.rest_position


def test_it_is_named_after_its_file_and_its_joints_are_limp(tmp_path: Path) -> None:
    urdf = write(tmp_path, "trunk", INERTIAL)

    character = load_character(str(urdf))

    assert (character.name, character.file) == ("arm", urdf)
    assert character.layout.has_floating_base
    assert character.gains["hinge"] == Gains()
    assert not np.any(character.rest_position)
    assert character.warnings == ("joints without gains in arm.urdf are limp: hinge",)


@pytest.mark.parametrize(
    ("base", "inertial", "floats"),
    [("world", "", False), ("world", INERTIAL, True), ("base", "", True)],
)
def test_a_base_without_mass_that_is_the_world_is_fixed(
    tmp_path: Path, base: str, inertial: str, floats: bool
) -> None:
    character = load_character(str(write(tmp_path, base, inertial)))

    assert character.layout.has_floating_base == floats


def test_a_file_may_let_the_world_float_all_the_same(tmp_path: Path) -> None:
    write(tmp_path, "world", "")
    (tmp_path / "named.yaml").write_text("urdf: arm.urdf\nfixed_base: false\n")

    assert load_character(str(tmp_path / "named.yaml")).layout.has_floating_base


def test_it_may_be_relative_to_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    urdf = write(tmp_path, "trunk", INERTIAL)
    monkeypatch.chdir(tmp_path)

    assert load_character("arm.urdf").file == urdf


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
        ("arm.xacro", "or the path of a .yaml or .urdf file"),
    ],
)
def test_one_that_is_not_there_is_refused(name: str, words: str) -> None:
    with pytest.raises(CharacterError, match=words):
        load_character(name)


def test_a_tab_between_numbers_is_a_blank_to_the_engine_too(tmp_path: Path) -> None:
    path = tmp_path / "box.urdf"
    path.write_text(
        '<robot name="box"><link name="box"><inertial><origin xyz="1&#9;2&#9;3"/>'
        '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
        "</inertial></link></robot>"
    )

    assert load_character(str(path)).links[0].inertial_pose.position == (1.0, 2.0, 3.0)
