"""Terrain, masses and noise that a recording knows: nothing else is needed to repeat it."""

from pathlib import Path

import pytest

from actuated_characters.bags.recording import read_recording
from actuated_characters.cli import main
from tests.support.runs import summary_of

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

TERRAIN = """<?xml version="1.0"?>
<!-- A plate below both feet, and a mesh. -->
<robot name="plate"><link name="plate">
  <visual><geometry><box size="1 1 1"/></geometry></visual>
  <collision>
    <origin xyz="0 0 -0.05"/><geometry><box size="4 4 0.1"/></geometry>
  </collision>
  <collision>
    <origin xyz="3 0 0"/><geometry><mesh filename="rock.obj"/></geometry>
  </collision>
</link></robot>
"""
ROCK = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
OPTIONS = ("--clip", "walk", "--behaviour", "active_ragdoll", "--duration", "0.4")
SETTINGS = (
    'mass_factors:=["all:1.1","chest:1.2"]',
    'sensor_noise:=["angular_velocity:0.1"]',
    "terrain:={folder}/plate.urdf",
)


@pytest.fixture(scope="module")
def run(domain: int, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A walk whose terrain's file is there no more; its mesh is."""
    del domain  # the nodes inherit it
    folder = tmp_path_factory.mktemp("runs")
    (folder / "plate.urdf").write_text(TERRAIN)
    (folder / "rock.obj").write_text(ROCK)
    options = [*OPTIONS, "--in-process", "--sensor", "all", "--output", str(folder / "run")]
    for setting in SETTINGS:
        options += ["--set", f"sim_node.{setting.format(folder=folder)}"]
    assert main(["run", *options]) == 0
    (folder / "plate.urdf").unlink()
    return folder / "run"


def test_the_controller_was_told_of_the_terrain(run: Path) -> None:
    (settings,) = read_recording(run).controller

    assert settings.parameters["terrain"].endswith("plate.urdf")


@pytest.mark.parametrize("way", [(), ("--through-topics",), ("--through-topics", "simulator")])
def test_it_comes_again(
    run: Path, way: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(run), *way]) == 0

    assert "identical: " in capsys.readouterr().out


@pytest.mark.parametrize("way", [(), ("--from-start",)])
def test_a_fork_repeats_it(
    run: Path, way: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    forked = run.parent / "forked"
    options = ["--at", "0.2", *way, "--output", str(forked), "--overwrite"]

    assert main(["fork", str(run), *options]) == 0

    assert "warning" not in capsys.readouterr().out
    assert summary_of(forked)["state_hash"] == summary_of(run)["state_hash"]
