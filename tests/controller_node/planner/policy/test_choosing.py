"""Which policies a controller's values say, and of which clips."""

from dataclasses import replace
from pathlib import Path

import pytest

from controller_node.behaviours.factory import behaviour_clips
from controller_node.parameters import resolve_for
from controller_node.planner.policy.choosing import choose_policies, policies_read
from controller_node.planner.policy.file import SHIPPED, read_policy, write_policy
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Values
from tests.support.physics import character
from tests.support.policies import random_policy

HUMANOID = character("humanoid")
GET_UPS = ["getup_faceup", "getup_facedown"]


def values_of(**given: object) -> Values:
    walk = {"reference": "clip", "clip": "walk", "planner": "policy"}
    return resolve_for(HUMANOID, {**walk, **given})


def write(folder: Path, *clips: str, rate: int = 240, **about: object) -> str:
    """A random policy's file that says that it was trained on some clips."""
    policy, path = random_policy(HUMANOID, rate=rate), folder / "trained.npz"
    write_policy(path, replace(policy, about={**policy.about, "clips": list(clips), **about}))
    return str(path)


def test_each_clip_that_a_behaviour_may_go_over_to_has_the_shipped_one_of_its_name() -> None:
    values = values_of(behaviour="reactive", library=["run", "kick"])
    clips = behaviour_clips(HUMANOID, values)

    found = choose_policies(HUMANOID, values, clips)

    assert found.own.about["clips"] == ["walk"]
    assert list(found.others) == ["run", "kick", *GET_UPS]
    for clip, policy in found.others.items():
        assert policy.about == read_policy(clip, HUMANOID).about
    files = policies_read(HUMANOID, values, clips)
    assert files == {
        "policy": SHIPPED / "walk.npz",
        **{f"policy {clip}": SHIPPED / f"{clip}.npz" for clip in found.others},
    }


def test_a_policy_of_several_clips_is_for_all_of_them(tmp_path: Path) -> None:
    path = write(tmp_path, "walk", "elsewhere/getup_faceup.json")
    values = values_of(policy=path)

    found = choose_policies(HUMANOID, values, GET_UPS)

    assert found.others["getup_faceup"] is found.own
    assert found.others["getup_facedown"].about["clips"] == ["getup_facedown"]
    assert policies_read(HUMANOID, values, GET_UPS) == {
        "policy": Path(path),
        "policy getup_facedown": SHIPPED / "getup_facedown.npz",
    }


def test_planner_policy_needs_one_of_each_clip_and_hybrid_plans_without() -> None:
    clips = ["nobody", "kick", "else"]

    with pytest.raises(ConfigurationError, match=r"no policy of nobody, else, .*'hybrid' plans"):
        choose_policies(HUMANOID, values_of(), clips)

    assert list(choose_policies(HUMANOID, values_of(planner="hybrid"), clips).others) == ["kick"]


def test_a_shipped_one_of_another_rate_is_none(tmp_path: Path) -> None:
    values = values_of(policy=write(tmp_path, "walk", rate=480), rate=480)

    with pytest.raises(ConfigurationError, match="no policy of getup_faceup, getup_facedown, to"):
        choose_policies(HUMANOID, values, GET_UPS)


@pytest.mark.parametrize("about", [{}, {"gait": ["run", "walk"]}])  # older files do not say
def test_a_steered_policy_takes_the_clips_that_it_was_steered_by(
    tmp_path: Path, about: dict[str, object]
) -> None:
    values = values_of(reference="steered", policy=write(tmp_path, "steered", **about))

    assert choose_policies(HUMANOID, values, []).own.about["clips"] == ["steered"]


def test_a_policy_that_was_steered_by_other_clips_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, "steered", gait=["crawl", "walk"])
    values = values_of(reference="steered", policy=path)

    with pytest.raises(
        ConfigurationError, match=r"steered by crawl, walk; 'steering.clips' are run, walk$"
    ):
        choose_policies(HUMANOID, values, [])
