"""The parameters of both sides that an environment is made with."""

from collections.abc import Mapping

from actuated_characters.runs.plan import SHARED, choose_reference
from controller_node import parameters
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Values, resolve

# Parameters of the controller that would act beside an action, and the one value that does not.
_UNAIDED = {"planner": "none", "behaviour": "tracking", "root_assistance": False}


def with_shared(
    simulator: Mapping[str, object],
    controller: Mapping[str, object],
    reference: Mapping[str, object],
) -> tuple[dict[str, object], dict[str, object]]:
    """The parameters given for the simulator and for the controller, with those of both sides.

    Raises:
        ConfigurationError: one that both must agree on is given with two values.
    """
    ours = {**controller, **reference}
    both: dict[str, object] = {}
    for name in SHARED:
        values = [side[name] for side in (simulator, ours) if name in side]
        if len(values) == 2 and values[0] != values[1]:
            raise ConfigurationError(
                f"parameter '{name}' is {values[0]} for the simulator and {values[1]} for the "
                "controller; it must be the same"
            )
        if values:
            both[name] = values[0]
    return {**simulator, **both}, {**ours, **both}


def controller_values(character: Character, given: Mapping[str, object]) -> Values:
    """The controller's parameters where nothing but an action helps the law.

    Raises:
        ActuatedCharactersError: a name or a value is wrong, or one would act beside the action.
    """
    for name, alone in _UNAIDED.items():
        if given.get(name, alone) != alone:
            raise ConfigurationError(
                f"parameter '{name}' is {given[name]}; in an environment it must be {alone}, "
                "because the action takes its place"
            )
    given = {**choose_reference(given), **given, **_UNAIDED}
    own = parameters.character_parameters(character, given)
    return resolve(parameters.PARAMETERS + own, given)
