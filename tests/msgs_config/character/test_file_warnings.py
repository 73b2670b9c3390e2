"""What the author of a character file may have overlooked is said, or refused."""

from pathlib import Path

import pytest

from msgs_config.character.file import shipped_characters
from msgs_config.character.loading import load_character
from msgs_config.errors import CharacterError, one_of

ARM = """
<robot name="arm">
  <link name="base"/>
  <link name="upper">
    <inertial>
      <mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>
    </inertial>
  </link>
  <link name="lower"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="10" velocity="10"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="10" velocity="10"/>
  </joint>
</robot>
"""
FIXED = "urdf: arm.urdf\nfixed_base: true\n"


def write(directory: Path, yaml: str, urdf: str = ARM) -> str:
    """The path of a character file in a directory."""
    (directory / "arm.urdf").write_text(urdf)
    (directory / "arm.yaml").write_text(yaml)
    return str(directory / "arm.yaml")


def test_joints_without_gains_are_named(tmp_path: Path) -> None:
    character = load_character(write(tmp_path, FIXED + "joints: {shoulder: {stiffness: 1}}\n"))

    assert "joints without gains in arm.yaml are limp: elbow" in character.warnings


@pytest.mark.parametrize(("base", "named"), [(FIXED, "lower"), ("urdf: arm.urdf\n", "base, lower")])
def test_links_whose_mass_the_engine_makes_up_are_named(
    tmp_path: Path, base: str, named: str
) -> None:
    character = load_character(write(tmp_path, base))

    assert f"links without <inertial>, the engine assumes a mass: {named}" in character.warnings


@pytest.mark.parametrize("name", shipped_characters())
def test_nothing_is_overlooked_in_the_characters_that_ship(name: str) -> None:
    assert load_character(name).warnings == ()


@pytest.mark.parametrize("angle", [2.1, -30.0])
def test_a_rest_pose_beyond_the_limits_is_refused(tmp_path: Path, angle: float) -> None:
    path = write(tmp_path, FIXED + f"rest_pose: {{elbow: {angle}}}\n")

    with pytest.raises(CharacterError, match=rf"rest_pose\.elbow is {angle:g}; .* -2 to 2"):
        load_character(path)


def test_a_hinge_without_a_limit_is_named(tmp_path: Path) -> None:
    limit = '<limit lower="-2" upper="2" effort="10" velocity="10"/>'
    path = write(tmp_path, FIXED, ARM.replace(limit, "", 1))

    with pytest.raises(CharacterError, match="joint 'shoulder' is revolute and has no <limit>"):
        load_character(path)


def test_a_slip_of_the_pen_is_told_the_nearest_name() -> None:
    names = ["root_assistance", "rate", "clip"]

    assert "'; did you mean 'root_assistance'? there" in one_of(
        "parameter", "root_asistance", names
    )
    assert "did you mean" not in one_of("parameter", "xyz", names)
