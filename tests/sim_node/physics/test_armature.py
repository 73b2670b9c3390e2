"""The armature of joints: what a motor's rotor adds to the inertia that its joint moves."""

from pathlib import Path

import numpy as np
import pytest

import actuated_characters as ac
from controller_node.model_check import check_agreement
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.errors import CharacterError
from sim_node.physics.probe import measure_probe
from tests.support.hands import box_link, hinge

pytestmark = pytest.mark.usefixtures("engine")

MASS, LENGTH, ARMATURE = 2.0, 0.8, 0.7  # kg, m, kg m^2
GRAVITY = 9.81


def pendulum(folder: Path, armature: float = ARMATURE) -> Character:
    """A thin rod that hangs from a hinge about y, with a rotor."""
    rod = box_link("rod", MASS, (1e-3, 1e-3, LENGTH), (0.0, 0.0, -0.5 * LENGTH))
    joint = hinge(
        "joint",
        "world",
        "rod",
        'xyz="0 0 2"',
        "0 1 0",
        f'<limit lower="-9" upper="9"/><dynamics armature="{armature}"/>',
    )
    file = folder / "pendulum.urdf"
    file.write_text(f'<robot name="pendulum"><link name="world"/>{rod}{joint}</robot>')
    return load_character(str(file))


def test_a_small_swing_takes_as_long_as_theory_says(tmp_path: Path) -> None:
    inertia = MASS * LENGTH * LENGTH / 3.0 + ARMATURE
    speed = np.sqrt(MASS * GRAVITY * 0.5 * LENGTH / inertia)  # rad/s
    start = 0.02  # rad

    with ac.Simulation(pendulum(tmp_path), initial_position=[start]) as simulation:
        for _ in range(240):
            position = simulation.step(np.zeros(1)).position

    assert position[0] == pytest.approx(start * np.cos(speed * 1.0), abs=0.02 * start)


def test_engine_and_model_agree(tmp_path: Path) -> None:
    character = pendulum(tmp_path)

    sample = measure_probe(character, GRAVITY)

    inertia = MASS * LENGTH * LENGTH / 3.0 + ARMATURE
    speed = sample.velocity[0]
    assert sample.kinetic_energy == pytest.approx(0.5 * inertia * speed * speed, rel=1e-5)
    check_agreement(DynamicsModel(character, GRAVITY), character.layout, sample)


def test_the_model_knows_it_in_the_mass_matrix_and_in_inverse_dynamics(tmp_path: Path) -> None:
    model = DynamicsModel(pendulum(tmp_path), gravity=0.0)
    model.update(np.array([0.3]), np.array([1.0]))

    inertia = MASS * LENGTH * LENGTH / 3.0 + ARMATURE

    assert model.mass_matrix()[0, 0] == pytest.approx(inertia, rel=1e-5)
    assert model.inverse_dynamics(np.array([2.0]))[0] == pytest.approx(2.0 * inertia, rel=1e-5)


def test_a_negative_one_is_refused_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(CharacterError, match="has an armature of -1; it must be 0 or more"):
        pendulum(tmp_path, armature=-1.0)
