"""The planner that a controller's parameters say."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from controller_node.control_laws import GainArrays
from controller_node.planner.base import Planner
from controller_node.planner.recorded import RecordedPlanner
from controller_node.planner.settings import (
    HYBRID,
    NO_PLANNER,
    POLICY,
    PREDICTIVE,
    RECORDED,
    PlannerParameters,
    check_ground,
    check_planner,
    make_planner_settings,
)
from controller_node.references.clip import ClipSettings
from controller_node.references.factory import MotionSettings
from controller_node.references.files.reconstructed import ReconstructedClip
from controller_node.references.offsets import RecordedPlan
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Values

if TYPE_CHECKING:
    from controller_node.planner.commands_in_flight import CommandsInFlight
    from controller_node.planner.policy.choosing import Policies
    from controller_node.planner.policy.file import Policy


def check_planning(character: Character, values: Values, clips: Sequence[str]) -> None:
    """Raise ActuatedCharactersError as `make_planner`."""
    name = PlannerParameters.of(values).planner
    if name == NO_PLANNER:
        return
    check_planner(character, name)
    check_ground(character, PlannerParameters.of(values))
    if name == RECORDED:
        _recorded_plan(character, values)
        return
    if name in (POLICY, HYBRID):
        _choose_policies(character, values, clips)
    if name in (PREDICTIVE, HYBRID):
        make_planner_settings(character, values)


def make_planner(character: Character, values: Values, clips: Sequence[str]) -> Planner | None:
    """The planner that the parameters' values say; None without one.

    `clips` are those that a behaviour may go over to.

    Raises:
        ActuatedCharactersError: it cannot be had for the character, or beside the other values; or
            the clip's file has no plan, or a malformed one.
    """
    name = PlannerParameters.of(values).planner
    if name == NO_PLANNER:
        return None
    check_planner(character, name)
    given = PlannerParameters.of(values)
    check_ground(character, given)
    if name == RECORDED:
        plan = _recorded_plan(character, values)
        return RecordedPlanner(plan, make_commands_in_flight(character, given))
    if name == POLICY:
        policies = _choose_policies(character, values, clips)
        from controller_node.planner.policy.planner import PolicyPlanner

        return PolicyPlanner(character, policies, given, make_commands_in_flight(character, given))
    settings = make_planner_settings(character, values)
    if name == HYBRID:
        policies = _choose_policies(character, values, clips)
        from controller_node.planner.policy.hybrid import HybridPlanner

        return HybridPlanner(character, policies, settings)
    from controller_node.planner.planner import PredictivePlanner  # compiled code, for it alone

    return PredictivePlanner(character, settings)


def describe_planner(
    character: Character, values: Values, clips: Sequence[str], gains: GainArrays
) -> tuple[str, ...]:
    """Where a policy is used otherwise than it was trained, which the user should read."""
    given = PlannerParameters.of(values)
    if given.planner not in (POLICY, HYBRID):
        return ()
    policies = _choose_policies(character, values, clips)
    warnings = list[str]()
    for policy in (policies.own, *policies.others.values()):
        if others := _differences(policy, character, given, gains):
            warnings.append(
                f"the policy of {', '.join(policy.about['clips'])} was trained with other "
                f"{', '.join(others)}: it may fall where it did not"
            )
    return tuple(dict.fromkeys(warnings))


def _differences(
    policy: "Policy", character: Character, given: PlannerParameters, gains: GainArrays
) -> list[str]:
    """What a policy was trained with another value of, by name."""
    about = policy.about
    same = {
        "stiffness": np.allclose(policy.stiffness, gains.stiffness),
        "damping": np.allclose(policy.damping, gains.damping),
        "gravity": np.isclose(about["gravity"], given.gravity),
        "mass": np.isclose(about["mass"], character.mass, rtol=1e-3),
    }
    return [name for name, is_same in same.items() if not is_same]


def _choose_policies(character: Character, values: Values, clips: Sequence[str]) -> "Policies":
    from controller_node.planner.policy.choosing import choose_policies  # compiled code

    return choose_policies(character, values, clips)


def make_commands_in_flight(
    character: Character, given: PlannerParameters
) -> "CommandsInFlight | None":
    """The commands on their way, where they take a tick or more."""
    if not given.delay:
        return None
    from controller_node.planner.commands_in_flight import CommandsInFlight
    from controller_node.planner.contact_model import ContactModel

    return CommandsInFlight(character, ContactModel.of(character, given), given.delay)


def _recorded_plan(character: Character, values: Values) -> RecordedPlan:
    """The plan in a clip's file, at this controller's rate."""
    clip, rate = ClipSettings.of(values).clip, PlannerParameters.of(values).rate_hz
    is_clip = MotionSettings.of(values).reference == "clip"
    plan = ReconstructedClip(character, clip).plan if is_clip else None
    if plan is None:
        raise ConfigurationError(
            f"planner '{RECORDED}' plays the plan in a file of `motion reconstruct`; the clip "
            f"'{clip}' has none"
        )
    if plan.rate_hz != rate:
        raise ConfigurationError(
            f"parameter 'rate' is {rate}; the plan in {clip} is for {plan.rate_hz}"
        )
    return plan
