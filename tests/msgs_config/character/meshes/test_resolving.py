"""Meshes are found by whichever path names them, by the engine too, and checked before it reads."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pybullet_data
import pytest

from msgs_config.character.file import read_character_file, shipped_characters
from msgs_config.character.loading import load_character
from msgs_config.character.meshes import resolving as meshes
from msgs_config.character.model import UrdfOptions
from msgs_config.errors import CharacterError
from sim_node.physics.bullet.c_library import captured_output
from tests.support.engines import Engine, load_urdf, pybullet
from tests.support.urdf import inertial, joint, link, refusal, robot, write_character

CUBE = Path(pybullet_data.getDataPath()) / "cube.obj"
STL = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "meshes" / "link_1.stl"

WriteRobot = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> WriteRobot:
    """Writes a URDF whose only link collides with a mesh; returns its path."""

    def write_file(mesh: str, folder: str = "robot/urdf", part: str = "collision") -> Path:
        path = tmp_path / folder / "robot.urdf"
        path.parent.mkdir(parents=True, exist_ok=True)
        shape = f'<geometry><mesh filename="{mesh}"/></geometry>'
        path.write_text(robot(link("body", inertial() + f"<{part}>{shape}</{part}>")))
        return path

    return write_file


def put(source: Path, target: Path) -> Path:
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(source.read_bytes())
    return target


def mesh_in_the_engine(urdf: Path) -> list[Path]:
    """The mesh files that the engine has loaded to collide with."""
    client = Engine()
    try:
        body = load_urdf(client, read_character_file(str(urdf)).loading)
        shapes = pybullet.getCollisionShapeData(body, -1, physicsClientId=client)
        return [Path(shape[4].decode()) for shape in shapes]
    finally:
        client.close()


PLACES = {  # how a mesh is named, and where it lies below the folder of `robot/`
    "beside the URDF": ("cube.obj", "robot/urdf/cube.obj"),
    "in a folder beside the URDF": ("meshes/cube.obj", "robot/urdf/meshes/cube.obj"),
    "above the URDF": ("../meshes/cube.obj", "robot/meshes/cube.obj"),
    "in a package that is not installed": (
        "package://robot/meshes/cube.obj",
        "robot/meshes/cube.obj",
    ),
    "in a package whose name is a slash": (
        "package:///robot/meshes/cube.obj",
        "robot/meshes/cube.obj",
    ),
    "in the package of the URDF, whose folder has another name": (
        "package://robot_of_arms/meshes/cube.obj",
        "robot/meshes/cube.obj",
    ),
    "in a package of no name": ("package://meshes/cube.obj", "robot/urdf/meshes/cube.obj"),
}


@pytest.mark.parametrize("case", PLACES)
def test_a_mesh_is_found_from_the_urdf(write: WriteRobot, tmp_path: Path, case: str) -> None:
    name, place = PLACES[case]
    mesh = put(CUBE, tmp_path / place)

    urdf = write(name)

    (shape,) = load_character(str(urdf)).links[0].shapes
    (loaded,) = mesh_in_the_engine(urdf)
    assert Path(shape.mesh).samefile(mesh)
    assert loaded.samefile(mesh)


@pytest.mark.parametrize("name", [str(CUBE), CUBE.as_uri(), "package://pybullet_data/cube.obj"])
def test_a_mesh_is_found_wherever_it_lies(write: WriteRobot, name: str) -> None:
    urdf = write(name)

    (shape,) = load_character(str(urdf)).links[0].shapes
    (loaded,) = mesh_in_the_engine(urdf)
    assert Path(shape.mesh) == CUBE
    assert loaded == CUBE


def test_a_mesh_is_found_in_a_ros_package(
    write: WriteRobot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Arrange
    prefix = tmp_path / "install"
    mesh = put(CUBE, prefix / "share" / "my_robot" / "meshes" / "cube.obj")
    marker = prefix / "share" / "ament_index" / "resource_index" / "packages" / "my_robot"
    marker.parent.mkdir(parents=True)
    marker.touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(prefix))

    # Act
    (loaded,) = mesh_in_the_engine(write("package://my_robot/meshes/cube.obj"))

    # Assert
    assert loaded == mesh


def test_a_file_in_the_working_directory_is_not_taken_for_the_mesh(
    write: WriteRobot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = put(CUBE, tmp_path / "robot" / "urdf" / "cube.obj")
    elsewhere = put(CUBE, tmp_path / "elsewhere" / "cube.obj").parent
    monkeypatch.chdir(elsewhere)

    (loaded,) = mesh_in_the_engine(write("cube.obj"))

    assert loaded.samefile(mesh)


missing_mesh = pytest.mark.parametrize(
    "name",
    ["gone.obj", "/gone.obj", "package://gone/gone.obj", "package://__main__/x", "", "a" * 300],
)


@missing_mesh
def test_a_mesh_to_collide_with_that_does_not_exist_is_refused_by_file_link_and_path(
    write: WriteRobot, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    urdf = write(name)

    line = refusal(urdf)

    for words in (str(urdf), "'body'", "mesh", name, "'collision: none' does without"):
        assert words in line
    assert capfd.readouterr() == ("", "")


@missing_mesh
def test_without_a_mesh_that_is_only_seen_the_rest_is_loaded_with_a_warning(
    write: WriteRobot, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    whole = load_character(str(write(name, part="visual")))

    (warning,) = [each for each in whole.warnings if "only seen" in each]
    for words in ("'body'", "mesh", name):
        assert words in warning
    assert whole.links[0].shapes == ()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("part", ["visual", "collision"])
def test_without_collisions_a_mesh_may_be_missing(tmp_path: Path, part: str) -> None:
    """The rest is loaded: what is seen, and mass and inertia to the last bit."""
    shapes = [
        f"<{kind}><geometry>{shape}</geometry></{kind}>"
        for kind in (part, "collision")
        for shape in ('<mesh filename="gone.obj"/>', '<sphere radius="0.1"/>')
    ]
    path = write_character(
        tmp_path, robot(link("body", inertial() + "".join(shapes))), "collision: none\n"
    )

    (body,) = load_character(str(path)).links

    assert (body.mass, body.inertia_diagonal) == (1.0, (1.0, 1.0, 1.0))
    assert body.collision_shapes == ()
    assert {shape.type.value for shape in body.shapes} == {"sphere"}
    client = Engine()
    engine_body = load_urdf(client, read_character_file(str(path)).loading)
    assert not pybullet.getCollisionShapeData(engine_body, -1, physicsClientId=client)
    client.close()


def test_a_mesh_that_is_too_large_is_refused(
    write: WriteRobot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(CUBE, tmp_path / "robot" / "urdf" / "cube.obj")
    monkeypatch.setattr(meshes, "MAX_MESH_BYTES", 10)

    with pytest.raises(CharacterError, match="larger than"):
        load_character(str(write("cube.obj")))


VERTICES = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n"
STL_BYTES = STL.read_bytes()
UNSOUND = {  # each of those with an index has crashed the engine
    "x.obj": {
        "an index too large": VERTICES + "f 1 2 4\n",
        "an index of nought": VERTICES + "f 0 1 2\n",
        "an index too far back": VERTICES + "f -4 -1 -2\n",
        "a normal that is not there": VERTICES + "f 1//1 2//1 3//2\n",
        "a face before its vertices": "f 1 2 3\n" + VERTICES,
        "half a face": VERTICES + "f 1//1 2//1 3//",
        "no number": "v 0 0 zero\n",
        "not a number": "v 0 0 nan\n",
        "blanks that are none to the engine": "v\x0b0 0 0\n" * 20 + "f 15 16 17\n",
        "ends of lines that are none to the engine": "# x\x0cv 0 0 0\n" * 20 + "f 15 16 17\n",
        "a long line": VERTICES + "f" + " 1 2 3" * 1000,
    },
    "x.stl": {
        "nothing": b"",
        "half a file": STL_BYTES[: len(STL_BYTES) // 2],
        "too many triangles": STL_BYTES[:80] + b"\xff\xff\xff\xff" + STL_BYTES[84:],
        "text": b"solid x\nendsolid x\n",
    },
    "x.dae": {"COLLADA": "<COLLADA/>"},
    "x.glb": {"another file": "x"},
    "x.ply": {"another file": "x"},
    "x.fbx": {"another format": "x"},
}
UNSOUND_CASES = [(name, case) for name, cases in UNSOUND.items() for case in cases]


@pytest.mark.parametrize(("name", "case"), UNSOUND_CASES)
def test_an_unsound_mesh_to_collide_with_is_refused(
    write: WriteRobot, tmp_path: Path, name: str, case: str
) -> None:
    urdf = write(name)
    content = UNSOUND[name][case]
    (urdf.parent / name).write_bytes(content if isinstance(content, bytes) else content.encode())

    line = refusal(urdf)

    assert str(urdf) in line
    assert name in line


@pytest.mark.parametrize("source", [CUBE, STL], ids=lambda path: path.suffix)
def test_a_sound_mesh_is_taken(write: WriteRobot, source: Path) -> None:
    (loaded,) = mesh_in_the_engine(write(str(source)))

    assert loaded == source


def test_a_mesh_that_is_only_seen_may_be_of_any_type(write: WriteRobot, tmp_path: Path) -> None:
    urdf = write("seen.glb", part="visual")
    (urdf.parent / "seen.glb").write_bytes(b"x")

    (shape,) = load_character(str(urdf)).links[0].shapes

    assert Path(shape.mesh) == urdf.parent / "seen.glb"


# What the engine is given is the URDF


def load_file(client: Engine, loading: UrdfOptions) -> int:
    """Let the engine read the URDF's file by itself; the body's number."""
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE if loading.inertia_from_file else 0
    with captured_output():
        return int(
            pybullet.loadURDF(
                str(loading.urdf_path),
                useFixedBase=loading.fixed_base,
                globalScaling=loading.scale,
                flags=flags,
                physicsClientId=client,
            )
        )


def numbers_of(client: Engine, body: int) -> list[object]:
    """All numbers that the engine has of a body's links and joints."""
    joints = range(pybullet.getNumJoints(body, physicsClientId=client))
    return [
        *(pybullet.getJointInfo(body, joint, physicsClientId=client) for joint in joints),
        *(
            pybullet.getDynamicsInfo(body, link, physicsClientId=client)[:5]
            for link in (-1, *joints)
        ),
        *(
            shape[2:4] + shape[5:]
            for link in (-1, *joints)
            for shape in pybullet.getCollisionShapeData(body, link, physicsClientId=client)
        ),
    ]


@pytest.mark.parametrize("name", [name for name in shipped_characters() if name != "laikago"])
def test_the_engine_makes_the_same_body_of_our_text_as_of_the_file(name: str) -> None:
    """To the last bit; laikago has other bounds than its file."""
    loading = read_character_file(name).loading
    client = Engine()

    ours, theirs = load_urdf(client, loading), load_file(client, loading)

    assert numbers_of(client, ours) == numbers_of(client, theirs)
    client.close()


def test_numbers_may_be_parted_by_tabs_and_lines_be_long(tmp_path: Path) -> None:
    """By itself the engine takes a tab for an end, and breaks a line of 8192 bytes in two."""
    body = link("body", inertial(origin='<origin xyz="1\t2&#9;3"/>'))
    path = write_character(tmp_path, robot("<!-- -->" * 1020, body), "inertia: file\n")

    (loaded,) = load_character(str(path)).links

    assert loaded.inertial_pose.position == (1.0, 2.0, 3.0)


def test_a_continuous_joint_has_no_bounds_whatever_its_limit_says(tmp_path: Path) -> None:
    """The engine does not keep them either, but says that it had them."""
    path = write_character(
        tmp_path, robot(link("a"), link("b"), joint("j", "a", "b", "continuous"))
    )

    (_, hinge) = load_character(str(path)).moving_joints

    assert (hinge.lower, hinge.upper, hinge.effort_limit) == (-np.inf, np.inf, 5.0)


def test_no_copy_is_left_behind(tmp_path: Path) -> None:
    code = "from msgs_config.character.loading import load_character; load_character('kuka')"

    subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).parents[3],
        env=os.environ | {"TMPDIR": str(tmp_path)},
        check=True,
        timeout=60,
        capture_output=True,
    )

    assert list(tmp_path.iterdir()) == []
