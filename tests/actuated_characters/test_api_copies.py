"""Characters and controllers can be copied and pickled at any time; worlds say that they cannot."""

import copy
import pickle
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from multiprocessing import get_context
from typing import TypeVar

import numpy as np
import pytest

import actuated_characters as ac
from actuated_characters.render.engine.renderer import Renderer
from actuated_characters.runs.plan import make_plan
from controller_node.parameters import make_controller_settings
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.file import shipped_characters
from msgs_config.errors import SimulationError
from sim_node.simulation_factory import make_simulation_settings
from tests.support.engines import Engine
from tests.support.physics import character, random_state
from tests.support.pictures import take_picture

Copied = TypeVar("Copied")


def pickled(thing: Copied) -> Copied:
    """What comes out of a pickle."""
    copied: Copied = pickle.loads(pickle.dumps(thing))
    return copied


COPY = pytest.mark.parametrize("duplicate", [copy.deepcopy, pickled])
WITHOUT_ROOT = {"root_assistance": False}
PLANNER = {"planner": "predictive", "plan.samples": 8, "plan.rounds": 1}
CONTROLLERS: dict[str, tuple[str, Mapping[str, object], int]] = {
    "hold": ("humanoid", {}, 40),
    "clip": ("humanoid", {"clip": "walk"}, 40),
    "laws": ("franka_panda", {"law": "computed_torque"}, 40),
    "gravity": ("franka_panda", {"law": "pd_gravity"}, 40),
    "pid": ("pendulum", {"gains.hinge.i": 50.0, "law": "pid", "reference": "sine"}, 40),
    "balance": ("humanoid", {"balance.enabled": True, **WITHOUT_ROOT}, 40),
    "ragdoll": ("humanoid", {"clip": "walk", "behaviour": "active_ragdoll"}, 40),
    "reactive": ("humanoid", {"clip": "walk", "behaviour": "reactive"}, 40),
    "machine": ("humanoid", {"behaviour": "state_machine", "machine": "walk"}, 40),
    "steered": ("humanoid", {"reference": "steered"}, 40),
    "planner": ("humanoid", {"clip": "walk", **PLANNER}, 14),
    "late planner": (
        "humanoid",
        {
            "clip": "walk",
            **PLANNER,
            "command_delay_ticks": 2,
            "planning_delay_ticks": 6,
        },
        16,
    ),
}


def efforts_of(
    simulation: ac.Simulation, controller: ac.Controller, ticks: int
) -> list[list[float]]:
    """The efforts that a controller answers a simulation's states with."""
    efforts = []
    for _ in range(ticks):
        efforts.append(controller.compute_effort(simulation.state, simulation.contacts))
        simulation.step(efforts[-1])
    return [effort.tolist() for effort in efforts]


@pytest.mark.slow
@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_copied_controller_goes_on_as_the_original(name: str) -> None:
    character_name, parameters, ticks = CONTROLLERS[name]
    original = ac.Controller(character(character_name), parameters)
    unused = pickled(original)
    with ac.Simulation(original.character, original.start) as simulation:
        simulation.push(original.character.links[-1].name, force=(0.0, 60.0, 0.0))
        efforts = efforts_of(simulation, original, ticks)
        copies = [copy.deepcopy(original), pickled(original), copy.deepcopy(unused)]
        states = []
        for _ in range(ticks):
            state, contacts = simulation.state, simulation.contacts
            states.append((state, contacts))
            efforts.append(original.compute_effort(state, contacts).tolist())
            simulation.step(np.array(efforts[-1]))
    for each in copies[:2]:
        answers = [each.compute_effort(*state).tolist() for state in states]
        assert answers == efforts[ticks:]
    with ac.Simulation(unused.character, unused.start) as again:
        again.push(original.character.links[-1].name, force=(0.0, 60.0, 0.0))
        assert efforts_of(again, unused, ticks) == efforts[:ticks]


@pytest.mark.slow
def test_a_copy_and_its_original_keep_out_of_each_others_way() -> None:
    original = ac.Controller(character("pendulum"), CONTROLLERS["pid"][1])
    alone = ac.Controller(character("pendulum"), CONTROLLERS["pid"][1])
    with ac.Simulation(original.character) as one, ac.Simulation(original.character) as other:
        efforts_of(one, original, 10)
        efforts_of(other, copy.deepcopy(original), 10)
        with ac.Simulation(original.character) as undisturbed:
            efforts_of(undisturbed, alone, 10)
            assert efforts_of(one, original, 10) == efforts_of(undisturbed, alone, 10)


@COPY
@pytest.mark.parametrize("name", shipped_characters())
def test_a_character_is_copied_whatever_has_been_done_with_it(
    name: str, duplicate: Callable[[ac.Character], ac.Character]
) -> None:
    original = ac.load_character(name)
    fresh = duplicate(original)
    original.layout.indices(original.layout.dof_names)
    used = duplicate(original)
    for each in (fresh, used):
        assert each == original
        assert each.layout.dof_names == original.layout.dof_names
        assert np.array_equal(
            each.layout.indices(each.layout.dof_names), np.arange(each.layout.size)
        )
        assert each.position_bounds()[0].tolist() == original.position_bounds()[0].tolist()


def hash_after(loaded: ac.Character, ticks: int) -> str:
    controller = ac.Controller(loaded)
    with ac.Simulation(loaded, controller.start) as simulation:
        efforts_of(simulation, controller, ticks)
        return simulation.state_hash


@pytest.mark.slow
def test_processes_of_a_pool_take_characters_and_controllers() -> None:
    loaded = character("franka_panda")
    here = hash_after(loaded, 20)
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        assert list(pool.map(hash_after, [loaded] * 2, [20] * 2)) == [here] * 2


@COPY
def test_settings_are_copied(duplicate: Callable[[object], object]) -> None:
    plan = make_plan("humanoid", 1.0, {"reference": "clip", "clip": "walk"}, {}, {})
    assert duplicate(plan.simulator) == plan.simulator
    settings = make_simulation_settings(plan.simulator)
    assert duplicate(settings) == settings
    own = make_controller_settings(plan.character, plan.controller)
    assert repr(duplicate(own)) == repr(own)


@COPY
def test_a_copied_model_computes_with_its_own_state(
    duplicate: Callable[[DynamicsModel], DynamicsModel],
) -> None:
    humanoid, rng = character("humanoid"), np.random.default_rng(5)
    original, fresh = DynamicsModel(humanoid), DynamicsModel(humanoid)
    original.update(*random_state(humanoid, rng))
    copied = duplicate(original)
    first, second = (random_state(humanoid, rng) for _ in range(2))
    original.update(*first)
    copied.update(*second)
    fresh.update(*second)
    assert np.array_equal(copied.mass_matrix(), fresh.mass_matrix())
    assert np.array_equal(copied.bias_force(), fresh.bias_force())
    force = rng.normal(size=humanoid.layout.size)
    solved = [each.solve(force, np.ones(len(force)), 0.004) for each in (copied, fresh)]
    assert np.array_equal(*solved)


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_world_says_that_it_cannot_be_copied(duplicate: Callable[[object], object]) -> None:
    with ac.Simulation(character("pendulum")) as simulation:
        with pytest.raises(SimulationError, match="neither copied nor pickled; its snapshot"):
            duplicate(simulation)
        simulation.step([0.0])


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, pickle.dumps])
def test_bullet_says_that_it_cannot_be_copied(duplicate: Callable[[object], object]) -> None:
    with closing(Engine()) as engine, pytest.raises(SimulationError, match="neither copied nor"):
        duplicate(engine)


@COPY
def test_a_copied_renderer_draws_the_same(duplicate: Callable[[Renderer], Renderer]) -> None:
    camera = Renderer(character("pendulum"))
    before, after = (
        take_picture(each, np.array([0.3]), size=(60, 40)) for each in (camera, duplicate(camera))
    )
    assert np.array_equal(before, after)
