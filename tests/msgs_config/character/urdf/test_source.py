"""Where a URDF's text is from: any encoding, a xacro; other formats and Git LFS are named."""

import sys
from pathlib import Path

import pytest

from msgs_config.character.loading import load_character
from msgs_config.character.meshes.resolving import resolve_meshes
from msgs_config.errors import CharacterError
from tests.support.urdf import inertial, joint, link, refusal, robot, write_character

LIMIT = '<limit lower="-1" upper="1" effort="5"/>'
ARM = robot(link("world", ""), link("Größe"), joint("Gelenk", "world", "Größe", limit=LIMIT))
LFS = f"version https://git-lfs.github.com/spec/v1\noid sha256:{0:064d}\nsize 1234\n"


def links(path: Path) -> list[str]:
    return [link.name for link in load_character(str(path)).links]


# Encodings

DECLARED = [
    ("UTF-8", "utf-8"),
    ("utf-8", "utf-8-sig"),
    ("ISO-8859-1", "latin-1"),
    ("iso-8859-15", "iso-8859-15"),
    ("windows-1252", "cp1252"),
    ("UTF-16", "utf-16"),
    ("UTF-16", "utf-16-be"),
    ("UTF-32", "utf-32"),
    ("UTF-16", "utf-8"),  # as editors leave it that convert the text alone
    ("no-such-encoding", "utf-8"),
]


@pytest.mark.parametrize(("declared", "encoding"), DECLARED)
def test_a_urdf_is_read_in_its_own_encoding(tmp_path: Path, declared: str, encoding: str) -> None:
    path = tmp_path / "robot.urdf"
    text = f'<?xml version="1.0" encoding="{declared}"?>\r\n{ARM}\r\n'
    path.write_bytes(text.encode(encoding))

    character = load_character(str(path))

    assert [link.name for link in character.links] == ["world", "Größe"]
    assert not [line for line in character.warnings if "byte by byte" in line]


def test_a_urdf_that_is_not_in_its_encoding_is_read_byte_by_byte_and_a_line_says_so(
    tmp_path: Path,
) -> None:
    """Such as one whose comments are in another language's encoding."""
    path = tmp_path / "robot.urdf"
    text = ARM.replace("Größe", "part").replace("<link", "<!-- 机器人 --><link", 1)
    path.write_bytes(b'<?xml version="1.0" encoding="utf-8"?>' + text.encode("gbk"))

    character = load_character(str(path))

    assert [link.name for link in character.links] == ["world", "part"]
    assert "robot.urdf is not utf-8: it is read byte by byte (ISO-8859-1)" in character.warnings


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_bytes(b"<robot>\0\x01\xff</robot>")

    assert "not a text file" in refusal(path)


# Names


@pytest.mark.parametrize("name", ["ROBOT.URDF", "robot.Urdf", "robot.xml"])
def test_a_suffix_may_be_in_capitals_and_a_urdf_may_be_called_xml(
    tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    path.write_text(ARM, encoding="utf-8")

    assert load_character(str(path)).name == path.stem
    assert load_character(str(path)).gains["Gelenk"].stiffness > 0.0


@pytest.mark.parametrize("name", ["ARM.YAML", "arm.YML"])
def test_so_may_a_characters_file(tmp_path: Path, name: str) -> None:
    write_character(tmp_path, ARM).rename(tmp_path / name)

    assert links(tmp_path / name) == ["world", "Größe"]


@pytest.mark.parametrize("key", [True, False])
def test_a_file_of_another_format_is_named_as_what_it_is(tmp_path: Path, key: bool) -> None:
    """Given alone, or as the `urdf` of a character's file."""
    (file := tmp_path / "robot.SDF").write_text("anything")
    (yaml := tmp_path / "robot.yaml").write_text("urdf: robot.SDF\n")

    line = refusal(yaml if key else file)

    assert f"{file} is a model or world of Gazebo (SDF), not a character, which is a .urdf" in line


ROOTS = {
    '<sdf version="1.7"><model name="m"/></sdf>': "is a model or world of Gazebo (SDF)",
    "<mujocoinclude/>": "is a part of a model of MuJoCo (MJCF)",
    "<COLLADA/>": "is a mesh or scene (COLLADA)",
    "<other/>": "is an XML file whose root is <other>",
    "<!DOCTYPE html>\n<html/>": "a web page, not the file itself",
}


@pytest.mark.parametrize("text", ROOTS)
@pytest.mark.parametrize("name", ["robot.urdf", "robot.xml"])
def test_so_is_one_whose_name_does_not_tell(tmp_path: Path, text: str, name: str) -> None:
    path = tmp_path / name
    path.write_text(text)

    assert ROOTS[text] in refusal(path)


def test_a_prefix_that_is_not_declared_is_no_error(tmp_path: Path) -> None:
    more = '<gazebo><controller:imu name="i" x:y="1"/></gazebo><other:part/>'
    path = tmp_path / "robot.urdf"
    path.write_text(ARM.replace("</robot>", more + "</robot>"), encoding="utf-8")

    character = load_character(str(path))

    assert "left out: <other:part> (1)" in character.warnings


def test_a_default_name_space_alters_nothing(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    text = ARM.replace("<robot ", '<robot xmlns="http://www.ros.org" ')
    path.write_text(text, encoding="utf-8")

    assert links(path) == ["world", "Größe"]


# Git LFS


@pytest.mark.parametrize("name", ["robot.urdf", "robot.xacro", "robot.yaml"])
def test_a_git_lfs_pointer_is_named_as_such(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_text(LFS)

    line = refusal(path)

    assert f"{path} is a Git LFS pointer" in line
    assert "git lfs pull" in line


@pytest.mark.parametrize("suffix", ["stl", "obj", "dae", "STL"])
def test_so_is_a_mesh_that_is_one(tmp_path: Path, suffix: str) -> None:
    """To collide with it is refused, to see it is left out with the line."""
    mesh = tmp_path / f"part.{suffix}"
    mesh.write_text(LFS)
    shape = f'<geometry><mesh filename="part.{suffix}"/></geometry>'
    path = tmp_path / "robot.urdf"
    path.write_text(robot(link("a", f"{inertial()}<collision>{shape}</collision>")))

    line = refusal(path)
    path.write_text(robot(link("a", f"{inertial()}<visual>{shape}</visual>")))
    seen = load_character(str(path))

    assert f"link 'a': mesh {mesh} is a Git LFS pointer" in line
    assert "git lfs pull" in line
    assert "'collision: none' does without" in line
    assert any(f"mesh {mesh} is a Git LFS pointer" in line for line in seen.warnings)
    assert not resolve_meshes(seen.loading).robot.findall("link/visual")


# Neither masses nor meshes


@pytest.mark.parametrize("part", ["collision", "visual", ""])
def test_an_arm_with_neither_masses_nor_meshes_is_taken_without_collisions(
    tmp_path: Path, part: str
) -> None:
    shape = '<geometry><mesh filename="package://nowhere/a.stl"/></geometry>'
    inside = f"<{part}>{shape}</{part}>" if part else ""
    path = tmp_path / "robot.urdf"
    path.write_text(robot(link("base", inside), link("tip", inside), joint("j", "base", "tip")))

    character = load_character(str(path), collides=False)

    assert character.layout.size == 1
    assert character.links[1].mass == 1.0
    assert any("these have 1 kg each" in line for line in character.warnings)
    if part == "collision":
        assert "'collision: none' does without" in refusal(path)


# xacro

XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="mass" default="2"/>
  <xacro:arg name="second" default="false"/>
  <xacro:property name="length" value="${3 * 0.25}"/>
  <xacro:include filename="$(find some_description)/urdf/part.xacro"/>
  <link name="world"/>
  <xacro:part name="one" parent="world" mass="$(arg mass)" length="${length}"/>
  <xacro:if value="$(arg second)">
    <xacro:part name="two" parent="one" mass="1" length="1"/>
  </xacro:if>
</robot>"""
PART = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:macro name="part" params="name parent mass length">
    <link name="${name}"><inertial><mass value="${mass}"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="j_${name}" type="continuous"><parent link="${parent}"/><child link="${name}"/>
      <origin xyz="0 0 ${length}"/></joint>
  </xacro:macro>
</robot>"""


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """A package that is not installed, and whose folder has another name."""
    pytest.importorskip("xacro")
    folder = tmp_path / "src" / "some_repository" / "urdf"
    folder.mkdir(parents=True)
    manifest = "<package><name>some_description</name></package>"
    (folder.parent / "package.xml").write_text(manifest)
    (folder / "part.xacro").write_text(PART)
    (folder / "arm.urdf.xacro").write_text(XACRO)
    return folder


def test_a_xacro_is_expanded(workspace: Path) -> None:
    character = load_character(str(workspace / "arm.urdf.xacro"))

    assert character.name == "arm"
    assert [link.name for link in character.links] == ["world", "one"]
    assert character.mass == 2.0
    assert character.links[1].joint.pose_in_parent.position == (0.0, 0.0, 0.75)
    assert "xacro:" not in character.loading.urdf_text


def test_a_characters_file_gives_a_xacro_its_arguments(workspace: Path) -> None:
    yaml = workspace / "arm.yaml"
    yaml.write_text("urdf: arm.urdf.xacro\nxacro: {mass: 3.5, second: true}\n")

    character = load_character(str(yaml))

    assert [link.mass for link in character.links[1:]] == [3.5, 1.0]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("some_description", "no_such_package", "no_such_package"),
        ("${length}", "${lenght}", "lenght"),
        ("<link name=", "<link name", "xacro:"),
        ('"$(arg mass)"', '"$(arg weight)"', "weight"),
    ],
)
def test_a_xacro_that_cannot_be_expanded_is_refused_with_its_reason(
    workspace: Path, old: str, new: str, words: str
) -> None:
    path = workspace / "arm.urdf.xacro"
    path.write_text(XACRO.replace(old, new))

    line = refusal(path)

    assert line.startswith(f"{path}: xacro: ")
    assert words in line


def test_without_the_package_a_line_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "arm.xacro"
    path.write_text(XACRO)
    monkeypatch.setitem(sys.modules, "xacro", None)

    with pytest.raises(CharacterError, match=r"pip install 'actuated_characters\[xacro\]'"):
        load_character(str(path))
