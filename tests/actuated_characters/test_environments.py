"""The Gymnasium environment: its library's own checker, our states, and when an episode ends."""

import math
import warnings
from functools import lru_cache
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import actuated_characters as ac
from actuated_characters.environments import TRACK
from actuated_characters.environments.track import TrackEnv
from actuated_characters.metrics.state_hash import StateHash
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from controller_node.references.base import Reference
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations
from msgs_config.messages.clock import TickClock

UNBOUNDED = "A Box observation space m.* value is -?infinity"
"""What the checker remarks on heights and velocities, which have no bounds."""
TORQUES = {"action": "torques"}
CLOCK = TickClock(240)
UNAIDED: dict[str, object] = {"root_assistance": False}


def make(**options: object) -> TrackEnv:
    environment = gymnasium.make(TRACK, **options).unwrapped
    assert isinstance(environment, TrackEnv)
    return environment


@lru_cache
def walk() -> Reference:
    return ac.Controller(ac.load_character("humanoid"), clip="walk").reference


def reference_angles(environment: TrackEnv, ticks: int) -> FloatArray:
    """The reference's joint positions, so many ticks after the present state."""
    time = CLOCK.time_after(environment.simulation.ticks + ticks)
    return walk().sample(time).configuration.position[6:]


def hash_of_run(ticks: int, **controller: object) -> str:
    """The hash of a run of the walk without assistance, in one process."""
    reference: dict[str, object] = {"reference": "clip", "clip": "walk"}
    plan = make_plan("humanoid", ticks / 240, reference, {}, {**UNAIDED, **controller})
    states = StateHash()
    for number, tick in enumerate(ticks_in_process(plan)):
        if not number:
            states.add(tick.state)
        states.add(tick.following)
    return states.hexdigest()


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        {"clip": "walk"},
        {"clip": "run", "random_start": True, "render_mode": "rgb_array", "render_size": (64, 48)},
        {"character": "lift"},
        {"character": "franka_panda", "ticks_per_step": 1, "render_size": (64, 48)},
    ],
    ids=["humanoid", "drawn", "lift", "arm"],
)
def test_gymnasiums_own_checker_has_nothing_to_say(options: dict[str, object]) -> None:
    environment = make(**options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*" + UNBOUNDED)
        check_env(environment)
    observation, _ = environment.reset(seed=2)
    assert environment.observation_space.contains(observation)
    environment.close()


@pytest.mark.parametrize("action", ["angles", "torques"])
def test_other_actions_pass_the_checker_but_are_in_their_own_units(action: str) -> None:
    environment = make(clip="walk", action=action)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for remark in (UNBOUNDED, "For Box action spaces, we recommend"):
            warnings.filterwarnings("ignore", message=".*" + remark)
        check_env(environment)
    environment.close()


# Actions


@pytest.mark.parametrize("ticks_per_step", [1, 8])
def test_without_offsets_the_states_are_those_of_a_run_without_assistance(
    ticks_per_step: int,
) -> None:
    environment = make(clip="walk", ticks_per_step=ticks_per_step)
    environment.reset(seed=0)
    for _ in range(160 // ticks_per_step):
        environment.step(np.zeros(28))

    assert environment.simulation.state_hash == hash_of_run(160)
    environment.close()


def test_gains_and_the_velocity_to_track_are_the_controllers() -> None:
    given = {"gains.right_knee.p": 300.0, "reference_velocity": "zero", "strength.chest": 0.5}
    environment = make(clip="walk", controller=given)
    environment.reset(seed=0)
    for _ in range(10):
        environment.step(np.zeros(28))

    assert environment.simulation.state_hash == hash_of_run(80, **given)
    environment.close()


def test_the_references_own_angles_in_each_tick_give_the_states_of_a_run() -> None:
    environment = make(clip="walk", action="angles", ticks_per_step=1)
    environment.reset(seed=0)
    for _ in range(120):
        environment.step(reference_angles(environment, 1))

    assert environment.simulation.state_hash == hash_of_run(120)
    environment.close()


def test_targets_are_tracked_as_long_as_a_run_lasts_and_torques_held_are_not() -> None:
    controller = ac.Controller(ac.load_character("humanoid"), UNAIDED, clip="walk")
    policies = {
        "run": lambda environment: np.zeros(28),
        "targets": lambda environment: np.zeros(28),
        "angles": lambda environment: reference_angles(environment, 4),
        "torques": lambda environment: controller.compute_effort(environment.simulation.state)[6:],
    }
    lasted = {}
    for name, policy in policies.items():
        ticks = 1 if name == "run" else 8
        environment = make(
            clip="walk", action="targets" if name == "run" else name, ticks_per_step=ticks
        )
        environment.reset(seed=0)
        terminated = False
        while not terminated:
            terminated = environment.step(policy(environment))[2]
        lasted[name] = environment.simulation.time
        environment.close()

    assert lasted["run"] > 0.75
    assert lasted["targets"] >= lasted["run"] - 1e-9
    assert lasted["angles"] >= lasted["run"] - 1e-9
    assert lasted["torques"] < 0.7 * lasted["run"]


@pytest.mark.parametrize("action", ["targets", "angles"])
def test_an_action_moves_the_target_of_the_law_in_each_tick(action: str) -> None:
    given: dict[str, object] = {"law": "pd", "gains.hinge.p": 20.0, "gains.hinge.d": 0.5}
    options = {"character": "pendulum", "reference": "sine", "ticks_per_step": 1}
    environment = make(**options, action=action, controller=given)
    reference = ac.Controller(ac.load_character("pendulum"), given, reference="sine").reference
    environment.reset(seed=0)
    for tick in range(50):
        before, desired = environment.simulation.state, reference.sample(CLOCK.time_after(tick))
        asked = 0.3 * math.sin(tick)
        environment.step(np.array([asked]))

        target = asked + (action == "targets") * desired.configuration.position[0]
        expected = 20.0 * (target - before.position[0])
        expected += 0.5 * (desired.velocity[0] - before.velocity[0])
        assert environment.simulation.state.effort == pytest.approx([expected], abs=1e-9)
    environment.close()


@pytest.mark.parametrize(
    ("options", "lowest", "highest"),
    [
        ({"clip": "walk"}, -1.0, 1.0),
        ({"clip": "walk", "action": "angles"}, -math.pi, math.pi),
        ({"clip": "walk", "action": "torques"}, -200.0, 200.0),
        ({"character": "lift"}, -1.0, 1.0),
        ({"character": "lift", "action": "angles"}, -1000.0, 1000.0),
    ],
)
def test_the_space_is_finite_and_in_the_unit_of_the_action(
    options: dict[str, object], lowest: float, highest: float
) -> None:
    space = make(**options).action_space
    assert isinstance(space, gymnasium.spaces.Box)
    assert (space.low.min(), space.high.max()) == (lowest, highest)


# Observation and reward


def test_an_observation_is_what_its_description_says() -> None:
    environment = make(clip="walk", ticks_per_step=5)
    environment.reset(seed=0, options={"start": 0.3})
    rng = np.random.default_rng(1)
    for _ in range(8):
        observation = environment.step(0.2 * rng.normal(size=28))[0]
    controller = ac.Controller(ac.load_character("humanoid"), clip="walk")
    state, layout = environment.simulation.state, controller.character.layout
    ahead = controller.reference.sample(0.3 + 45 / 240)

    back = rotations.conjugate(rotations.exp(state.position[3:6]))
    down, linear = (
        rotations.rotate(back, each) for each in (np.array((0, 0, -1.0)), state.velocity[:3])
    )
    error = layout.difference(layout.configuration(state.position), ahead.configuration)
    expected = np.concatenate(
        (
            *(state.position[2:3], down, linear, state.velocity[3:6]),
            *(state.position[6:], state.velocity[6:], error, ahead.velocity),
        )
    )
    np.testing.assert_allclose(observation, expected, rtol=0.0, atol=1e-12)
    environment.close()


def test_a_reward_is_the_sum_that_the_page_names() -> None:
    environment = make(character="franka_panda", reference="sine", ticks_per_step=4)
    environment.reset(seed=0)
    reward = [environment.step(0.1 * environment.action_space.high)[1] for _ in range(5)][-1]
    controller = ac.Controller(ac.load_character("franka_panda"), reference="sine")
    state, desired = environment.simulation.state, controller.reference.sample(20 / 240)

    pose = np.sum((desired.configuration.position - state.position) ** 2)
    speed = np.sum((desired.velocity - state.velocity) ** 2)
    without_place = 0.65 * np.exp(-2.0 * pose) + 0.1 * np.exp(-0.1 * speed)
    assert without_place < reward < without_place + 0.25
    assert reward < 0.99
    environment.close()


# Episodes


def test_the_efforts_of_a_controller_give_the_states_of_a_run() -> None:
    character = ac.load_character("humanoid")
    controller = ac.Controller(character, clip="walk", root_assistance=False)
    environment = make(clip="walk", ticks_per_step=1, **TORQUES)
    environment.reset(seed=0)
    with ac.Simulation(character, controller.start) as simulation:
        for _ in range(60):
            effort = controller.compute_effort(simulation.state)
            simulation.step(effort)
            environment.step(effort[6:])
        assert environment.simulation.state_hash == simulation.state_hash
    environment.close()


def test_a_motion_that_is_tracked_is_worth_more_than_one_that_is_not_and_a_fall_ends_it() -> None:
    rewards, ends = [], []
    controller = ac.Controller(ac.load_character("humanoid"), clip="walk", root_assistance=False)
    environment = make(clip="walk", ticks_per_step=1, **TORQUES)
    for policy in (lambda state: np.zeros(34), controller.compute_effort):
        environment.reset(seed=0)
        total, terminated = 0.0, False
        while not terminated and environment.simulation.time < 3.0:
            effort = policy(environment.simulation.state)
            _, reward, terminated, truncated, _ = environment.step(effort[6:])
            assert 0.0 < reward <= 1.0
            assert not truncated
            total += reward
        rewards.append(total)
        ends.append(terminated)
    assert ends == [True, True]  # without a plan it falls, as the lecture says
    assert rewards[1] > 1.5 * rewards[0]
    environment.close()


def test_an_episode_is_truncated_after_its_duration_and_may_begin_anywhere() -> None:
    environment = make(character="franka_panda", reference="sine", duration=0.1, ticks_per_step=8)
    _, info = environment.reset(options={"start": 0.4})
    assert info == {"time": 0.0, "reference_time": 0.4}
    ends = [environment.step(np.zeros(9))[3] for _ in range(3)]
    assert ends == [False, False, True]

    random = make(character="franka_panda", reference="sine", random_start=True)
    times = [random.reset(seed=seed)[1]["reference_time"] for seed in (1, 2, 1)]
    assert times[0] == times[2] != times[1]
    random.close()
    environment.close()


def test_the_page_works() -> None:
    page = (Path(__file__).parents[2] / "docs" / "python.md").read_text("utf-8")
    one, several = [part for part in page.split("```") if "import gymnasium" in part]
    names: dict[str, Any] = {"__name__": "__main__"}
    exec(one.removeprefix("python"), names)
    assert 0.0 <= names["reward"] <= 1.0
    exec(several.removeprefix("python"), names)
    assert names["rewards"].shape == (32,)


def test_what_diverges_ends_with_a_finite_observation() -> None:
    environment = make(character="pendulum", simulator={"speed_limit": 1.0}, **TORQUES)
    first, _ = environment.reset(seed=0)
    assert np.isfinite(first).all()
    terminated, info = False, {}
    while not terminated:
        observation, reward, terminated, _, info = environment.step(np.array([1000.0]))
        assert environment.observation_space.contains(observation)
    assert info["diverged"]
    assert reward == 0.0
    environment.close()


def test_a_placed_reference_is_in_its_world() -> None:
    environment = make(clip="walk", simulator={"placement": [2.0, 1.0, 0.0, 0.0]})
    position = environment.simulation.state.position
    nominal = make(clip="walk").simulation.state.position
    np.testing.assert_allclose(position[:3] - nominal[:3], (2.0, 1.0, 0.0), atol=1e-12)
    environment.close()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"duration": -1.0}, "duration is -1.0"),
        ({"ticks_per_step": 1.5}, "ticks_per_step is 1.5"),
        ({"duration": "long"}, "duration is long s"),
        ({"render_mode": "rgb_array", "render_size": 480}, "render_size is 480; .* in pixels"),
        ({"simulator": {"initial_position": [1.0]}}, "'initial_position'"),
        ({"action": "torque"}, "unknown action 'torque'; did you mean 'torques'"),
        ({"render_mode": "human"}, "unknown render_mode 'human'"),
        ({"law": "pid"}, "law 'pid' follows no target"),
        ({"behaviour": "ragdoll"}, "'behaviour' is ragdoll; .* must be tracking"),
        ({"planner": "predictive"}, "'planner' is predictive; .* must be none"),
        ({"root_assistance": True}, "'root_assistance' is True; .* must be False"),
        ({"simulator": {"rate": 480}, "rate": 240}, "'rate' is 480 for sim_node and 240"),
        ({"controller": {"gains.hinge.q": 1.0}}, "gains.hinge.q"),
    ],
)
def test_options_are_checked(options: dict[str, object], words: str) -> None:
    with pytest.raises(ac.ActuatedCharactersError, match=words):
        TrackEnv("pendulum", **options)


@pytest.mark.parametrize("side", ["simulator", "controller"])
def test_what_both_sides_must_agree_on_is_given_once(side: str) -> None:
    environment = make(character="pendulum", **{side: {"rate": 480}})
    environment.reset(seed=0)
    environment.step(np.zeros(1))
    assert environment.simulation.time == 8 / 480
    assert environment.metadata["render_fps"] == 60
    environment.close()


def test_actions_and_starts_are_checked() -> None:
    environment = make(character="pendulum")
    for wrong in (np.array([np.nan]), np.zeros(2), 5.0, ["up"], None, [[0.0]]):
        with pytest.raises(ac.ActuatedCharactersError, match="an action must have shape"):
            environment.step(wrong)  # type: ignore[arg-type]
    for wrong in (float("nan"), -1.0, "soon", None):
        with pytest.raises(ac.ActuatedCharactersError, match=f"start is {wrong}"):
            environment.reset(options={"start": wrong})
    with pytest.raises(ac.ActuatedCharactersError, match="unknown option of reset 'begin'"):
        environment.reset(options={"begin": 0.0})
    environment.close()


def test_a_mistake_is_one_clear_line() -> None:
    with pytest.raises(ac.ActuatedCharactersError, match="ticks_per_step is 0; it must be 1"):
        make(ticks_per_step=0)
    with pytest.raises(ac.ActuatedCharactersError, match="moonwalk"):
        make(clip="moonwalk")
