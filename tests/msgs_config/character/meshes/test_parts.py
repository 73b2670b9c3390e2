"""The parts of a mesh: each object of an .obj file by itself, by any way of counting vertices."""

from pathlib import Path

import numpy as np
import pytest

from msgs_config.character.meshes.parts import read_parts
from msgs_config.errors import CharacterError

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
FACES = "f 1 2 3\nf 1/1/1 2/1/1 4/1/1\nf 1 3 4\nf 2 3 4\n"
COUNTED_BACK = "f -4 -3 -2\nf -4 -3 -1\nf -4 -2 -1\nf -3 -2 -1\n"
SECOND = TETRAHEDRON.replace("1", "3")


@pytest.mark.parametrize(
    "text",
    [
        f"o one\n{TETRAHEDRON}{COUNTED_BACK}o two\n{SECOND}{COUNTED_BACK}",
        f"{TETRAHEDRON}{SECOND}g one\no one\n{FACES}g two\nf 5 6 7\nf 6 7 8\n",
    ],
    ids=["objects", "groups"],
)
def test_objects_and_groups_are_parts(tmp_path: Path, text: str) -> None:
    file = tmp_path / "two.obj"
    file.write_text("vt 0 0\nvn 0 0 1\n" + text)

    one, two = read_parts(file)

    np.testing.assert_array_equal(one, [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    np.testing.assert_array_equal(two, 3.0 * one)


def test_a_broken_file_is_named(tmp_path: Path) -> None:
    file = tmp_path / "broken.obj"
    file.write_text("v 0 0\nf 1 2 3\n")

    with pytest.raises(CharacterError, match=r"broken\.obj"):
        read_parts(file)
