"""Which engine there is, which one is taken, and what is said of one that is not installed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from msgs_config.errors import ConfigurationError, SimulationError
from sim_node.parameters import load_parameters
from sim_node.physics import engine as seam
from sim_node.physics.engine import ENGINES, INSTALLED_ENGINES, describe_default_engine, make_world
from sim_node.physics.settings import SimulationSettings, WorldSettings
from tests.support.physics import simulation

MISSING = "a_package_that_nobody_has"


@pytest.mark.parametrize("name", INSTALLED_ENGINES)
def test_a_world_is_of_the_engine_that_is_named(name: str) -> None:
    loaded = load_parameters({"character": "pendulum", "engine": name})

    settings = SimulationSettings.of(loaded.values).world

    with make_world(settings) as world:
        assert type(world).__module__ == f"sim_node.physics.{name}.world"


def test_an_engine_that_is_not_installed_is_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ENGINES, "bullet", replace(ENGINES["bullet"], package=MISSING))

    with pytest.raises(ConfigurationError, match=f"'engine' is bullet, but {MISSING} is not") as at:
        make_world(WorldSettings(engine="bullet"))

    assert "\n" not in str(at.value)


def test_an_engine_that_stands_in_for_the_preferred_one_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(seam, "DEFAULT_ENGINE", "bullet")
    assert describe_default_engine("mujoco") == ()  # it was asked for

    monkeypatch.setattr(seam, "DEFAULT_ENGINE", "mujoco")

    (line,) = describe_default_engine("mujoco")
    assert line == "pybullet is not installed, so the engine is mujoco"
    assert describe_default_engine("bullet") == ()


@pytest.mark.usefixtures("engine")
def test_a_divergence_is_an_error_and_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with simulation("humanoid") as run, pytest.raises(SimulationError, match="diverged at tick"):
        for _ in range(50):
            run.advance(np.full(run.layout.size, 1e7))

    assert list(tmp_path.iterdir()) == []


def test_another_name_is_refused_with_the_engines_there_are() -> None:
    with pytest.raises(ConfigurationError, match=r"engine.*bullet, mujoco"):
        load_parameters({"character": "pendulum", "engine": "ode"})
