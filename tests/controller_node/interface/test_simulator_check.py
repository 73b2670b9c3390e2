"""A controller that knows a terrain has to do with a simulator that has the same one."""

from pathlib import Path

import pytest

from controller_node.controller_setups import make_setup
from controller_node.interface.simulator_check import check_simulator
from controller_node.parameters import resolve_for
from msgs_config.errors import ConfigurationError
from msgs_config.messages import configuration
from msgs_config.parameters import Values
from sim_node.parameters import resolve_alone
from sim_node.physics.probe import measure_probe
from sim_node.simulation_factory import make_simulation_settings
from tests.support.physics import character

HUMANOID = character("humanoid")
PROBE = measure_probe(HUMANOID, 9.81)
ROCK = """
v 0 0 0
v {size} 0 0
v 0 {size} 0
v 0 0 1
f 1 3 2
f 1 2 4
f 2 3 4
f 3 1 4
"""
FILES = {
    "steps.yaml": "boxes: [{at: [2, 0], size: [1, 2, 0.05]}]",
    "copy.yaml": "# Of another name.\nboxes: [{at: [2, 0], size: [1, 2, 0.05]}]\n",
    "higher.yaml": "boxes: [{at: [2, 0], size: [1, 2, 0.06]}]",
    "box.urdf": """<?xml version="1.0"?>
<!-- A box. -->
<robot name="box"><link name="box">
  <visual><geometry><box size="3 3 3"/></geometry></visual>
  <collision><geometry><box size="1 1 0.1"/></geometry></collision>
</link></robot>
""",
    "bare.urdf": '<robot name="box"><link name="box"><collision><geometry><box size="1 1 0.1"/>'
    "</geometry></collision></link></robot>",
    "rock.obj": ROCK.format(size=1),
    "a/rock.obj": ROCK.format(size=1),
    "b/rock.obj": ROCK.format(size=2),
    "rock.yaml": "meshes: [{file: rock.obj, at: [3, 0]}]",
    "a/rock.yaml": "meshes: [{file: rock.obj, at: [3, 0]}]",
    "b/rock.yaml": "meshes: [{file: rock.obj, at: [3, 0]}]",
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with terrains."""
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def controller(known: str) -> Values:
    """Of a walk that knows a terrain."""
    return resolve_for(HUMANOID, {"reference": "steered", "terrain": known})


def simulator(terrain: str) -> configuration.RunConfiguration:
    """What a simulator on a terrain publishes."""
    values = resolve_alone(HUMANOID, {"terrain": terrain})
    read = make_simulation_settings(values).world.terrain
    return configuration.parse(configuration.describe(HUMANOID, values, probe=PROBE, terrain=read))


@pytest.mark.parametrize(
    ("known", "simulated"),
    [
        ("stairs", "stairs"),
        ("steps.yaml", "copy.yaml"),
        ("box.urdf", "bare.urdf"),
        ("rock.yaml", "a/rock.yaml"),
        ("felt", "steps"),
        ("steps.yaml", "none"),
    ],
)
def test_the_same_pieces_are_the_same_terrain(folder: Path, known: str, simulated: str) -> None:
    setup = make_setup(HUMANOID, controller(known))

    check_simulator(setup, HUMANOID, simulator(simulated))

    assert bool(setup.terrain) == (known != "felt")


@pytest.mark.parametrize(
    ("known", "simulated"),
    [
        ("stairs", "steps"),
        ("steps.yaml", "higher.yaml"),
        ("steps.yaml", "box.urdf"),
        ("rock.yaml", "b/rock.yaml"),
    ],
)
def test_another_terrain_is_refused_in_one_line(folder: Path, known: str, simulated: str) -> None:
    setup = make_setup(HUMANOID, controller(known))

    with pytest.raises(ConfigurationError) as caught:
        check_simulator(setup, HUMANOID, simulator(simulated))

    assert str(caught.value) == (
        f"controller_node's 'terrain' is {known}, and sim_node's, {simulated}, has other pieces; "
        "they must be the same"
    )


def test_it_is_the_file_as_it_was_read_that_counts(folder: Path) -> None:
    setup = make_setup(HUMANOID, controller("steps.yaml"))
    before = simulator("steps.yaml")
    (folder / "steps.yaml").write_text(FILES["higher.yaml"])

    check_simulator(setup, HUMANOID, before)
    with pytest.raises(ConfigurationError, match="has other pieces"):
        check_simulator(setup, HUMANOID, simulator("steps.yaml"))
