"""The behaviour that the parameters' values say."""

from controller_node.behaviours import reaction_factory  # noqa: F401  registers its own
from controller_node.behaviours.base import BEHAVIOURS, BehaviourChoice
from controller_node.behaviours.state_machine import factory as state_machine  # noqa: F401  as well
from msgs_config.character.model import Character
from msgs_config.parameters import Parameter, Values

BEHAVIOUR_PARAMETERS = [
    Parameter(
        "behaviour",
        "tracking",
        "track whatever comes; be limp; track, and go limp on a hard hit; likewise, and go for an "
        "opponent; track, and react to a hit; or go through the states of a machine",
        choices=BEHAVIOURS.names,
    ),
    *BEHAVIOURS.parameters,
]


def choose_behaviour(character: Character, values: Values) -> BehaviourChoice:
    """The behaviour of the parameter of that name; libraries of motion are read here, once.

    Raises:
        ConfigurationError: a value is wrong, or the character cannot do it.
        ClipError: a clip of the library is malformed.
    """
    return BEHAVIOURS[values.text("behaviour")](character, values)
