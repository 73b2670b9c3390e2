"""Environments as worlds of a batch: those that `make_vec` makes of Track-v0."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv, VectorEnv

import actuated_characters as ac
from actuated_characters.environments import TRACK
from actuated_characters.environments.track import TrackEnv
from actuated_characters.environments.track_vector import TrackVectorEnv
from msgs_config.errors import ConfigurationError

MUJOCO: dict[str, Any] = {"simulator": {"engine": "mujoco"}}
CASES: dict[str, dict[str, Any]] = {
    "targets": {"clip": "walk", "duration": 0.5},
    "torques": {"clip": "walk", "action": "torques"},
    "angles": {"clip": "walk", "action": "angles", "ticks_per_step": 4},
    "zero velocity": {"clip": "walk", "reference_velocity": "zero"},
    "an arm": {"character": "kuka", "reference": "sine", "duration": 0.3},
}


def all_of(environments: VectorEnv[Any, Any, Any], actions: list[Any]) -> list[Any]:
    found = [environments.reset(seed=4)[0]]
    for each in actions:
        observations, rewards, terminated, truncated, infos = environments.step(each)
        found += [observations.copy(), rewards, terminated, truncated, infos["time"]]
    environments.close()
    return found


@pytest.mark.parametrize("case", CASES)
def test_they_are_those_of_single_environments_to_the_bit(case: str) -> None:
    options, count = CASES[case], 3
    alone = SyncVectorEnv([lambda: TrackEnv(**MUJOCO, **options)] * count)
    together = gymnasium.make_vec(TRACK, num_envs=count, threads=2, **options)
    assert isinstance(together.unwrapped, TrackVectorEnv)
    assert together.single_action_space == alone.single_action_space
    assert together.single_observation_space == alone.single_observation_space
    assert together.observation_space == alone.observation_space
    together.action_space.seed(2)
    wild = [together.action_space.sample() for _ in range(40)]
    actions = [share * each for share, each in zip(np.linspace(0.0, 0.6, 40), wild, strict=True)]

    expected, found = all_of(alone, actions), all_of(together, actions)

    for one, other in zip(expected, found, strict=True):
        np.testing.assert_array_equal(one, other)
    ends = [np.any(found[row]) for row in (*range(3, len(found), 5), *range(4, len(found), 5))]
    assert any(ends) or case in ("angles", "zero velocity")


def test_random_starts_are_of_each_environments_own_seed() -> None:
    def times(count: int, seed: int) -> list[float]:
        environments = TrackVectorEnv(count, clip="walk", random_start=True)
        _, infos = environments.reset(seed=seed)
        environments.close()
        return list(infos["reference_time"])

    together = times(3, 7)

    assert together == [times(1, 7)[0], times(1, 8)[0], times(1, 9)[0]]
    environment = TrackEnv(clip="walk", random_start=True)
    _, info = environment.reset(seed=7)
    assert 0.0 <= info["reference_time"] - together[0] < 1.0 / 240.0


def test_a_divergence_ends_one_environment_alone() -> None:
    slow = {"speed_limit": 20.0}  # which the torques pass before it has fallen
    environments = TrackVectorEnv(2, clip="walk", action="torques", simulator=slow)
    before, _ = environments.reset(options={"start": 0.5})
    actions = np.zeros(environments.action_space.shape or ())
    actions[0] = 1e6
    ended = np.zeros(2, dtype=np.bool_)
    for _ in range(20):
        before, rewards, ended, _, infos = environments.step(actions)
        if ended[0]:
            break

    assert np.isfinite(before).all()
    assert ended.tolist() == [True, False]
    assert infos["diverged"].tolist() == [True, False]
    _, rewards, ended, _, infos = environments.step(0.0 * actions)
    assert rewards[0] == 0.0
    assert infos["time"][0] == 0.0
    assert not ended[0]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"simulator": {"engine": "bullet"}}, "simulates no batch"),
        ({"duration": -1.0}, "duration is -1.0"),
        ({"action": "torque"}, "unknown action 'torque'"),
        ({"root_assistance": True}, "'root_assistance' is True"),
        ({"num_envs": 0}, "count is 0"),
    ],
)
def test_options_are_checked(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ac.ActuatedCharactersError, match=words):
        TrackVectorEnv(**options)


def test_a_list_of_seeds_has_one_for_each() -> None:
    with pytest.raises(ConfigurationError, match=r"seed has 3 entries; it must be 2"):
        TrackVectorEnv(2, clip="walk").reset(seed=[1, 2, 3])


def test_an_episode_begins_at_the_tick_of_its_start() -> None:
    environments = TrackVectorEnv(1, clip="walk")
    for tick in (123, 240, 247):
        _, infos = environments.reset(options={"start": tick / 240})
        assert infos["reference_time"].tolist() == [tick / 240]


def test_actions_are_checked() -> None:
    environments = TrackVectorEnv(2, clip="walk")

    with pytest.raises(ConfigurationError, match="actions has shape"):
        environments.step(np.zeros(28))
