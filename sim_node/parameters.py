"""The parameters of `sim_node`."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, LayoutError
from msgs_config.parameters import Parameter, Value, Values, resolve
from msgs_config.shared_parameters import CharacterSource, SharedSettings, collides, placed
from sim_node.frames import FrameNames
from sim_node.initial_state import (
    INITIAL_STATE,
    POSITION,
    REFERENCE,
    VELOCITY,
    CharacterSettings,
    check_given,
    check_length,
)
from sim_node.node_settings import NodeSettings, SensingSettings
from sim_node.physics.mass_factors import with_mass_factors
from sim_node.physics.settings import SimulationSettings

_NEEDED_FIRST = CharacterSource.declared()
_NAME = re.compile("[A-Za-z][A-Za-z0-9_]{0,63}")

CHARACTERS = Parameter(
    "characters",
    [],
    "names of several characters in one world, each a namespace; 'NAME.character' and the other "
    "parameters of a character are set below its name",
    texts=True,
)
WORLD_PARAMETERS = [
    *SharedSettings.declared(),
    *SimulationSettings.declared(),
    *NodeSettings.declared(),
]
"""Those that all characters of a world have in common."""
PARAMETERS = [*_NEEDED_FIRST, *WORLD_PARAMETERS]
"""Those of a simulator of one character, beside `character_parameters`."""


def character_parameters(character: Character) -> list[Parameter]:
    """The parameters whose defaults depend on the character."""
    return CharacterSettings.declared(
        commanded_joints=character.layout.actuated_joint_names,
        initial_position=list(character.rest_position),
        initial_velocity=[0.0] * character.layout.size,
    )


def resolve_alone(character: Character, given: Mapping[str, object]) -> Values:
    """The values of all parameters of a simulator of one character: those given, or defaults.

    Raises:
        ConfigurationError: a name or a value is wrong.
    """
    values = resolve(PARAMETERS + character_parameters(character), given)
    SensingSettings.of(values)  # which refuses what is wrong with it
    with_mass_factors(character, CharacterSettings.of(values).mass_factors)
    return values


@dataclass(frozen=True)
class CharacterParameters:
    """One character of a simulator: its name, and all parameters as if it were alone."""

    name: str
    character: Character
    values: Values

    @property
    def prefix(self) -> str:
        """What stands before the names of its parameters."""
        return f"{self.name}." if self.name else ""


@dataclass(frozen=True)
class SimulatorParameters:
    """The characters of a simulator, and its parameters as they are declared."""

    characters: tuple[CharacterParameters, ...]
    declared: tuple[Parameter, ...]
    values: Values

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the characters; empty for one alone, which has none."""
        return tuple(each.name for each in self.characters if each.name)

    @property
    def open(self) -> list[Parameter]:
        """The parameters that wait for the state in which a controller's reference begins."""
        names = {
            each.prefix + name
            for each in self.characters
            if CharacterSettings.of(each.values).begins_with_reference
            for name in (POSITION, VELOCITY)
        }
        return [parameter for parameter in self.declared if parameter.name in names]

    def with_values(self, changes: Mapping[str, Mapping[str, Value]]) -> "SimulatorParameters":
        """The same with other values of parameters of characters, by the characters' names."""
        characters, values = [], dict(self.values)
        for each in self.characters:
            own = dict(changes.get(each.name, {}))
            characters.append(replace(each, values=Values(each.values | own)))
            values |= {each.prefix + name: value for name, value in own.items()}
        return replace(self, characters=tuple(characters), values=Values(values))

    def at_reset(self, values: Values) -> "SimulatorParameters":
        """The same, as they are from a reset on at which the parameters have these values.

        Only those change that may at a reset.
        """
        new = {each.name: values[each.name] for each in self.declared if each.at_reset}
        characters = [
            replace(
                each,
                values=Values(
                    {
                        name: new.get(each.prefix + name, new.get(name, value))
                        for name, value in each.values.items()
                    }
                ),
            )
            for each in self.characters
        ]
        return replace(self, characters=tuple(characters), values=Values(self.values | new))

    def check_starts(self, before: Values, after: Values) -> None:
        """Raise ConfigurationError if changed values do not say where each character begins.

        Where it begins with its reference, the controller alone says it.
        """
        for each in self.characters:
            with_reference = CharacterSettings.of(after, each.prefix).begins_with_reference
            for name in (POSITION, VELOCITY):
                full_name = each.prefix + name
                value = after[full_name]
                if with_reference and value != before[full_name]:
                    raise ConfigurationError(
                        f"parameter '{full_name}' is not to be set, because "
                        f"'{each.prefix}{INITIAL_STATE}' is {REFERENCE}; set the controller's "
                        "reference"
                    )
                assert isinstance(value, list)
                check_length(full_name, len(value), each.character.layout)


def load_parameters(given: Mapping[str, object]) -> SimulatorParameters:
    """Load the characters that the parameters name, and resolve all parameters.

    With `characters` empty there is one, without a name, whose parameters have no prefix.

    Raises:
        ActuatedCharactersError: a parameter or a character cannot be used.
    """
    names = _names(given)
    characters = tuple(_load_one(name, _given_to(name, names, given)) for name in names)
    own_parameters = [
        [*_NEEDED_FIRST, *character_parameters(each.character)] for each in characters
    ]
    shared = {parameter.name for own in own_parameters for parameter in own}
    values = {name: value for name, value in given.items() if name not in shared}
    declared = [CHARACTERS, *WORLD_PARAMETERS]
    for each, own in zip(characters, own_parameters, strict=True):
        declared += [replace(parameter, name=each.prefix + parameter.name) for parameter in own]
        values |= {each.prefix + parameter.name: each.values[parameter.name] for parameter in own}
    return SimulatorParameters(characters, tuple(declared), resolve(declared, values))


def _names(given: Mapping[str, object]) -> list[str]:
    checked = CHARACTERS.checked(given.get(CHARACTERS.name, []))
    assert isinstance(checked, list)
    names = [str(name) for name in checked]
    for name in names:
        if not _NAME.fullmatch(name) or names.count(name) > 1:
            raise ConfigurationError(
                f"parameter 'characters' has {name!r}; it must list different names of at most 64 "
                "letters, digits and underscores"
            )
    return names or [""]


def _given_to(name: str, names: list[str], given: Mapping[str, object]) -> dict[str, object]:
    """The parameters given to one character: below its name, or else for all."""
    own: dict[str, object] = {}
    for key, value in given.items():
        head, dot, rest = key.partition(".")
        if key != CHARACTERS.name and not (dot and head in names):
            own.setdefault(key, value)
        elif dot and head == name:
            own[rest] = value
    return own


def _load_one(name: str, given: Mapping[str, object]) -> CharacterParameters:
    try:
        first = {p.name: given[p.name] for p in _NEEDED_FIRST if p.name in given}
        name_or_path = CharacterSource.given(first).character
        character = placed(load_character(name_or_path, collides(first)), first)
        values = resolve_alone(character, given)
        check_given(values, given)
        FrameNames.of(values).check(character)
        character.check_driven(CharacterSettings.of(values).commanded_joints)
    except (ConfigurationError, LayoutError) as error:
        raise ConfigurationError(f"character '{name}': {error}" if name else str(error)) from error
    return CharacterParameters(name, character, values)
