""".obj files: as trimesh reads them, and what broken ones are refused with."""

import os
import time
from pathlib import Path

import numpy as np
import pybullet_data
import pytest
import trimesh

from msgs_config.arrays import FloatArray
from msgs_config.character.meshes.triangles import read_vertices
from msgs_config.character.meshes.wavefront import read_wavefront
from msgs_config.errors import CharacterError

ARM = Path(pybullet_data.getDataPath()) / "franka_panda/meshes/visual"
FOUR = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def write(folder: Path, text: str) -> Path:
    path = folder / "mesh.obj"
    path.write_text(text, encoding="latin-1")
    return path


def sorted_rows(rows: FloatArray) -> FloatArray:
    """Rows in the order of their rounded numbers."""
    rounded = np.round(rows, 9)
    return rows[np.lexsort(rounded.T)]


@pytest.mark.parametrize("name", ["link1.obj", "link2.obj"])
def test_triangles_normals_and_texture_are_those_that_trimesh_finds(name: str) -> None:
    theirs = trimesh.load_mesh(ARM / name, process=False)

    ours = read_wavefront(ARM / name)

    corners = ours.vertices[ours.corners[:, :, 0]].reshape(-1, 9)
    np.testing.assert_allclose(
        sorted_rows(corners), sorted_rows(np.array(theirs.triangles).reshape(-1, 9)), atol=1e-12
    )
    uvs = ours.uvs[ours.corners[:, :, 1]].reshape(-1, 6)
    expected = np.array(theirs.visual.uv)[theirs.faces].reshape(-1, 6)
    np.testing.assert_allclose(sorted_rows(uvs), sorted_rows(expected), atol=1e-12)
    normals = ours.normals[ours.corners[:, :, 2]]
    faces = np.cross(*np.diff(ours.vertices[ours.corners[:, :, 0]], axis=1).swapaxes(0, 1))
    assert ((normals * faces[:, np.newaxis]).sum(axis=-1) > 0.0).mean() > 0.99
    assert ours.picture == ARM / "colors.png"


@pytest.mark.parametrize(
    ("faces", "expected"),
    [
        ("f 1 2 3 4", [(0, 1, 2), (0, 2, 3)]),  # a fan
        ("f -4 -3 -2", [(0, 1, 2)]),  # counted back
        ("f 1/1 2/1 3/1", [(0, 1, 2)]),
        ("f 1//1 2//1 3//1\nf 1/1/1 3/1/1 4/1/1", [(0, 1, 2), (0, 2, 3)]),
        ("f 1 2", []),
        ("f", []),
        ("", []),
    ],
)
def test_faces_are_triangles_of_what_they_name(
    tmp_path: Path, faces: str, expected: list[tuple[int, int, int]]
) -> None:
    found = read_wavefront(write(tmp_path, f"{FOUR}vt 0.5\nvn 0 0 2\n{faces}\n"))

    assert [tuple(row) for row in found.corners[:, :, 0].tolist()] == expected
    np.testing.assert_array_equal(found.uvs, [(0.5, 0.0)])  # what is not given is 0
    has_normals = "//" in faces
    assert (found.corners[:, :, 2] == (0 if has_normals else -1)).all()


def test_an_index_counts_back_from_where_it_stands(tmp_path: Path) -> None:
    found = read_wavefront(write(tmp_path, f"{FOUR}f -1 -2 -3\n{FOUR}f -1 -2 -3\n"))

    assert found.corners[:, :, 0].tolist() == [[3, 2, 1], [7, 6, 5]]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("v 0 0 x\n", "could not convert"),
        ("v 0 0 nan\n", "not finite"),
        ("vn 0 0 inf\n", "not finite"),
        (FOUR + "f 1 2 5\n", "names something that is not there"),
        (FOUR + "f 1 2 0\n", "names something that is not there"),
        (FOUR + "f 1 2 -5\n", "names something that is not there"),
        (FOUR + "f 1/1 2/1 3/1\n", "names something that is not there"),
        (FOUR + "f 1/1/1/1 2 3\n", "more than three numbers"),
        (FOUR + "f 1 2 a\n", "invalid literal"),
        (FOUR + "f 1 2 -\n", "line 5 is no face"),
        (FOUR + f"f 1 2 {10**30}\n", ""),
    ],
)
def test_a_broken_file_is_one_line_that_names_it(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(CharacterError, match=rf"mesh\.obj cannot be used: .*{reason}") as error:
        read_wavefront(write(tmp_path, text))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("library", "used", "found"),
    [
        ("newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd -s 2 2 2 b.png\n", "a", "a.png"),
        ("newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd -s 2 2 2 b.png\n", "b", "b.png"),
        ("newmtl a\nmap_Kd none.png\nnewmtl b\nmap_Kd b.png\n", "a\nusemtl b", "b.png"),
        ("newmtl a\nKd 1 1 1\n", "a", None),
        ("newmtl a\nmap_Kd a.png\n", "c", None),
        (f"newmtl a\nmap_Kd {'x' * 5000}\n", "a", None),
        ("newmtl a\nmap_Kd\nmap_Kd \0\n", "a", None),
        ("newmtl\nmap_Kd ..\n", "a", None),
    ],
)
def test_the_texture_is_the_first_of_a_material_in_use_that_is_there(
    tmp_path: Path, library: str, used: str, found: str | None
) -> None:
    (tmp_path / "x y.mtl").write_text(library)
    for name in ("a.png", "b.png"):
        (tmp_path / name).touch()

    mesh = read_wavefront(write(tmp_path, f"mtllib x y.mtl\n{FOUR}usemtl {used}\nf 1 2 3\n"))

    assert mesh.picture == (None if found is None else tmp_path / found)


def test_a_file_that_has_changed_is_read_again(tmp_path: Path) -> None:
    path = write(tmp_path, FOUR)
    before = read_vertices(path)
    before[:] = 7.0  # of whoever asked for it

    assert not (read_vertices(path) == 7.0).any()
    path.write_text(FOUR + "v 2 2 2\n")
    os.utime(path, ns=(0, time.time_ns()))
    assert len(read_vertices(path)) == 5
