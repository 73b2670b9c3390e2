"""Links that are heavier than their character's file says, in each engine."""

import numpy as np
import pytest

import actuated_characters as ac
from actuated_characters.runs.plan import make_plan
from controller_node.model_check import check_agreement
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.errors import ConfigurationError
from sim_node.parameters import load_parameters
from sim_node.physics.mass_factors import with_mass_factors
from sim_node.physics.probe import measure_probe
from sim_node.physics.wrenches import ExternalWrench
from tests.support.physics import (
    EVERY_CHARACTER,
    SIMPLE_BODIES,
    character,
    character_id,
    simulation,
)

pytestmark = pytest.mark.usefixtures("engine")

BOX = SIMPLE_BODIES[0]
GRAVITY = 9.81


@pytest.mark.parametrize("name", EVERY_CHARACTER, ids=character_id)
def test_engine_and_model_agree_on_each_character(name: str) -> None:
    whole = character(name)
    names = [link.name for link in whole.links if link.mass]
    factors = ["all:1.3", *(f"{each}:{0.6 + 0.2 * (row % 5)}" for row, each in enumerate(names))]
    heavy = with_mass_factors(whole, factors)

    check_agreement(DynamicsModel(heavy, GRAVITY), heavy.layout, measure_probe(heavy, GRAVITY))
    assert heavy.mass != whole.mass


@pytest.mark.parametrize(
    ("factors", "share"), [([], 1.0), (["box:2"], 0.5), (["all:2", "box:2"], 0.25)]
)
def test_a_push_and_a_twist_accelerate_by_mass_and_inertia(
    factors: list[str], share: float
) -> None:
    wrench, mass, inertia, seconds = np.zeros(6), 2.0, 0.25, 0.1  # of the box's URDF
    wrench[0], wrench[5] = 30.0, 1.0  # N, N m
    push = ExternalWrench(0, wrench, np.zeros(3), first_tick=0, ticks=24)
    run = simulation(BOX, gravity=0.0, mass_factors=factors)

    for _ in range(24):
        state = run.advance(np.zeros(6), push)

    assert state.velocity[0] == pytest.approx(share * 30.0 * seconds / mass)
    assert state.velocity[5] == pytest.approx(share * 1.0 * seconds / inertia)


@pytest.mark.parametrize(
    ("factor", "sentence"),
    [
        (
            "chest:0",
            "parameter 'mass_factors' has 'chest:0'; it must be LINK:NUMBER, the number 0.01",
        ),
        ("chest", "'mass_factors' has 'chest'; it must be LINK:NUMBER"),
        ("chest:nan", "'mass_factors' has 'chest:nan'; it must be LINK:NUMBER"),
        ("chest:1e3", "must be LINK:NUMBER, the number 0.01 to 100"),
        ("chess:2", "'mass_factors' has 'chess:2': unknown link 'chess'; did you mean 'chest'"),
    ],
)
def test_what_is_wrong_is_one_line(factor: str, sentence: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load_parameters({"mass_factors": [factor]})

    assert sentence in str(caught.value)


def test_a_link_without_mass_has_no_factor() -> None:
    with pytest.raises(ConfigurationError, match="unknown link 'pivot'; there are: all, rod"):
        with_mass_factors(character("pendulum"), ["pivot:2"])


def test_a_snapshot_is_not_of_other_masses() -> None:
    pendulum = load_character("pendulum")
    with (
        ac.Simulation(pendulum, mass_factors=["rod:2"]) as heavy,
        ac.Simulation(pendulum) as light,
        pytest.raises(ConfigurationError, match="both must be the same"),
    ):
        light.restore(heavy.snapshot())


def test_a_plan_has_them_checked() -> None:
    with pytest.raises(ConfigurationError, match="unknown link 'rdo'; did you mean 'rod'"):
        make_plan("pendulum", 0.1, {}, {"mass_factors": ["rdo:2"]}, {})
