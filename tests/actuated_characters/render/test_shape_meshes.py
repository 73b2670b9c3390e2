"""Triangles of shapes against the volumes of geometry, and those of files against trimesh."""

from math import pi
from pathlib import Path

import numpy as np
import pytest
import trimesh

from actuated_characters.render.engine.shape_meshes import surface_of
from msgs_config.character.model import Shape, ShapeType
from msgs_config.errors import CharacterError

R, L = 0.1, 0.4


def volume(shape: Shape) -> float:
    """By the divergence theorem; negative where triangles are seen from within."""
    vertices, _, faces = surface_of(shape)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return float((a * np.cross(b, c)).sum() / 6.0)


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (Shape(ShapeType.BOX, (0.1, 0.2, 0.3)), 0.006),
        (Shape(ShapeType.SPHERE, (R,)), 4.0 / 3.0 * pi * R**3),
        (Shape(ShapeType.CYLINDER, (R, L)), pi * R**2 * L),
        (Shape(ShapeType.CAPSULE, (R, L)), pi * R**2 * (L + 4.0 / 3.0 * R)),
    ],
    ids=lambda value: value.type.value if isinstance(value, Shape) else "",
)
def test_a_shape_has_its_volume_and_is_seen_from_outside(shape: Shape, expected: float) -> None:
    assert volume(shape) == pytest.approx(expected, rel=1e-12 if len(shape.size) == 3 else 0.03)
    assert volume(shape) <= expected * (1.0 + 1e-12)


@pytest.mark.parametrize("suffix", [".stl", ".obj", ".glb", ".ply"])
@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_a_mesh_is_scaled_and_seen_from_outside(tmp_path: Path, suffix: str, mirror: float) -> None:
    file = tmp_path / f"box{suffix}"
    trimesh.creation.box(extents=(1.0, 2.0, 3.0)).export(file)

    shape = Shape(ShapeType.MESH, (0.1, 0.1, 0.1 * mirror), mesh=str(file))

    assert volume(shape) == pytest.approx(0.006, rel=1e-5)


def test_a_broken_mesh_is_one_clear_line(tmp_path: Path) -> None:
    file = tmp_path / "broken.obj"
    file.write_text("v 0 0\nf 1 2 x\n")

    with pytest.raises(CharacterError, match=r"broken\.obj") as error:
        surface_of(Shape(ShapeType.MESH, (1.0, 1.0, 1.0), mesh=str(file)))
    assert "\n" not in str(error.value)
