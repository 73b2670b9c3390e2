"""The parameters of `sim_node`."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, LayoutError
from msgs_config.messages.session import SESSION
from msgs_config.parameters import Parameter, Value, Values, resolve
from msgs_config.shared_parameters import (
    CHARACTER,
    COLLISION,
    COMMAND_DELAY,
    GRAVITY,
    PLACEMENT,
    PLANE,
    RATE,
    collides,
    placed,
)
from sim_node.frames import BASE_FRAME_PARAMETER, ODOM_FRAME, FrameNames
from sim_node.initial_state import (
    POSITION,
    VELOCITY,
    begins_with_reference,
    check_given,
    initial_state_parameters,
)

_LARGEST_COUNT = 2**62
_FIRST = (CHARACTER, COLLISION, PLACEMENT)  # the others depend on them
_NAME = re.compile("[A-Za-z][A-Za-z0-9_]{0,63}")

CONTACT_BREAKING_THRESHOLD = "contact_breaking_threshold"
STEADY_CONTACTS = {CONTACT_BREAKING_THRESHOLD: 0.1}
"""Parameters of a world in which a loaded foot stands on all of its sole."""

WORLD_PARAMETERS = [
    RATE,
    Parameter("substeps", 1, "engine steps a tick", minimum=1, maximum=1000),
    GRAVITY,
    Parameter(
        "friction",
        0.9,
        "friction of the ground; a contact's is its product with the link's",
        maximum=100.0,
    ),
    Parameter("link_friction", 0.5, "friction of every link", maximum=100.0),
    Parameter("terrain", PLANE, "the ground: plane, none, or the path of a URDF"),
    Parameter("solver_iterations", 10, "contact solver iterations a step", minimum=1, maximum=1000),
    Parameter(
        CONTACT_BREAKING_THRESHOLD,
        0.02,
        "how far apart a contact's points may be until the engine drops them, as a share of the "
        "smaller shape's size; with the engine's own, 0.02, a loaded foot trembles on its edges",
        minimum=1e-3,
        maximum=1.0,
    ),
    Parameter("speed_limit", 500.0, "a speed beyond it is a divergence", unit="rad/s or m/s"),
    COMMAND_DELAY,
    Parameter(
        "mode",
        "lockstep",
        "wait for the answer to each state, or go on with the wall clock",
        choices=("lockstep", "realtime"),
    ),
    Parameter(
        "real_time_factor",
        0.0,
        "simulated time over wall time; 0: lockstep as fast as it can, realtime at 1",
        maximum=1000.0,
        live=True,
    ),
    Parameter(
        "command_timeout",
        0.2,
        "realtime: a command is held this long, then zero",
        unit="s",
        minimum=0.001,
        live=True,
    ),
    Parameter(
        "max_ticks", 0, "end after this many ticks; 0: never", unit="ticks", maximum=_LARGEST_COUNT
    ),
    Parameter(
        "wait_for_subscribers",
        0,
        "publish the first state when this many subscribe to joint_states",
        maximum=1000,
    ),
    Parameter(
        "initial_state_timeout",
        60.0,
        "longest wait for a controller that publishes where a character begins; 0: no limit",
        unit="s",
    ),
    Parameter("republish_period", 0.5, "an unanswered state is sent again", unit="s", minimum=0.01),
    Parameter("lockstep_timeout", 0.0, "longest wait for a command; 0: forever", unit="s"),
    Parameter(
        "on_timeout",
        "abort",
        "what a timeout does: end, pause, or go on with the last command or zero",
        choices=("abort", "pause", "hold", "zero"),
    ),
    Parameter(
        "on_fault",
        "pause",
        "what a conflict of commands or a divergence does",
        choices=("abort", "pause"),
    ),
    Parameter(
        "wrench_duration", 0.1, "a push is held this long, at least a tick", unit="s", live=True
    ),
    Parameter(
        "ball_lifetime", 0.0, "a thrown ball is taken out of the way after it; 0: never", unit="s"
    ),
    Parameter(
        "step_count",
        1,
        "ticks of one call of ~/step",
        unit="ticks",
        minimum=1,
        maximum=1_000_000_000,
        live=True,
    ),
    Parameter(
        "display_rate",
        30.0,
        "`visualization`, `/tf`, `description_joint_states` and `contact_wrenches` a second of "
        "simulated time",
        unit="Hz",
        minimum=0.001,
        maximum=1000.0,
    ),
    Parameter(
        "sensor_seed",
        0,
        "of the noise that a character's file gives its sensors",
        maximum=_LARGEST_COUNT,
    ),
    ODOM_FRAME,
    BASE_FRAME_PARAMETER,
    SESSION,
]
CHARACTERS = Parameter(
    "characters",
    [],
    "names of several characters in one world, each a namespace; 'NAME.character' and the other "
    "parameters of a character are set below its name",
    texts=True,
)
PARAMETERS = [CHARACTER, COLLISION, PLACEMENT, *WORLD_PARAMETERS]
"""Those of a simulator of one character, beside `character_parameters`."""


def character_parameters(character: Character) -> list[Parameter]:
    """The parameters whose defaults depend on the character."""
    return [
        Parameter(
            "commanded_joints",
            character.layout.actuated_joint_names,
            "the joints that must be commanded, and that alone may be; with 'root': assistance",
            texts=True,
        ),
        *initial_state_parameters(character),
    ]


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
        from_reference = [one for one in self.characters if begins_with_reference(one.values)]
        names = {one.prefix + name for one in from_reference for name in (POSITION, VELOCITY)}
        return [parameter for parameter in self.declared if parameter.name in names]

    def with_values(self, changes: Mapping[str, Mapping[str, Value]]) -> "SimulatorParameters":
        """The same with other values of parameters of characters, by the characters' names."""
        characters, values = [], dict(self.values)
        for each in self.characters:
            own = dict(changes.get(each.name, {}))
            characters.append(replace(each, values=Values(each.values | own)))
            values |= {each.prefix + name: value for name, value in own.items()}
        return replace(self, characters=tuple(characters), values=Values(values))


def load_parameters(given: Mapping[str, object]) -> SimulatorParameters:
    """Load the characters that the parameters name, and resolve all parameters.

    With `characters` empty there is one, without a name, whose parameters have no prefix.

    Raises:
        ActuatedCharactersError: a parameter or a character cannot be used.
    """
    names = _names(given)
    characters = tuple(_load_one(name, _given_to(name, names, given)) for name in names)
    own_parameters = [[*_FIRST, *character_parameters(each.character)] for each in characters]
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
        first = {p.name: given[p.name] for p in _FIRST if p.name in given}
        alone = resolve(_FIRST, first)
        character = placed(load_character(alone.text(CHARACTER.name), collides(alone)), alone)
        values = resolve(PARAMETERS + character_parameters(character), given)
        check_given(values, given)
        FrameNames.of(values).check(character)
        character.layout.mask(values.texts("commanded_joints"))  # they exist
    except (ConfigurationError, LayoutError) as error:
        raise ConfigurationError(f"character '{name}': {error}" if name else str(error)) from error
    return CharacterParameters(name, character, values)
