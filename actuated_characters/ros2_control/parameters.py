"""The parameters of `ros2_control_bridge`."""

from collections.abc import Mapping
from dataclasses import replace

from controller_node.controller_settings import ControllerSettings, LawSettings
from controller_node.parameters import character_parameters, make_controller_settings, resolve_for
from msgs_config.character.model import Character
from msgs_config.messages.session import GivenSession
from msgs_config.parameters import Parameter, Values, resolve
from msgs_config.settings import Settings, parameter
from msgs_config.shared_parameters import GRAVITY, RATE, CharacterSource


class BridgeSettings(Settings):
    """When the bridge lets the world begin, and how it keeps time with a controller manager."""

    update_rate: int = parameter(
        250,
        "the controller manager's parameter of this name; it divides rate",
        unit="Hz",
        minimum=1,
        maximum=100_000,
    )
    start_time: float = parameter(
        0.0,
        "of the controller manager's clock, at which the world begins; until then its state stands "
        "still while controllers are loaded and goals sent; 0: with the first command",
        unit="s",
        maximum=1e6,
    )
    fence: bool = parameter(
        True,
        "wait until the controller manager's node for the hardware has taken each state, before "
        "the clock lets it update; without, it may update from the state before",
    )
    session: GivenSession = GivenSession()


_LAW = next(each for each in LawSettings.declared() if each.name == "law")
_LAW = replace(_LAW, choices=tuple(name for name in _LAW.choices if name != "feedforward"))

PARAMETERS = [
    *CharacterSource.declared(),
    RATE,
    GRAVITY,
    _LAW,
    *BridgeSettings.declared(),
]
"""Those of every character; to each there are `character_parameters`."""


def declared(character: Character) -> list[Parameter]:
    """The parameters of a bridge of a character: with gains and limits of its joints."""
    of_joints = [
        each for each in character_parameters(character) if not each.name.startswith("strength.")
    ]
    return [*PARAMETERS, *of_joints]


def resolved(character: Character, given: Mapping[str, object]) -> Values:
    """The values of all parameters: those given, or defaults.

    Raises:
        ConfigurationError: a name or a value is wrong.
    """
    return resolve(declared(character), given)


def law_settings(character: Character, values: Values) -> ControllerSettings:
    """The law, gains and limits that the values say, as of a controller without assistance."""
    own = {each.name for each in BridgeSettings.declared()}
    shared = {name: value for name, value in values.items() if name not in own}
    return make_controller_settings(
        character, resolve_for(character, {**shared, "root_assistance": False})
    )
