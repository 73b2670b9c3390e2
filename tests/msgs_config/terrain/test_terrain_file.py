"""Terrains of YAML files: heights by rays of both engines, against formulas of each piece."""

import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.model import UrdfOptions
from msgs_config.errors import CharacterError
from msgs_config.terrain.file import read_terrain, shipped_terrains, terrain_urdf
from sim_node.physics.engine import make_world
from sim_node.physics.settings import WorldSettings

Height = Callable[[float, float], float]
"""The height at x along a piece and y to its left, m."""

STAIRS = "stairs: [{at: [1.0, 2.0], towards: 30, steps: 4, rise: 0.15, tread: 0.3, width: 1.5"
SLOPE = "slopes: [{at: [1.0, 2.0], towards: 30, angle: 15, length: 2.0, width: 1.5, landing: 0.5"


def stairs(x: float, y: float) -> float:
    return 0.15 * min(math.floor(x / 0.3) + 1, 4) if 0.0 < x < 2.2 and abs(y) < 0.75 else 0.0


def stairs_down(x: float, y: float) -> float:
    return stairs(x, y) if x < 2.2 else stairs(2.2 + 0.9 - x, y) if x < 3.1 else 0.0


def slope(x: float, y: float) -> float:
    up = min(x, 2.0) * math.tan(math.radians(15.0))
    return up if 0.0 < x < 2.5 and abs(y) < 0.75 else 0.0


def slope_down(x: float, y: float) -> float:
    return slope(x, y) if x < 2.5 else slope(4.5 - x, y)


def box(x: float, y: float) -> float:
    return 0.7 if abs(x) < 0.5 and abs(y) < 0.25 else 0.0


def squares(x: float, y: float) -> float:
    rows = ((0.0, 0.1, 0.1), (0.3, 0.0, 0.2))
    inside = 0.0 < x < 1.0 and abs(y) < 0.75
    return rows[math.floor(x / 0.5)][math.floor((y + 0.75) / 0.5)] if inside else 0.0


@pytest.mark.parametrize("engine", ["bullet", "mujoco"])
@pytest.mark.parametrize(
    ("text", "height"),
    [
        (STAIRS + "}]", stairs),
        (STAIRS + ", down: true}]", stairs_down),
        (SLOPE + "}]", slope),
        (SLOPE + ", down: true}]", slope_down),
        ("boxes: [{at: [1, 2, 0.2], towards: 30, size: [1.0, 0.5, 0.5]}]", box),
        (
            "squares: [{at: [1, 2], towards: 30, edge: 0.5, "
            "heights: [[0, 0.1, 0.1], [0.3, 0, 0.2]]}]",
            squares,
        ),
    ],
)
def test_the_ground_is_as_high_as_the_file_says(
    engine: str, text: str, height: Height, tmp_path: Path
) -> None:
    rng = np.random.default_rng(1)
    along = np.column_stack([rng.uniform(-0.5, 5.0, 400), rng.uniform(-1.2, 1.2, 400)])
    turn = np.radians(30.0)
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    above = np.column_stack([along @ axes.T + (1.0, 2.0), np.full(400, 5.0)])

    found = heights(tmp_path, text, engine, above)

    expected = [height(x, y) for x, y in along.tolist()]
    far = [abs(a - b) > 1e-6 for a, b in zip(found, expected, strict=True)]
    assert sum(far) == 0
    assert max(expected) > 0.1


def heights(folder: Path, text: str, engine: str, points: FloatArray) -> list[float]:
    file = folder / "terrain.yaml"
    loading = UrdfOptions(file, terrain_urdf(file, text), fixed_base=True)
    with make_world(WorldSettings(engine=engine, ground=False, terrain=loading)) as world:
        return [float(each) for each in world.heights_below(points)]


def test_random_squares_are_those_of_their_seed(tmp_path: Path) -> None:
    def drawn(seed: int) -> str:
        return terrain_urdf(
            tmp_path / "a.yaml",
            "squares: [{at: [0, 0], edge: 0.5, "
            f"random: {{rows: 9, columns: 8, least: 0.01, most: 0.2, seed: {seed}}}}}]",
        )

    assert drawn(1) == drawn(1) != drawn(2)
    tops = [float(size.split()[2]) for size in re.findall('size="([^"]*)"', drawn(1))]
    assert len(tops) > 60  # equal neighbours are one box
    assert min(tops) >= 0.01 and max(tops) <= 0.2
    assert len(set(tops)) > 40
    assert np.mean(tops) == pytest.approx(0.105, abs=0.02)


def test_a_mesh_lies_where_it_is_put(tmp_path: Path) -> None:
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = "1 2 4 3|5 7 8 6|1 5 6 2|3 4 8 7|1 3 7 5|2 6 8 4"
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {face}" for face in faces.split("|")]
    (tmp_path / "cube.obj").write_text("\n".join(lines))
    text = "meshes: [{file: cube.obj, at: [1.0, 0.0, 0.1], towards: 90, scale: 2.0}]"
    points = np.array([(0.5, 0.5, 5.0), (-0.9, 1.9, 5.0), (1.5, 0.5, 5.0)])

    assert heights(tmp_path, text, "bullet", points) == pytest.approx([2.1, 2.1, 0.0], abs=2e-3)


def test_there_is_something_to_stand_on(tmp_path: Path) -> None:
    with pytest.raises(CharacterError, match="neither a ground nor pieces"):
        terrain_urdf(tmp_path / "a.yaml", "ground: none")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("stair: []", "unknown key 'stair'"),
        ("stairs: 3", "stairs is 3; it must be a list of mappings"),
        ("stairs: [3]", "stairs 1 is 3; it must be a mapping"),
        ("stairs: [{at: [1, 2], steps: 2.5, rise: 1, tread: 1}]", "stairs 1.steps is 2.5; it must"),
        ("stairs: [{at: [1], steps: 2, rise: 1, tread: 1}]", "stairs 1.at is a list; it must be"),
        ("stairs: [{at: [1, 2], steps: 2, tread: 1}]", "stairs 1.rise is None; it must be"),
        ("boxes: [{at: [1, 2], size: [1, 2, -3]}]", "boxes 1.size is a list; it must be"),
        ("slopes: [{at: [1, 2], angle: 60, length: 3}]", "slopes 1.angle is 60; it must be"),
        ("squares: [{at: [1, 2], edge: 1}]", "squares 1.heights or squares 1.random says"),
        (
            "squares: [{at: [1, 2], edge: 1, heights: [[1, 2], [3]]}]",
            "squares 1.heights row 2 is a list; it must be a list of 2 finite numbers",
        ),
        ("squares: [{at: [1, 2], edge: 1, heights: []}]", "squares 1.heights is a list; it must"),
        (
            "squares: [{at: [0, 0], edge: 1, random: {rows: 999, columns: 999, most: 1}}]",
            "squares 1.random.columns is 999; it must be at most 20",
        ),
        ("ground: water", "ground is 'water'; it must be 'plane' or 'none'"),
        ("meshes: [{at: [1, 2]}]", "meshes 1.file is None; it must be a text"),
    ],
)
def test_what_is_wrong_is_one_line_with_its_place(text: str, sentence: str, tmp_path: Path) -> None:
    with pytest.raises(CharacterError) as caught:
        terrain_urdf(tmp_path / "a.yaml", text)

    assert str(caught.value).startswith(f"{tmp_path / 'a.yaml'}: ")
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_those_that_are_shipped_have_names() -> None:
    assert shipped_terrains() == ["rubble", "slope", "stairs", "steps"]
    assert all("<collision>" in read_terrain(name).urdf_text for name in shipped_terrains())
    with pytest.raises(CharacterError, match="did you mean 'stairs'"):
        read_terrain("stair")
