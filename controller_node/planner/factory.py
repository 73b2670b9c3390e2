"""The planner that a controller's parameters say."""

from typing import TYPE_CHECKING

from controller_node.planner.base import Planner
from controller_node.planner.recorded import RecordedPlanner
from controller_node.planner.settings import (
    NO_PLANNER,
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


def check_planning(character: Character, values: Values) -> None:
    """Raise ActuatedCharactersError as `make_planner`."""
    name = PlannerParameters.of(values).planner
    if name == NO_PLANNER:
        return
    check_planner(character, name)
    if name == RECORDED:
        _recorded_plan(character, values)
    else:
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
    if name == RECORDED:
        plan = _recorded_plan(character, values)
        return RecordedPlanner(plan, _commands_in_flight(character, values))
    settings = make_planner_settings(character, values)
    from controller_node.planner.planner import PredictivePlanner  # compiled code, for it alone

    return PredictivePlanner(character, settings)


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


def _commands_in_flight(character: Character, values: Values) -> "CommandsInFlight | None":
    """The commands on their way, where they take a tick or more."""
    given = PlannerParameters.of(values)
    if not given.delay:
        return None
    from controller_node.planner.commands_in_flight import CommandsInFlight
    from controller_node.planner.contact_model import ContactModel

    model = ContactModel.of(character, given)
    return CommandsInFlight(character, model, given.delay)
