"""What follows a saved state is what followed it, to the last bit."""

import pickle
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from actuated_characters.runs.plan import RunPlan, make_plan
from controller_node.parameters import make_controller
from msgs_config.arrays import FloatArray
from msgs_config.messages.state import StampedState
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.settings import STEADY_CONTACTS
from sim_node.physics.simulation import Simulation
from sim_node.simulation_factory import make_character_setup, make_simulation_settings
from tests.support.physics import joint_simulation

pytestmark = pytest.mark.usefixtures("engine")

TICKS = 36
CASES: dict[str, tuple[str, dict[str, object], dict[str, object]]] = {
    # falls within the second, with soft limits and all kinds of contacts
    "humanoid": ("humanoid", {"reference": "clip", "clip": "walk"}, {}),
    "delayed": (
        "humanoid",
        {"reference": "clip", "clip": "roll"},
        {"rate": 480, "command_delay_ticks": 1},
    ),
    "steady": ("humanoid", {"reference": "clip", "clip": "run"}, STEADY_CONTACTS),
    "damped": ("tests/data/damped.yaml", {"reference": "hold"}, {"substeps": 2}),
    "laikago": ("laikago", {"reference": "hold"}, {}),
}


@pytest.fixture(params=CASES, scope="module")
def plan(request: pytest.FixtureRequest) -> RunPlan:
    name, reference, simulator = CASES[request.param]
    return make_plan(name, 10.0, reference, simulator, {"root_assistance": False})


@pytest.fixture
def simulation(plan: RunPlan) -> Iterator[Simulation]:
    with fresh(plan) as simulation:
        yield simulation


def fresh(plan: RunPlan) -> Simulation:
    return Simulation(
        [make_character_setup(plan.character, plan.simulator)],
        make_simulation_settings(plan.simulator),
    )


def advance(plan: RunPlan, simulation: Simulation, ticks: int, noise: float = 0.0) -> FloatArray:
    """Advance under control with some noise (N m); what the states and efforts were (ticks, 3n)."""
    controller = make_controller(plan.character, plan.reference, plan.controller)
    (simulated,), rng = simulation.characters, np.random.default_rng(3)
    episode_ns, rows = simulation.clock.stamp_ns(1), []
    for _ in range(ticks):
        effort, _ = controller.compute_effort(simulated.state, episode_ns)
        effort = effort + noise * rng.normal(size=len(effort))
        simulation.step([np.where(simulated.commanded, effort, 0.0)])
        assert simulated.state.effort is not None
        rows.append(
            np.concatenate(
                (simulated.state.position, simulated.state.velocity, simulated.state.effort)
            )
        )
    return np.array(rows)


@pytest.mark.parametrize("ticks", [0, 1, 90])
def test_a_simulation_returns_to_what_it_saved(
    plan: RunPlan, simulation: Simulation, ticks: int
) -> None:
    advance(plan, simulation, ticks)
    saved, stamp = simulation.snapshot(), simulation.stamp_ns
    counts = simulation.characters[0].saturated_ticks.copy()
    followed = advance(plan, simulation, TICKS)
    advance(plan, simulation, TICKS, noise=1.0)

    for _ in range(2):
        simulation.load_snapshot(saved)

        assert simulation.stamp_ns == stamp == simulation.characters[0].state.stamp_ns
        np.testing.assert_array_equal(simulation.characters[0].saturated_ticks, counts)
        assert advance(plan, simulation, TICKS).tobytes() == followed.tobytes()


@pytest.mark.parametrize("dirty", [False, True])
def test_another_simulation_goes_on_from_a_snapshot(
    plan: RunPlan, simulation: Simulation, dirty: bool
) -> None:
    advance(plan, simulation, 90)
    snapshot = pickle.loads(pickle.dumps(simulation.snapshot()))
    followed = advance(plan, simulation, TICKS)

    with fresh(plan) as other:
        advance(plan, other, 20 if dirty else 0, noise=1.0)
        other.load_snapshot(snapshot)

        assert other.tick == 91
        assert advance(plan, other, TICKS).tobytes() == followed.tobytes()


def test_efforts_on_the_root_act_where_the_saved_state_has_it() -> None:
    walk: dict[str, object] = {"reference": "clip", "clip": "walk"}
    plan = make_plan("humanoid", 10.0, walk, {}, {"root_assistance": True})
    with fresh(plan) as simulation:
        advance(plan, simulation, TICKS)
        saved = simulation.snapshot()
        followed = advance(plan, simulation, TICKS)
        advance(plan, simulation, TICKS, noise=1.0)

        simulation.load_snapshot(saved)

        np.testing.assert_array_equal(advance(plan, simulation, TICKS), followed)


def test_a_snapshot_has_what_a_reset_has_changed(plan: RunPlan, simulation: Simulation) -> None:
    advance(plan, simulation, 20)
    moon = replace(simulation.settings.world, gravity=1.62)
    moved = simulation.characters[0].state.position.copy()
    moved[-1] += 0.05
    start = StampedState(0, moved, np.zeros(len(moved)), None)
    simulation.reset(moon, {simulation.characters[0].setup.name: start})
    advance(plan, simulation, 20)
    saved = simulation.snapshot()
    followed = advance(plan, simulation, TICKS)
    simulation.reset()
    again = advance(plan, simulation, TICKS)

    with fresh(plan) as other:
        other.load_snapshot(saved)

        assert advance(plan, other, TICKS).tobytes() == followed.tobytes()
        other.reset()
        assert advance(plan, other, TICKS).tobytes() == again.tobytes()


CROWD = {
    "characters": ["first", "second", "third"],
    "character": "humanoid",
    "first.placement": [0.0, -5.0, 0.0, 0.3],
    "third.placement": [0.0, 5.0, 0.0, 0.0],
}


def test_where_a_character_goes_does_not_depend_on_who_else_is_in_the_world() -> None:
    # all fall limply, and lie on the ground in the end; one is hit by a ball
    ball = ProjectileThrow(3.0, 0.15, (2.0, 5.0, 1.0), (-8.0, 0.0, 0.0))
    with joint_simulation({"character": "humanoid"}) as alone, joint_simulation(CROWD) as crowd:
        (one,), (_, same, _) = alone.characters, crowd.characters
        nothing = np.zeros(one.layout.size)
        for tick in range(240):
            alone.step([nothing])
            crowd.step(3 * [nothing], throws=[ball] if tick == 30 else ())

            assert one.state.position.tobytes() == same.state.position.tobytes(), tick
            assert one.state.velocity.tobytes() == same.state.velocity.tobytes(), tick
