"""Where a policy is used otherwise than it was trained, the user is told; else not."""

import pytest

from actuated_characters.runs.plan import make_plan
from controller_node.planner.policy.file import STEERED, shipped_policies

SAYS = "the policy of walk was trained with other {}: it may fall where it did not"


def warnings(clip: str, planner: str = "policy", **controller: object) -> tuple[str, ...]:
    motion = {"reference": STEERED} if clip == STEERED else {"reference": "clip", "clip": clip}
    return make_plan("humanoid", 1.0, motion, {}, {"planner": planner, **controller}).warnings


@pytest.mark.parametrize("planner", ["policy", "hybrid"])
@pytest.mark.parametrize("name", shipped_policies())
def test_a_shipped_policy_is_used_as_it_was_trained(name: str, planner: str) -> None:
    told = warnings(name, planner)  # of some clips, that they are kept within joint limits

    assert not [each for each in told if "policy" in each]


@pytest.mark.parametrize(
    ("given", "others"),
    [
        ({"gain_scale.p": 0.9}, "stiffness"),
        ({"gain_scale.d": 0.9}, "damping"),
        ({"gravity": 1.62}, "gravity"),
        ({"gain_scale.p": 0.9, "gravity": 1.62}, "stiffness, gravity"),
    ],
)
def test_what_is_another_is_named(given: dict[str, object], others: str) -> None:
    assert warnings("walk", **given) == (SAYS.format(others),)


def test_of_plans_nothing_is_said() -> None:
    assert warnings("walk", "predictive", gravity=1.62) == ()
