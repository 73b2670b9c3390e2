"""The planner that a controller's parameters say."""

from pathlib import Path
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
    from controller_node.planner.policy.file import Policy


def check_planning(character: Character, values: Values) -> None:
    """Raise ActuatedCharactersError as `make_planner`."""
    name = PlannerParameters.of(values).planner
    if name == NO_PLANNER:
        return
    check_planner(character, name)
    if name == RECORDED:
        _recorded_plan(character, values)
        return
    if name in (POLICY, HYBRID):
        _read_policy(character, values)
    if name in (PREDICTIVE, HYBRID):
        make_planner_settings(character, values)


def make_planner(character: Character, values: Values) -> Planner | None:
    """The planner that the parameters' values say; None without one.

    Raises:
        ActuatedCharactersError: it cannot be had for the character, or beside the other values; or
            the clip's file has no plan, or a malformed one.
    """
    name = PlannerParameters.of(values).planner
    if name == NO_PLANNER:
        return None
    check_planner(character, name)
    given = PlannerParameters.of(values)
    if name == RECORDED:
        plan = _recorded_plan(character, values)
        return RecordedPlanner(plan, make_commands_in_flight(character, given))
    if name == POLICY:
        policy = _read_policy(character, values)
        from controller_node.planner.policy.planner import PolicyPlanner

        return PolicyPlanner(character, policy, given, make_commands_in_flight(character, given))
    settings = make_planner_settings(character, values)
    if name == HYBRID:
        policy = _read_policy(character, values)
        from controller_node.planner.policy.hybrid import HybridPlanner

        return HybridPlanner(character, policy, settings)
    from controller_node.planner.planner import PredictivePlanner  # compiled code, for it alone

    return PredictivePlanner(character, settings)


def describe_planner(character: Character, values: Values, gains: GainArrays) -> tuple[str, ...]:
    """Where a policy is used otherwise than it was trained, which the user should read."""
    given = PlannerParameters.of(values)
    if given.planner not in (POLICY, HYBRID):
        return ()
    policy = _read_policy(character, values)
    about = policy.about
    same = {
        "stiffness": np.allclose(policy.stiffness, gains.stiffness),
        "damping": np.allclose(policy.damping, gains.damping),
        "gravity": np.isclose(about["gravity"], given.gravity),
        "mass": np.isclose(about["mass"], character.mass, rtol=1e-3),
    }
    others = [name for name, is_same in same.items() if not is_same]
    if not others:
        return ()
    return (f"the policy was trained with other {', '.join(others)}: it may fall where it did not",)


def policy_path(values: Values) -> Path:
    """The file of the policy that the parameters' values say.

    Raises:
        ConfigurationError: there is none.
    """
    from controller_node.planner.policy.file import find_policy

    return find_policy(_policy_name(values))


def _policy_name(values: Values) -> str:
    """Without one it is the shipped one of the clip that is tracked, or of what is steered."""
    from controller_node.planner.policy.file import shipped_policies

    motion = _motion_name(values)
    return PlannerParameters.of(values).policy or (motion if motion in shipped_policies() else "")


def _motion_name(values: Values) -> str:
    reference = MotionSettings.of(values).reference
    return ClipSettings.of(values).clip if reference == "clip" else reference


def _read_policy(character: Character, values: Values) -> "Policy":
    """The policy that the parameters' values say, at this controller's rate."""
    from controller_node.planner.policy.file import STEERED, read_policy

    given, reference = PlannerParameters.of(values), MotionSettings.of(values).reference
    motion, name = _motion_name(values), _policy_name(values)
    policy = read_policy(name, character)
    if policy.rate_hz != given.rate_hz:
        raise ConfigurationError(
            f"parameter 'rate' is {given.rate_hz}; the policy '{name}' is for {policy.rate_hz}"
        )
    trained = policy.about["clips"]
    is_known = Path(motion).stem in [Path(each).stem for each in trained]
    if reference not in ("clip", STEERED) or not is_known:
        tracked = f"the clip is {motion}" if reference == "clip" else f"'reference' is {reference}"
        raise ConfigurationError(
            f"the policy '{name}' was trained on {', '.join(trained)}; {tracked}"
        )
    return policy


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
