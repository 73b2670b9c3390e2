"""What the simulator's start costs: how often a URDF is parsed, and loaded into an engine."""

import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from msgs_config import files
from msgs_config.character.urdf.robot_description import robot_description
from msgs_config.messages import configuration
from sim_node.parameters import load_parameters
from sim_node.physics.probe import measure_probe
from sim_node.physics.simulation import Simulation
from sim_node.simulation_factory import make_character_setup, make_simulation_settings
from tests.support.engines import pybullet
from tests.support.physics import DATA


@pytest.fixture
def counts(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often a function was called, by its name."""
    files._parse_xml.cache_clear()  # another test of this process may have parsed the same text
    found = Counter[str]()

    def counted(owner: object, name: str) -> None:
        real: Callable[..., Any] = getattr(owner, name)

        def call(*arguments: object, **options: object) -> object:
            found[name] += 1
            return real(*arguments, **options)

        monkeypatch.setattr(owner, name, call)

    counted(files.expat, "ParserCreate")
    counted(pybullet, "loadURDF")
    return found


def test_a_urdf_is_parsed_once_and_loaded_to_be_probed_and_simulated(
    tmp_path: Path, counts: Counter[str]
) -> None:
    for name in ("damped.yaml", "turned_frames.urdf"):
        shutil.copy(DATA / name, tmp_path)
    file = tmp_path / "damped.yaml"

    (loaded,) = load_parameters({"character": str(file)}).characters
    sample = measure_probe(loaded.character, 9.81)
    setup = make_character_setup(loaded.character, loaded.values)
    with Simulation([setup], make_simulation_settings(loaded.values)):
        robot_description(loaded.character)
        configuration.describe(loaded.character, loaded.values, probe=sample)

    assert counts == {"ParserCreate": 1, "loadURDF": 2}
