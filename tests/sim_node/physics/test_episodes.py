"""A reset is a fresh simulation, to the bit, whatever was before; only time goes on."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.errors import SimulationError
from msgs_config.messages.state import StampedState
from sim_node.physics.mujoco.body import MujocoBody
from sim_node.physics.simulation import Simulation
from sim_node.physics.wrenches import ExternalWrench
from tests.support.engines import pybullet
from tests.support.physics import LoneSimulation, character, joint_simulation, simulation

pytestmark = pytest.mark.usefixtures("engine")

HUMANOID = character("humanoid").layout
LINKS = [link.name for link in character("humanoid").links]
NOTHING = np.zeros(HUMANOID.size)


def humanoid_efforts(ticks: int, size: float, seed: int = 1) -> list[FloatArray]:
    """Random efforts in every joint, none on the root."""
    rng = np.random.default_rng(seed)
    motors = np.concatenate((np.zeros(6), np.ones(HUMANOID.size - 6)))
    return [size * motors * rng.normal(size=HUMANOID.size) for _ in range(ticks)]


def a_push(link: str, *force: float) -> ExternalWrench:
    """A push at a link's origin."""
    return ExternalWrench(LINKS.index(link), np.array([*force, 0.0, 0.0, 0.0]), np.zeros(3), 1, 1)


SETTINGS = [
    {},
    {"substeps": 3},
    {"command_delay_ticks": 2},
    {"substeps": 2, "command_delay_ticks": 3, "rate": 120, "commanded_joints": ["root", "neck"]},
]
any_settings = pytest.mark.parametrize(
    "given", SETTINGS, ids=["plain", "substeps", "delay", "substeps and delay"]
)


def a_dirty_episode(run: LoneSimulation) -> None:
    """Random efforts, a push, contacts, and a fall."""
    run.watches_contacts = True
    touched = np.zeros(len(LINKS), dtype=np.bool_)
    for tick, effort in enumerate(humanoid_efforts(150, size=5.0, seed=9)):
        pushes = [a_push("chest", 300.0, 200.0, -300.0)] if tick < 30 else []
        run.advance(effort, *pushes)
        run.simulated.link_frames()
        assert run.simulated.contacts is not None
        touched |= run.simulated.contacts.touching
    assert touched.sum() > 2
    run.watches_contacts = False


@pytest.mark.slow
@any_settings
def test_a_reset_is_a_fresh_simulation_to_the_bit(given: dict[str, object]) -> None:
    efforts = humanoid_efforts(120, size=3.0)
    push = a_push("chest", 100.0, 50.0, 0.0)
    with simulation("humanoid", **given) as fresh, simulation("humanoid", **given) as used:
        a_dirty_episode(used)

        used.reset()

        assert used.state.effort is None
        for tick, effort in enumerate(efforts):
            pushes = [push] if 20 <= tick < 30 else []
            assert used.state.position.tobytes() == fresh.state.position.tobytes()
            assert used.state.velocity.tobytes() == fresh.state.velocity.tobytes()
            state, expected = used.advance(effort, *pushes), fresh.advance(effort, *pushes)
            assert state.effort is not None and expected.effort is not None
            assert state.effort.tobytes() == expected.effort.tobytes()


def test_a_reset_takes_one_tick_and_counts_an_episode() -> None:
    with simulation("lift", rate=7) as run:
        assert run.episode == 1
        for _ in range(3):
            run.advance(np.zeros(1))

        run.reset()

        # time goes on
        assert run.episode == 2
        assert run.tick == 5
        assert run.stamp_ns == run.state.stamp_ns == 5 * 10**9 // 7
        assert run.advance(np.zeros(1)).stamp_ns == 6 * 10**9 // 7


def test_a_reset_forgets_contacts_pushes_and_commands_on_their_way() -> None:
    with simulation("humanoid", command_delay_ticks=2) as run:
        run.watches_contacts = True
        for effort in humanoid_efforts(60, size=2.0):
            run.advance(effort, a_push("chest", 10.0, 0.0, 0.0))
        assert run.simulated.contacts is not None and run.simulated.contacts.touching.any()

        run.reset()

        assert run.simulated.pushes == ()
        assert run.simulated.contacts is not None
        assert not run.simulated.contacts.touching.any()
        for effort in humanoid_efforts(2, size=2.0):
            applied = run.advance(effort).effort
            np.testing.assert_array_equal(applied, np.zeros(HUMANOID.size))


def test_a_reset_helps_after_a_divergence() -> None:
    with simulation("humanoid") as fresh, simulation("humanoid") as run:
        with pytest.raises(SimulationError, match="diverged"):
            run.advance(np.full(HUMANOID.size, np.nan))

        run.reset()

        for _ in range(60):
            assert run.advance(NOTHING).position.tobytes() == (
                fresh.advance(NOTHING).position.tobytes()
            )


def touch_each_other(run: Simulation) -> bool:
    """Whether the two bodies of a simulation are in contact with each other."""
    one, other = (cast(Any, simulated._body) for simulated in run.characters)
    if isinstance(one, MujocoBody):
        shapes = one._world.data.contact.geom
        bodies = one._world.model.geom_bodyid[shapes]
        owners = (bodies >= other.place.links.start) * (bodies > 0)
        return bool(((bodies > 0).all(axis=1) & (owners[:, 0] != owners[:, 1])).any())
    return bool(pybullet.getContactPoints(one._body, other._body, physicsClientId=one._client))


@pytest.mark.slow
@pytest.mark.parametrize("given", [{}, {"substeps": 2, "command_delay_ticks": 1}], ids=str)
def test_a_reset_of_two_humanoids_in_contact_is_a_fresh_simulation_to_the_bit(
    given: dict[str, object],
) -> None:
    # one stands so near that it falls onto the other
    place = {"other.placement": [0.25, 0.1, 0.0, 2.0]}
    given = {**given, **place, "characters": ["one", "other"]}
    efforts = [humanoid_efforts(150, size=2.0, seed=seed) for seed in (1, 2)]
    dirty = [humanoid_efforts(150, size=3.0, seed=seed) for seed in (3, 4)]
    with joint_simulation(given) as fresh, joint_simulation(given) as used:
        used.watches_contacts = True
        for both in zip(*dirty, strict=True):
            used.step(both, [[a_push("neck", 100.0, 0.0, 0.0)], [a_push("chest", 0.0, 50.0, 9.0)]])
        used.watches_contacts = False

        used.reset()

        assert [simulated.state.stamp_ns for simulated in used.characters] == [used.stamp_ns] * 2
        touched = False
        for both in zip(*efforts, strict=True):
            used.step(both)
            fresh.step(both)
            touched |= touch_each_other(used)
            for simulated, expected in zip(used.characters, fresh.characters, strict=True):
                assert simulated.state.position.tobytes() == expected.state.position.tobytes()
                assert simulated.state.velocity.tobytes() == expected.state.velocity.tobytes()
        assert touched


ON_THE_MOON = {
    "gravity": 1.62,
    "friction": 0.3,
    "link_friction": 0.9,
    "solver_iterations": 30,
    "contact_breaking_threshold": 0.1,
}


@pytest.mark.slow
@any_settings
def test_a_reset_with_other_settings_is_a_fresh_simulation_of_them_to_the_bit(
    given: dict[str, object],
) -> None:
    rng, whole = np.random.default_rng(4), character("humanoid")
    start = np.array(whole.rest_position) + rng.uniform(-0.05, 0.05, whole.layout.size)
    begins = {"initial_position": start.tolist(), "initial_velocity": [0.1] * whole.layout.size}
    efforts = humanoid_efforts(120, size=3.0)
    fresh_one = simulation("humanoid", **given, **ON_THE_MOON, **begins)
    with fresh_one as fresh, simulation("humanoid", **given) as used:
        a_dirty_episode(used)
        state = StampedState(0, start, np.full(whole.layout.size, 0.1), None)

        used.reset(replace(used.settings.world, **ON_THE_MOON), {"": state})

        assert used.settings.world == fresh.settings.world
        for effort in efforts:
            assert used.state.position.tobytes() == fresh.state.position.tobytes()
            assert used.state.velocity.tobytes() == fresh.state.velocity.tobytes()
            used.advance(effort)
            fresh.advance(effort)


def test_other_settings_stay_for_the_episodes_after() -> None:
    with simulation("lift", gravity=9.81) as run:
        run.reset(replace(run.settings.world, gravity=1.62))
        speeds = []
        for _ in range(2):
            speeds.append(run.advance(np.zeros(1)).velocity[0])
            run.reset()

        assert speeds == pytest.approx([-1.62 / 240.0] * 2)
