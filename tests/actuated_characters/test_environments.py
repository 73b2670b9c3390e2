"""The Gymnasium environment: its library's own checker, our states, and when an episode ends."""

import warnings
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import actuated_characters as ac
from actuated_characters.environments import TRACK
from actuated_characters.environments.track import TrackEnv


def make(**options: object) -> TrackEnv:
    environment = gymnasium.make(TRACK, **options).unwrapped
    assert isinstance(environment, TrackEnv)
    return environment


@pytest.mark.parametrize(
    "options",
    [{"clip": "walk"}, {"character": "lift"}, {"character": "franka_panda", "ticks_per_step": 1}],
    ids=["humanoid", "lift", "arm"],
)
def test_gymnasiums_own_checker_passes(options: dict[str, object]) -> None:
    environment = make(**options)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that efforts are in N m, not between -1 and 1
        check_env(environment)
    observation, _ = environment.reset(seed=2)
    assert environment.observation_space.contains(observation)
    environment.close()


def test_the_efforts_of_a_controller_give_the_states_of_a_run() -> None:
    character = ac.load_character("humanoid")
    controller = ac.Controller(character, clip="walk", root_assistance=False)
    environment = make(clip="walk", ticks_per_step=1)
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
    environment = make(clip="walk", ticks_per_step=1)
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
    (code,) = [part for part in page.split("```") if "import gymnasium" in part]
    names: dict[str, float] = {}
    exec(code.removeprefix("python"), names)
    assert 0.0 <= names["reward"] <= 1.0


def test_what_diverges_ends_with_a_finite_observation() -> None:
    environment = make(character="pendulum", simulator={"speed_limit": 1.0})
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
        ({"simulator": {"initial_position": [1.0]}}, "'initial_position'"),
    ],
)
def test_options_are_checked(options: dict[str, object], words: str) -> None:
    with pytest.raises(ac.ActuatedCharactersError, match=words):
        make(character="pendulum", **options)


def test_actions_and_starts_are_checked() -> None:
    environment = make(character="pendulum")
    for wrong in (np.array([np.nan]), np.zeros(2), 5.0):
        with pytest.raises(ac.ActuatedCharactersError, match="an action must have shape"):
            environment.step(wrong)  # type: ignore[arg-type]
    with pytest.raises(ac.ActuatedCharactersError, match="start is nan"):
        environment.reset(options={"start": float("nan")})
    environment.close()


def test_a_mistake_is_one_clear_line() -> None:
    with pytest.raises(ac.ActuatedCharactersError, match="ticks_per_step is 0; it must be 1"):
        make(ticks_per_step=0)
    with pytest.raises(ac.ActuatedCharactersError, match="moonwalk"):
        make(clip="moonwalk")
