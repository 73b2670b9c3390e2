"""How high a terrain is, by rays of MuJoCo against formulas."""

from pathlib import Path

import numpy as np
import pytest

from msgs_config.character.model import UrdfOptions
from msgs_config.character.terrain import terrain_shapes
from msgs_config.terrain.file import terrain_urdf
from msgs_config.terrain.heights import Heights


def heights(folder: Path, text: str) -> Heights:
    file = folder / "terrain.yaml"
    return Heights(terrain_shapes(UrdfOptions(file, terrain_urdf(file, text), fixed_base=True)))


def test_stairs_and_a_slope_are_as_high_as_they_rise(tmp_path: Path) -> None:
    found = heights(
        tmp_path,
        "stairs: [{at: [1, 0], steps: 3, rise: 0.15, tread: 0.4}]\n"
        "slopes: [{at: [1, 5], angle: 15, length: 2}]",
    ).at(np.array([(0.9, 0.0), (1.1, 0.0), (1.5, 0.0), (2.0, 0.5), (2.0, 5.0), (3.5, 5.0)]))

    expected = [0.0, 0.15, 0.3, 0.45, np.tan(np.radians(15.0)), 2.0 * np.tan(np.radians(15.0))]
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_where_there_is_no_ground_there_is_no_height(tmp_path: Path) -> None:
    text = "ground: none\nboxes: [{at: [0, 0], size: [1, 1, 0.2]}]"

    found = heights(tmp_path, text).at(np.array([(0.0, 0.0), (2.0, 0.0)]))

    assert found[0] == pytest.approx(0.2, abs=1e-9)
    assert np.isnan(found[1])
