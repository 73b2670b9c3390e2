"""A controller that knows a terrain has to do with a simulator that has the same one."""

from pathlib import Path

import pytest

from actuated_characters.runs.plan import make_plan
from controller_node.interface.simulator_check import check_simulator
from controller_node.parameters import make_controller
from msgs_config.errors import ConfigurationError
from msgs_config.messages import configuration
from sim_node.physics.probe import measure_probe
from sim_node.simulation_factory import make_simulation_settings

STEPS = "boxes: [{at: [2, 0], size: [1, 2, 0.05]}]"


def check(known: str, simulated: str) -> None:
    """What a controller does when it hears a simulator, each with its own terrain."""
    plan = make_plan(
        "humanoid",
        0.1,
        {"reference": "steered"},
        {"terrain": simulated},
        {"planner": "predictive", "terrain": known},
    )
    controller = make_controller(plan.character, plan.reference, plan.controller)
    text = configuration.describe(
        plan.character,
        plan.simulator,
        probe=measure_probe(plan.character, 9.81),
        terrain=make_simulation_settings(plan.simulator).world.terrain,
    )

    check_simulator(controller, plan.character, plan.controller, configuration.parse(text))


@pytest.mark.parametrize(
    ("known", "simulated"),
    [("stairs", "stairs"), ("plane", "plane"), ("felt", "steps"), ("copy.yaml", "steps.yaml")],
)
def test_the_same_pieces_are_the_same_terrain(
    known: str, simulated: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "steps.yaml").write_text(STEPS)
    (tmp_path / "copy.yaml").write_text(f"# Of another name.\n{STEPS}\n")

    check(known, simulated)


def test_another_terrain_is_refused_in_one_line() -> None:
    with pytest.raises(ConfigurationError) as caught:
        check("stairs", "steps")

    assert str(caught.value) == (
        "the controller's parameter 'terrain' is stairs, which is not what the simulator has, "
        "steps; they must be the same"
    )
