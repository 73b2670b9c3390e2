"""The policies that come with the package keep their clips, in worlds that training did not see."""

import pytest

from actuated_characters.training import exercises
from actuated_characters.training.acceptance import attempt
from actuated_characters.training.exercises import Exercise
from controller_node.planner.policy.file import (
    SHIPPED,
    STEERED,
    SUFFIX,
    read_policy,
    shipped_policies,
)
from controller_node.planner.settings import HYBRID
from sim_node.physics.engine import INSTALLED_ENGINES
from tests.support.physics import character

NIGHTLY = pytest.mark.nightly
MOST_BYTES = 300_000
# By itself it falls going back, aside and in running bends: it is for a planner that takes over.
WITH_A_PLANNER = {STEERED: {"planner": HYBRID, "plan.workers": 1, "plan.period": 0.1}}


@pytest.mark.parametrize(
    ("name", "engine"),
    [
        pytest.param(name, engine, marks=[] if at % len(INSTALLED_ENGINES) == turn else NIGHTLY)
        for at, name in enumerate(shipped_policies())
        for turn, engine in enumerate(INSTALLED_ENGINES)
    ],
)
def test_it_keeps_its_clip_by_joint_torques_alone(
    name: str, engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exercises, "_TRIED_S", 10.0)
    file = SHIPPED / (name + SUFFIX)
    (clip,) = read_policy(name, character("humanoid")).about["clips"]

    given, exercise = WITH_A_PLANNER.get(name, {}), Exercise("humanoid", clip)
    trials = [attempt(exercise, given, file, engine, seed) for seed in (11, 12)]

    assert all(each.to_the_end for each in trials)
    assert max(each.centre_error_m for each in trials) < 0.12
    assert max(each.joint_error_rad for each in trials) < 0.3


def test_there_is_one_and_each_is_small() -> None:
    files = [SHIPPED / (name + SUFFIX) for name in shipped_policies()]
    assert "walk" in shipped_policies()
    assert max(file.stat().st_size for file in files) < MOST_BYTES
