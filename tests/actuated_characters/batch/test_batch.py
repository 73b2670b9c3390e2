"""Each world of a batch has the states of a simulation with its controller, to the bit."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import actuated_characters as ac
from actuated_characters.batch.worlds import Batch
from actuated_characters.environments.track import TrackEnv
from msgs_config.arrays import FloatArray
from msgs_config.errors import ClosedError, SimulationError
from sim_node.physics.mujoco.batch import MujocoBatch
from tests.support.hands import hand_on_a_body

WALK: dict[str, Any] = {"clip": "walk"}
CASES: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "walk": ("humanoid", WALK, {}),
    "without assistance": ("humanoid", {**WALK, "root_assistance": False}, {}),
    "late, substeps": ("humanoid", WALK, {"command_delay_ticks": 2, "substeps": 2}),
    "at 480 Hz on ice": ("humanoid", WALK, {"rate": 480, "friction": 0.02}),
    "no velocity": ("humanoid", {**WALK, "reference_velocity": "zero"}, {}),
    "in the air": ("humanoid", WALK, {"terrain": "none", "gravity": 1.6}),
    "laikago": ("laikago", {}, {}),
    "panda": ("franka_panda", {"reference": "sine"}, {}),
    "kuka": ("kuka", {}, {"gravity": 3.71}),
    "pendulum": ("pendulum", {}, {}),
}
SHARED = ("rate", "gravity", "command_delay_ticks")


def pair(
    name: str, controller: dict[str, Any], simulator: dict[str, Any]
) -> tuple[ac.Controller, ac.Simulation]:
    character = ac.load_character(name)
    both = {key: value for key, value in simulator.items() if key in SHARED}
    law = ac.Controller(character, {**controller, **both})
    given = {"engine": "mujoco", **simulator}
    if not controller.get("root_assistance", True):
        given["commanded_joints"] = character.layout.actuated_joint_names
    return law, ac.Simulation(character, law.start, given)


def go_on(law: ac.Controller, simulation: ac.Simulation, ticks: int) -> None:
    for _ in range(ticks):
        simulation.step(law.compute_effort(simulation.state))


@pytest.mark.parametrize("case", CASES)
def test_a_world_is_a_simulation_with_its_controller(case: str) -> None:
    name, controller, simulator = CASES[case]
    law, simulation = pair(name, controller, simulator)
    link = law.character.links[-1].name
    force, torque = (150.0, 40.0, -60.0), (1.0, 2.0, 3.0)
    batch = Batch(
        law.character,
        3,
        threads=2,
        watch_contacts=True,
        hash_states=True,
        simulator=simulator,
        **controller,
    )

    for ticks in (1, 99, 300):
        go_on(law, simulation, ticks)
        batch.step(ticks=ticks)
        np.testing.assert_array_equal(batch.position[0], simulation.state.position)
        np.testing.assert_array_equal(batch.velocity[0], simulation.state.velocity)
        np.testing.assert_array_equal(batch.contacts[0], simulation.contacts)
        simulation.push(link, force, torque)
        for world in (0, 2):
            batch.push(world, link, force, torque)
    simulation.reset()
    batch.reset()
    go_on(law, simulation, 100)
    batch.step(ticks=100)

    first, unpushed, third = batch.state_hashes
    assert first == third == simulation.state_hash
    assert first != unpushed
    assert batch.ticks.tolist() == [100] * 3


def test_speeds_are_bounded_where_a_simulation_bounds_them(tmp_path: Path) -> None:
    file = tmp_path / "hand.urdf"
    file.write_text(hand_on_a_body())
    character = ac.load_character(file)
    batch = Batch(character, 1, action="torques", hash_states=True, reference="hold")
    begin = np.array([batch.start.position]), np.array([batch.start.velocity])
    begin[1][0, 6:] = 300.0
    first = ac.StampedState(0, begin[0][0], begin[1][0], None)
    simulation = ac.Simulation(character, first, engine="mujoco")
    batch.reset(position=begin[0], velocity=begin[1])
    simulation.reset()

    for _ in range(30):
        simulation.step(np.zeros(character.layout.size))
    batch.step(ticks=30)

    assert batch.state_hashes[0] == simulation.state_hash
    batch.reset(position=begin[0], velocity=begin[1])
    batch.step()
    assert np.abs(batch.velocity).max() == 100.0


def test_the_ground_may_be_a_terrain(tmp_path: Path) -> None:
    file = tmp_path / "blocks.urdf"
    file.write_text(
        '<robot name="blocks"><link name="blocks"><collision><origin xyz="0 0 -0.5"/>'
        '<geometry><box size="40 40 1"/></geometry></collision><collision>'
        '<origin xyz="1.5 0 0"/><geometry><box size="1 2 0.1"/></geometry></collision></link>'
        "</robot>"
    )
    given = {"terrain": str(file), "engine": "mujoco"}
    law, simulation = pair("humanoid", WALK, given)
    batch = Batch(law.character, 1, hash_states=True, simulator=given, **WALK)

    go_on(law, simulation, 240)
    batch.step(ticks=240)

    assert batch.state_hashes[0] == simulation.state_hash
    assert batch.state_hashes[0] != hash_on_a_plane(240)


def hash_on_a_plane(ticks: int) -> str:
    law, simulation = pair("humanoid", WALK, {})
    go_on(law, simulation, ticks)
    return simulation.state_hash


@pytest.mark.parametrize("threads", [2, 3])
def test_neither_threads_nor_other_worlds_count(threads: int) -> None:
    character, count = ac.load_character("humanoid"), 7

    def made(worlds: list[int], threads: int) -> tuple[str, ...]:
        with Batch(character, len(worlds), threads=threads, hash_states=True, **WALK) as batch:
            actions = np.random.default_rng(3).normal(0.0, 0.1, (count, batch.action_size))[worlds]
            ticks = np.arange(count)[worlds] * 10
            batch.reset(at=ticks)
            for _ in range(20):
                batch.step(actions, ticks=4)
            return batch.state_hashes

    together = made(list(range(count)), threads)

    assert together == made(list(range(count)), 1)
    assert together == tuple(made([world], 1)[0] for world in range(count))
    assert len(set(together)) == count


@pytest.mark.parametrize("action", ["targets", "angles", "torques"])
def test_actions_are_those_of_the_environment(action: str) -> None:
    environment = TrackEnv(action=action, simulator={"engine": "mujoco"}, **WALK)
    environment.reset()
    size = environment.action_space.shape
    assert size is not None
    batch = Batch(ac.load_character("humanoid"), 2, action=action, root_assistance=False, **WALK)
    rng = np.random.default_rng(8)

    for _ in range(30):
        actions = rng.uniform(-0.3, 0.3, (2, *size)) * (50.0 if action == "torques" else 1.0)
        environment.step(actions[1])
        batch.step(actions, ticks=8)

        state = environment.simulation.state
        np.testing.assert_array_equal(batch.position[1], state.position)
        np.testing.assert_array_equal(batch.velocity[1], state.velocity)


def test_one_world_begins_again_where_it_is_told_and_the_others_go_on() -> None:
    character = ac.load_character("humanoid")
    law, simulation = pair("humanoid", WALK, {})
    batch = Batch(character, 3, threads=1, **WALK)
    batch.step(ticks=20)
    begin = ac.StampedState(0, law.start.position + 0.01, law.start.velocity - 0.02, None)

    batch.reset([1], position=begin.position[np.newaxis], velocity=begin.velocity[np.newaxis])
    batch.reset(np.array([False, False, True]), at=30)
    simulation.reset(begin)
    go_on(law, simulation, 40)
    batch.step(ticks=40)

    np.testing.assert_array_equal(batch.position[1], simulation.state.position)
    assert batch.ticks.tolist() == [60, 40, 40]
    assert batch.reference_ticks.tolist() == [60, 40, 70]
    undisturbed = Batch(character, 1, threads=1, **WALK)
    undisturbed.step(ticks=60)
    np.testing.assert_array_equal(batch.position[0], undisturbed.position[0])
    np.testing.assert_allclose(  # near the reference, from where it was told to begin
        batch.position[2, :3], batch.desired()[2, 0, :3], atol=0.1
    )


def test_a_world_that_diverges_stays_and_the_others_go_on() -> None:
    law, simulation = pair("humanoid", WALK, {})
    batch = Batch(law.character, 2, threads=1, hash_states=True, **WALK)
    wild: FloatArray = law.start.velocity.copy()
    wild[6:9] = 450.0
    begin = ac.StampedState(0, law.start.position, wild, None)
    batch.reset([0], position=begin.position[np.newaxis], velocity=wild[np.newaxis])
    simulation.reset(begin)

    batch.step(ticks=30)
    with pytest.raises(SimulationError, match="diverged"):
        go_on(law, simulation, 30)

    assert batch.diverged.tolist() == [True, False]
    assert batch.state_hashes[0] == simulation.state_hash
    assert np.isfinite(batch.position).all()
    before = batch.position[0].copy()
    batch.step(ticks=10)
    np.testing.assert_array_equal(batch.position[0], before)
    assert batch.ticks[1] == 40
    batch.reset(batch.diverged)
    batch.step()
    assert not batch.diverged.any()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"count": 0}, "count is 0; it must be a whole number from 1"),
        ({"count": 2.5}, "count is 2.5"),
        ({"threads": -1}, "threads is -1"),
        ({"action": "muscles"}, "unknown action 'muscles'; there are: targets, angles, torques"),
        ({"simulator": {"engine": "bullet"}}, "'engine' is bullet, which simulates no batch"),
        ({"simulator": {"characters": ["a", "b"]}}, "unknown parameter 'characters'"),
        ({"simulator": {"rate": 100}, "rate": 240}, "must be the same"),
        ({"simulator": {"initial_velocity": [0.0]}}, "'initial_velocity': worlds begin where"),
        ({"simulator": {"mass_factors": ["chest:2"]}}, "'mass_factors': a batch has none"),
        ({"planner": "predictive"}, "'planner' is predictive; in a batch it must be none"),
        ({"behaviour": "ragdoll"}, "'behaviour' is ragdoll; in a batch it must be tracking"),
        ({"law": "pid"}, "'law' is pid; in a batch it must be stable_pd"),
        ({"controller": {"balance.enabled": True}}, "'balance.enabled' is True"),
    ],
)
def test_what_a_batch_cannot_is_refused_in_one_line(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ac.ActuatedCharactersError, match=r"^[^\n]*$") as refused:
        Batch(ac.load_character("humanoid"), **{"count": 1, **given})

    assert message in str(refused.value)


def test_a_world_whose_contacts_have_no_room_fails_alone() -> None:
    batch = Batch(ac.load_character("humanoid"), 2, threads=1, **WALK)
    engine = batch._batch
    assert isinstance(engine, MujocoBatch)
    (worker,) = engine._workers
    engine._held[1].warning[mujoco.mjtWarning.mjWARN_CONTACTFULL].number = 1  # type: ignore[attr-defined]

    batch.step()

    assert batch.diverged.tolist() == [True, False]
    assert batch.ticks.tolist() == [0, 1]
    batch.reset([0])
    batch.step()
    assert not batch.diverged.any()
    assert worker.step.applied.tolist() == [0.0] * 34


def test_what_is_shown_cannot_be_written() -> None:
    batch = Batch(ac.load_character("pendulum"), 1, watch_contacts=True)

    for shown in (batch.position, batch.velocity, batch.motion, batch.contacts):
        with pytest.raises(ValueError, match="read-only"):
            shown[0] = 1.0


def test_joints_with_damping_are_refused() -> None:
    character = ac.load_character("tests/data/damped.yaml")

    with pytest.raises(ac.ActuatedCharactersError, match="damping, friction or mimics"):
        Batch(character, 1)


def test_what_does_not_fit_is_refused_and_changes_nothing() -> None:
    batch = Batch(ac.load_character("humanoid"), 2, **WALK)
    batch.step()
    before = batch.position.copy(), batch.ticks.tolist()
    wrong: list[tuple[str, Any]] = [
        ("actions has shape", lambda: batch.step(np.zeros(3))),
        ("actions has entries that are not finite", lambda: batch.step(np.full((2, 28), np.nan))),
        ("ticks is 0", lambda: batch.step(ticks=0)),
        ("worlds are", lambda: batch.reset([2])),
        ("worlds are", lambda: batch.reset([0, 0])),
        ("at is -1", lambda: batch.reset([0], at=-1)),
        ("position has shape", lambda: batch.reset([0], position=np.zeros((2, 34)))),
        ("unknown link", lambda: batch.push(0, "tail")),
        ("force on 'neck'", lambda: batch.push(0, "neck", (1.0, 2.0))),
        ("watch_contacts=True", lambda: batch.contacts),
        ("hash_states=True", lambda: batch.state_hashes),
    ]

    for message, act in wrong:
        with pytest.raises(ac.ActuatedCharactersError, match=r"^[^\n]*$") as refused:
            act()
        assert message in str(refused.value)

    np.testing.assert_array_equal(batch.position, before[0])
    assert batch.ticks.tolist() == before[1]
    batch.close()
    batch.close()
    with pytest.raises(ClosedError):
        batch.step()


def test_the_lines_of_the_page_work() -> None:
    page = (Path(__file__).parents[3] / "docs" / "python.md").read_text("utf-8")
    (code,) = [part for part in page.split("```") if "ac.Batch(" in part and "import" in part]
    names: dict[str, Any] = {}

    exec(code.removeprefix("python"), names)

    assert names["batch"].ticks.max() == 240


def test_worlds_far_apart_on_the_reference_are_refused() -> None:
    with Batch(ac.load_character("humanoid"), 2, threads=1, clip="walk") as worlds:
        worlds.reset([0], at=10**8)

        with pytest.raises(ac.ActuatedCharactersError, match="ticks of the reference apart"):
            worlds.step()

        worlds.reset([0])
        worlds.step()
