"""A file of another kind, given where a bag, a scene, a machine or parameters belong, is named."""

from pathlib import Path

import pytest

from actuated_characters.cli import main
from actuated_characters.runs.processes import MODULES
from msgs_config.errors import ConfigurationError
from msgs_config.file_kinds import refuse_other_kind
from tests.support.ros import Processes

POINTER = (
    "version https://git-lfs.github.com/spec/v1\n"
    "oid sha256:4d7a214614ab2935c943f9e0ff69d22eadbb8f32b1258daaa5e2ca24d17e2393\nsize 12345\n"
)
URDF = "<?xml version='1.0'?>\n<!-- <mujoco> -->\n<robot name='r'><link name='a'/></robot>"
KINDS = {  # name: content, what it is, what to do
    "walk.fbx": ("Kaydara FBX Binary  \0", "an FBX scene", "motion import"),
    "disguised.yaml": ("; FBX 7.4.0 project file", "an FBX scene", "motion import"),
    "unknown.kind": ("PK\3\4", "an archive of NumPy arrays", "motion import"),
    "A.C3D": ("\2P", "a motion capture (C3D)", "motion import"),
    "robot.usda": ("#usda 1.0", "a USD scene", "URDF"),
    "walk.bvh": ("HIERARCHY\nROOT Hips\n", "a motion capture (BVH)", "motion import"),
    "walk.npz": ("PK\3\4", "an archive of NumPy arrays", "motion import"),
    "robot.urdf": (URDF, "the description of a robot (URDF)", "--character"),
    "robot.xml": (URDF, "the description of a robot (URDF)", "--character"),
    "model.xml": ("<!-- a --><mujoco model='m'/>", "a model of MuJoCo (MJCF)", "--character"),
    "world.xml": ("<sdf version='1.9'/>", "a model or world of Gazebo (SDF)", "URDF"),
    "other.xml": ("<launch/>", "an XML file whose root is <launch>", "URDF"),
    "empty.xml": ("", "an XML file", "URDF"),
    "robot.urdf.xacro": ("<robot/>", "a xacro file", "--character"),
    "MODEL.SDF": ("<sdf/>", "a model or world of Gazebo (SDF)", "URDF"),
    "old.bag": ("#ROSBAG V2.0\n", "a bag of ROS 1", "rosbags-convert"),
    "pointer.yaml": (POINTER, "a Git LFS pointer", "git lfs pull"),
    "pointer.mcap": (POINTER, "a Git LFS pointer", "git lfs pull"),
    "pointer": (POINTER, "a Git LFS pointer", "git lfs pull"),
}
COMMANDS = {
    "a run or a bag": [
        ("info", "FILE"),
        ("replay", "FILE"),
        ("report", "FILE"),
        ("render", "FILE"),
        ("view", "FILE"),
        ("fork", "FILE", "--at", "1"),
        ("compare", "FILE", "FILE"),
    ],
    "a run or the directory of a bag": [("info", "FILE", "--recover")],
    "a run, a bag or a clip": [
        ("export", "FILE", "--output", "states.csv"),
        ("export", "FILE", "--output", "motion.glb"),
    ],
    "a scene": [("play", "--no-view", "--scene", "FILE")],
    "a state machine": [("run", "--in-process", "--machine", "FILE", "--output", "results")],
    "a file of keyframes": [("run", "--in-process", "--keyframes", "FILE", "--output", "results")],
}


@pytest.fixture(params=KINDS)
def given(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, str, str]:
    """A file of a kind, what it is, and what its message says is to be done."""
    content, what, advice = KINDS[request.param]
    file = tmp_path / request.param
    file.write_text(content)
    return file, what, advice


def test_its_kind_and_a_way_out_are_named(given: tuple[Path, str, str]) -> None:
    file, what, advice = given

    with pytest.raises(ConfigurationError) as caught:
        refuse_other_kind(file, "a scene", (".yaml", ".mcap"), ConfigurationError)

    assert str(caught.value).startswith(f"{file} is {what}, not a scene; ")
    assert advice in str(caught.value)


def test_what_is_wanted_unknown_or_not_there_is_left_to_its_reader(tmp_path: Path) -> None:
    for name in ("scene.yaml", "SCENE.YAML", "unknown.kind", "pointer"):
        (tmp_path / name).write_text("a: 1")
        refuse_other_kind(tmp_path / name, "a scene", (".yaml",), ConfigurationError)
    refuse_other_kind(tmp_path / "missing.fbx", "a scene", (), ConfigurationError)
    refuse_other_kind(Path("a\0b.fbx"), "a scene", (), ConfigurationError)
    refuse_other_kind(tmp_path, "a scene", (), ConfigurationError)


@pytest.mark.parametrize(
    ("wanted", "arguments"),
    [(wanted, each) for wanted, lines in COMMANDS.items() for each in lines],
    ids=lambda given: given if isinstance(given, str) else given[0],
)
@pytest.mark.parametrize("name", ["walk.fbx", "robot.urdf.xacro", "pointer.yaml", "model.xml"])
def test_every_command_says_it_in_one_line_and_leaves_nothing(
    name: str,
    wanted: str,
    arguments: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_text(KINDS[name][0])

    assert main([name if each == "FILE" else each for each in arguments]) == 1

    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert f"{name} is {KINDS[name][1]}, not {wanted}" in line
    assert [each.name for each in tmp_path.iterdir()] == [name]


def test_a_bag_whose_files_were_not_fetched_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    for name in ("metadata.yaml", "bag_0.mcap"):
        (bag / name).write_text(POINTER)

    assert main(["info", str(bag)]) == 1

    assert "metadata.yaml is a Git LFS pointer" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("name", ["walk.bvh", "robot.urdf", "pointer.yaml"])
def test_a_node_says_it_of_a_file_of_parameters(
    name: str, tmp_path: Path, processes: Processes
) -> None:
    (tmp_path / name).write_text(KINDS[name][0])

    node = processes.python(
        "-m", MODULES["sim_node"], "--ros-args", "--params-file", str(tmp_path / name)
    )

    assert node.wait() == 1
    assert f"{name} is {KINDS[name][1]}, not a file of parameters" in node.stderr
