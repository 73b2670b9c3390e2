"""COLLADA and .stl files of text: read as trimesh and RViz read them, and given to the engine."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from msgs_config.character.file import read_character_file
from msgs_config.character.meshes import triangles
from msgs_config.character.meshes.triangles import read_vertices
from msgs_config.errors import CharacterError
from tests.support.engines import Engine, load_urdf, pybullet
from tests.support.urdf import inertial, link, refusal, robot

WEDGE = trimesh.creation.box(extents=(0.2, 0.4, 0.6)).apply_translation((0.3, 0.0, 0.1))
TURNED = trimesh.transformations.rotation_matrix(0.7, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3))


def write_mesh(path: Path, unit: str = "1", up: str = "Z_UP") -> Path:
    """A wedge, whose node is turned and moved, in a COLLADA file; an .stl of text has it as it is.

    trimesh writes the geometry, and leaves the unit, the axis that is up and the node alone.
    """
    if path.suffix == ".stl":
        path.write_text(WEDGE.export(file_type="stl_ascii"))
        return path
    text = WEDGE.export(file_type="dae").decode()
    matrix = " ".join(repr(float(number)) for number in TURNED.ravel())
    text = text.replace("<up_axis>Y_UP", f'<unit name="x" meter="{unit}"/><up_axis>{up}')
    assert f'meter="{unit}"' in text
    head, node, rest = text.partition('<node id="node0"')
    end = rest.index(">") + 1
    path.write_text(f"{head}{node}{rest[:end]}<matrix>{matrix}</matrix>{rest[end:]}")
    return path


def write_robot(directory: Path, mesh: str, scale: str = "1 1 1") -> Path:
    shape = f'<geometry><mesh filename="{mesh}" scale="{scale}"/></geometry>'
    path = directory / "robot.urdf"
    path.write_text(robot(link("body", inertial() + f"<collision>{shape}</collision>")))
    return path


def test_what_engines_are_given_has_the_normals_of_its_triangles(tmp_path: Path) -> None:
    given = tmp_path / "given.stl"
    given.write_bytes(triangles._stl_of(write_mesh(tmp_path / "wedge.dae")))

    numbers = np.frombuffer(given.read_bytes()[84:], np.dtype("(12,)<f4, <u2"))["f0"]

    theirs = trimesh.load_mesh(given, process=False).triangles
    np.testing.assert_allclose(numbers[:, :3], trimesh.triangles.normals(theirs)[0], atol=1e-6)


def bounds(points: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    return np.array([points.min(axis=0), points.max(axis=0)])


@pytest.mark.parametrize("up", ["Z_UP", "Y_UP"])
@pytest.mark.parametrize("unit", ["1", "0.001"])
def test_collada_is_read_as_rviz_reads_it(tmp_path: Path, unit: str, up: str) -> None:
    """Its nodes' transforms and its unit count, the axis that is up does not."""
    moved = WEDGE.vertices @ TURNED[:3, :3].T + TURNED[:3, 3]

    found = read_vertices(write_mesh(tmp_path / "wedge.dae", unit, up))

    np.testing.assert_allclose(bounds(found), bounds(moved) * float(unit), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", ["wedge.dae", "wedge.stl"])
def test_another_library_reads_the_same_triangles(tmp_path: Path, name: str) -> None:
    path = write_mesh(tmp_path / name)

    ours = read_vertices(path).reshape(-1, 3, 3)

    (theirs,) = trimesh.load_scene(path).dump()
    np.testing.assert_allclose(ours, theirs.triangles, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("name", ["wedge.dae", "wedge.stl"])
def test_the_engine_collides_with_it(tmp_path: Path, name: str) -> None:
    """A ray along each axis hits the hull of the wedge where geometry says, scale and all."""
    mesh = write_mesh(tmp_path / name)
    hull = trimesh.load_scene(mesh).to_geometry().apply_scale((0.5, 1.0, 2.0))
    client = Engine()
    try:
        loading = read_character_file(str(write_robot(tmp_path, name, "0.5 1 2"))).loading
        body = load_urdf(client, loading)
        for axis in np.eye(3):
            start, end = hull.centroid - 2.0 * axis, hull.centroid + 2.0 * axis
            _, _, fraction, point, _ = pybullet.rayTest(start, end, physicsClientId=client)[0]
            assert 0.0 < fraction < 1.0
            distance = trimesh.proximity.closest_point_naive(hull, [point])[1]
            assert distance[0] < 0.002  # the engine's margin about a hull is 1 mm
        assert body == 0
    finally:
        client.close()


def test_a_file_that_was_written_again_is_read_again(tmp_path: Path) -> None:
    path = write_mesh(tmp_path / "wedge.dae", "1")
    first = bounds(read_vertices(path))

    write_mesh(path, "0.001")

    np.testing.assert_allclose(bounds(read_vertices(path)), first * 0.001, rtol=1e-6)


def with_nodes_of_nodes(text: str) -> str:
    """Ten nodes in each of ten in each of ten, and so on, without anything to see."""
    below = [f'<instance_node url="#n{n}"/>' * 10 for n in range(8)]
    levels = [f'<node id="n{n}">{inside}</node>' for n, inside in enumerate(["", *below])]
    library = f"<library_nodes>{''.join(levels)}</library_nodes>"
    text = text.replace("<library_visual_scenes>", library + "<library_visual_scenes>")
    return text.replace("<instance_geometry", '<instance_node url="#n8"/><instance_geometry', 1)


BROKEN: dict[str, Callable[[str], str]] = {
    "a thousand million nodes": with_nodes_of_nodes,
    "half a file": lambda text: text[: len(text) // 2],
    "no geometry": lambda text: text.replace("instance_geometry", "instance_camera"),
    "a document type": lambda text: text.replace("<COLLADA", "<!DOCTYPE x><COLLADA", 1),
    "a vertex at infinity": lambda text: text.replace(" 0.4 ", " 1e99 ", 1),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_collada_is_refused_in_one_line(tmp_path: Path, case: str) -> None:
    path = write_mesh(tmp_path / "wedge.dae")
    path.write_text(BROKEN[case](path.read_text()))

    line = refusal(write_robot(tmp_path, "wedge.dae"))

    assert str(path) in line
    assert "cannot be used" in line


def test_half_a_triangle_of_text_is_refused(tmp_path: Path) -> None:
    path = write_mesh(tmp_path / "wedge.stl")
    text = path.read_text()
    path.write_text(text[: text.rindex("vertex")])

    assert "ends within a triangle" in refusal(write_robot(tmp_path, "wedge.stl"))


def test_without_the_library_one_line_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_mesh(tmp_path / "wedge.dae")
    monkeypatch.setitem(sys.modules, "collada", None)

    with pytest.raises(CharacterError, match="pip install pycollada"):
        read_vertices(path)


@pytest.mark.parametrize("suffix", [".glb", ".ply"])
def test_without_trimesh_one_line_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    path = tmp_path / f"wedge{suffix}"
    WEDGE.export(path)
    monkeypatch.setitem(sys.modules, "trimesh", None)

    with pytest.raises(CharacterError, match=r"pip install -e '\.\[meshes\]'"):
        read_vertices(path)


@pytest.mark.parametrize("suffix", [".glb", ".ply"])
def test_other_formats_are_read_with_the_poses_of_their_parts(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"wedge{suffix}"
    scene = trimesh.Scene()
    scene.add_geometry(WEDGE, transform=TURNED if suffix == ".glb" else None)
    (scene if suffix == ".glb" else WEDGE).export(path)

    found = read_vertices(path)

    expected = WEDGE.vertices
    if suffix == ".glb":
        expected = trimesh.transformations.transform_points(expected, TURNED)
    distances = np.linalg.norm(expected[:, np.newaxis] - found, axis=2)
    assert distances.min(axis=0).max() < 1e-6 and distances.min(axis=1).max() < 1e-6
