"""The behaviour that the parameters' values say."""

from controller_node.behaviours import reaction_factory  # noqa: F401  registers its own
from controller_node.behaviours.base import BEHAVIOURS, BehaviourChoice
from controller_node.behaviours.state_machine import factory as state_machine
from controller_node.references import factory
from controller_node.references.base import Motion
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


def make_motion(character: Character, values: Values) -> Motion:
    """The motion that the parameters' values name, commanded as far as the behaviour can go.

    Raises:
        ActuatedCharactersError: a file or a name does not exist, or does not fit the character.
    """
    return state_machine.limited(factory.make_motion(character, values), values)


def choose_behaviour(character: Character, values: Values) -> BehaviourChoice:
    """The behaviour of the parameter of that name; libraries of motion are read here, once.

    Raises:
        ConfigurationError: a value is wrong, or the character cannot do it.
        ClipError: a clip of the library is malformed.
    """
    return BEHAVIOURS[values.text("behaviour")](character, values)
