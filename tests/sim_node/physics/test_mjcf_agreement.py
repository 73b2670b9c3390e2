"""Both engines make the same mechanics of a character from an MJCF as the controller's model."""

from pathlib import Path

import numpy as np
import pytest

import actuated_characters as ac
from controller_node.model_check import check_agreement
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from sim_node.physics.probe import measure_probe
from tests.support.mjcf import FILES, GRAVITY, write_mjcf

pytestmark = pytest.mark.usefixtures("engine")


@pytest.mark.parametrize("bodies", FILES.values(), ids=FILES)
def test_the_engines_agree_with_the_model(tmp_path: Path, bodies: str) -> None:
    character = load_character(write_mjcf(tmp_path, bodies))

    sample = measure_probe(character, GRAVITY)

    check_agreement(DynamicsModel(character, GRAVITY), character.layout, sample)


def test_a_controller_holds_the_rest_pose_of_an_arm(tmp_path: Path) -> None:
    character = load_character(write_mjcf(tmp_path, FILES["several joints on one body"]))
    controller = ac.Controller(character)

    with ac.Simulation(character, controller.start) as simulation:
        for _ in range(480):
            state = simulation.step(controller.compute_effort(simulation.state))

    assert np.abs(state.position - controller.start.position).max() < 0.05
