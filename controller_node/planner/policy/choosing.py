"""Which policies the parameters' values say: of the motion, and of clips that it is left for."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from controller_node.planner.policy.file import (
    STEERED,
    Policy,
    find_policy,
    read_policy,
    shipped_policies,
)
from controller_node.planner.settings import HYBRID, PlannerParameters
from controller_node.references.clip import ClipSettings
from controller_node.references.factory import MotionSettings
from controller_node.references.steering.factory import GaitSettings, clips_of_gait
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Values


@dataclass(frozen=True)
class Policies:
    """A policy of the own motion, and others of clips that a behaviour may go over to."""

    own: Policy
    others: Mapping[str, Policy] = field(default_factory=dict)  # by clip


def choose_policies(character: Character, values: Values, clips: Sequence[str]) -> Policies:
    """The policies that the parameters' values say, at this controller's rate.

    A clip's is that of the own motion where it was trained on the clip, too, else the shipped one
    of that name. Planner `hybrid` plans for a clip that has none.

    Raises:
        ConfigurationError: there is none of the motion, or of a clip and the planner is `policy`;
            or it is malformed, another character's, of another rate, or steered by other clips.
    """
    own = _read_own(character, values)
    others = {clip: _of_clip(clip, own, character) for clip in clips}
    found = {clip: policy for clip, policy in others.items() if policy is not None}
    missing = [clip for clip in others if clip not in found]
    if missing and PlannerParameters.of(values).planner != HYBRID:
        raise ConfigurationError(
            f"there is no policy of {', '.join(missing)}, to which the behaviour may go over; "
            "planner 'hybrid' plans for clips that have none"
        )
    return Policies(own, found)


def policies_read(character: Character, values: Values, clips: Sequence[str]) -> dict[str, Path]:
    """The files of `choose_policies`, by the names that the parameters have for them.

    Raises:
        ConfigurationError: as `choose_policies` does.
    """
    policies = choose_policies(character, values, clips)
    files = {"policy": find_policy(_name(values))}
    for clip, policy in policies.others.items():
        if policy is not policies.own:
            files[f"policy {clip}"] = find_policy(clip)
    return files


def _name(values: Values) -> str:
    """Without one it is the shipped one of the clip that is tracked, or of what is steered."""
    motion = _motion(values)
    return PlannerParameters.of(values).policy or (motion if motion in shipped_policies() else "")


def _motion(values: Values) -> str:
    reference = MotionSettings.of(values).reference
    return ClipSettings.of(values).clip if reference == "clip" else reference


def _read_own(character: Character, values: Values) -> Policy:
    given, reference = PlannerParameters.of(values), MotionSettings.of(values).reference
    motion, name = _motion(values), _name(values)
    policy = read_policy(name, character)
    if policy.rate_hz != given.rate_hz:
        raise ConfigurationError(
            f"parameter 'rate' is {given.rate_hz}; the policy '{name}' is for {policy.rate_hz}"
        )
    if reference not in ("clip", STEERED) or not _knows(policy, motion):
        tracked = f"the clip is {motion}" if reference == "clip" else f"'reference' is {reference}"
        trained = ", ".join(policy.about["clips"])
        raise ConfigurationError(f"the policy '{name}' was trained on {trained}; {tracked}")
    if reference == STEERED:
        _check_gait(policy, name, clips_of_gait(character, GaitSettings.of(values)))
    return policy


def _check_gait(policy: Policy, name: str, clips: Sequence[str]) -> None:
    """Raise ConfigurationError if a policy was steered by other clips; older files do not say."""
    given = sorted(Path(clip).stem for clip in clips)
    trained = policy.about.get("gait", given)
    if given != trained:
        raise ConfigurationError(
            f"the policy '{name}' was steered by {', '.join(trained)}; 'steering.clips' are "
            f"{', '.join(given)}"
        )


def _knows(policy: Policy, motion: str) -> bool:
    return Path(motion).stem in [Path(each).stem for each in policy.about["clips"]]


def _of_clip(clip: str, own: Policy, character: Character) -> Policy | None:
    """A policy of a clip, at the rate of the own one; None if there is none."""
    if _knows(own, clip):
        return own
    if clip not in shipped_policies():
        return None
    try:
        shipped = read_policy(clip, character)
    except ConfigurationError:  # another character's clip of that name
        return None
    return shipped if shipped.rate_hz == own.rate_hz else None
