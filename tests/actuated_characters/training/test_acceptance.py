"""What is told of a policy is what became of runs of it."""

from pathlib import Path

import pytest

from actuated_characters.training import exercises
from actuated_characters.training.acceptance import Trial, attempt, figures
from actuated_characters.training.exercises import Exercise
from sim_node.physics.engine import INSTALLED_ENGINES
from tests.support.physics import character
from tests.support.policies import write_random_policy

HUMANOID = character("humanoid")
WALK = Exercise("humanoid", "walk")


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_random_policy(tmp_path_factory.mktemp("policy") / "random.npz", HUMANOID)


@pytest.mark.parametrize("engine", INSTALLED_ENGINES)
def test_a_policy_that_is_good_for_nothing_is_lost_before_the_end(
    policy: Path, engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exercises, "_TRIED_S", 4.0)

    trial = attempt(WALK, {}, policy, engine, 1)

    assert not trial.to_the_end
    assert 0.2 < trial.lasted_s < 3.9
    assert trial.centre_error_m > 0.05
    assert trial.joint_error_rad > 0.01


def test_each_seed_is_another_jolt_and_always_the_same_one(
    policy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exercises, "_TRIED_S", 0.6)

    one, again, other = (attempt(WALK, {}, policy, "mujoco", seed) for seed in (1, 1, 2))

    assert one == again != other
    assert one.to_the_end
    assert one.lasted_s == 0.6


def test_a_run_is_set_as_the_training_was(policy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exercises, "_TRIED_S", 0.4)
    own = attempt(WALK, {}, policy, "mujoco", 1)
    softer = {"gain_scale.p": 0.5}

    assert attempt(WALK, softer, policy, "mujoco", 1) != own


def test_figures_are_medians_and_how_many_came_to_the_end() -> None:
    trials = [
        Trial(60.0, True, 0.02, 0.05),
        Trial(9.0, False, 0.3, 0.2),
        Trial(60.0, True, 0.04, 0.06),
    ]

    assert figures({"walk, mujoco": trials}) == {
        "walk, mujoco": {
            "to the end": "2 of 3",
            "centre of mass, m": 0.04,
            "joints, rad": 0.06,
        }
    }
