"""Flat parts of meshes get a thickness of 2 mm, about where they are; others stay as they are."""

import mujoco
import numpy as np
import pytest

from msgs_config.character.meshes.thickness import is_flat, with_thickness

SQUARE = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)])
FLAT = {
    "triangle": SQUARE[:3],
    "square": SQUARE,
    "line": SQUARE[:2].repeat(3, axis=0),
    "point": SQUARE[:1],
    "tiny": 1e-9 * SQUARE,
}


@pytest.mark.parametrize("name", FLAT)
def test_what_is_flat_gets_a_thickness_about_where_it_is(name: str) -> None:
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, np.array([0.8, 0.36, -0.48, 0.0]))
    points = FLAT[name] @ axes.reshape(3, 3).T + (3.0, -2.0, 1.0)

    thick = with_thickness(points)

    assert is_flat(points)
    assert not is_flat(thick)
    offsets = np.linalg.norm(thick[:, np.newaxis] - points, axis=2).min(axis=1)
    np.testing.assert_allclose(thick.mean(axis=0), points.mean(axis=0), atol=1e-12)
    assert offsets.min() > 0.99e-3 and offsets.max() < 1.8e-3  # m; a cube's corners at most
    assert_has_a_hull(thick)


def assert_has_a_hull(points: np.ndarray) -> None:
    """MuJoCo compiles it, as a shape of a body that moves."""
    spec = mujoco.MjSpec()
    mesh = spec.add_mesh(name="mesh")
    mesh.uservert = points.ravel()
    body = spec.worldbody.add_body()
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="mesh")
    spec.compile()


def test_what_is_not_flat_stays_as_it_is() -> None:
    box = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 2e-4)])

    assert with_thickness(box) is box
