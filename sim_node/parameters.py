"""The parameters of `sim_node`, and the simulation that they make."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from msgs_config import files
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.character.urdf_check import check_urdf
from msgs_config.errors import CharacterError, ConfigurationError, LayoutError
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.session import SESSION
from msgs_config.parameters import Parameter, Value, Values, resolve
from msgs_config.shared_parameters import (
    CHARACTER,
    COMMAND_DELAY,
    GRAVITY,
    NO_GROUND,
    PLACEMENT,
    PLANE,
    RATE,
    placed,
)
from sim_node.initial_state import POSITION, VELOCITY, check_given, initial_state_parameters
from sim_node.physics.simulated_character import CharacterSetup
from sim_node.physics.simulation import SimulationSettings
from sim_node.physics.world import WorldSettings

_LARGEST_COUNT = 2**62
_BEFORE = (CHARACTER.name, PLACEMENT.name)  # what the other parameters depend on
_NAME = re.compile("[A-Za-z][A-Za-z0-9_]{0,63}")

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
        "longest wait for a controller that says where a character begins; 0: no limit",
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
        "visualization markers a second of simulated time",
        unit="Hz",
        minimum=0.001,
        maximum=1000.0,
    ),
    SESSION,
]
CHARACTERS = Parameter(
    "characters",
    [],
    "names of several characters in one world, each a namespace; 'NAME.character' and the other "
    "parameters of a character are set below its name",
    texts=True,
)
PARAMETERS = [CHARACTER, PLACEMENT, *WORLD_PARAMETERS]
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
        return _prefix(self.name)


@dataclass(frozen=True)
class SimulatorParameters:
    """The characters of a simulator, and its parameters as they are declared."""

    parts: tuple[CharacterParameters, ...]
    declared: tuple[Parameter, ...]
    values: Values

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the characters; empty for one alone, which has none."""
        return tuple(part.name for part in self.parts if part.name)

    def with_values(self, changes: Mapping[str, Mapping[str, Value]]) -> "SimulatorParameters":
        """The same with other values of parameters of characters, by the characters' names."""
        parts = [
            replace(part, values=Values({**part.values, **changes.get(part.name, {})}))
            for part in self.parts
        ]
        changed = {
            part.prefix + name: value
            for part in self.parts
            for name, value in changes.get(part.name, {}).items()
        }
        return replace(self, parts=tuple(parts), values=Values(self.values | changed))


def load_parameters(given: Mapping[str, object]) -> SimulatorParameters:
    """Load the characters that the parameters name, and resolve all parameters.

    With `characters` empty there is one, without a name, whose parameters have no prefix.

    Raises:
        ActuatedCharactersError: a parameter or a character cannot be used.
    """
    names = _names(given)
    parts = tuple(_make_part(name, _own(given, name, names)) for name in names)
    declared = [CHARACTERS, *WORLD_PARAMETERS]
    shared = {p.name for part in parts for p in _of_character(part.character)}
    values = {name: value for name, value in given.items() if name not in shared}
    for part in parts:
        for parameter in _of_character(part.character):
            name = part.prefix + parameter.name
            declared.append(replace(parameter, name=name))
            values[name] = part.values[parameter.name]
    return SimulatorParameters(parts, tuple(declared), resolve(declared, values))


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


def _prefix(name: str) -> str:
    return f"{name}." if name else ""


def _own(given: Mapping[str, object], name: str, names: list[str]) -> dict[str, object]:
    """What is given for one character: below its name, or else for all."""
    own: dict[str, object] = {}
    for key, value in given.items():
        head, dot, rest = key.partition(".")
        if key != CHARACTERS.name and not (dot and head in names):
            own.setdefault(key, value)
        elif dot and head == name:
            own[rest] = value
    return own


def _make_part(name: str, given: Mapping[str, object]) -> CharacterParameters:
    try:
        alone = resolve([CHARACTER, PLACEMENT], {k: given[k] for k in given if k in _BEFORE})
        character = placed(load_character(alone.text(CHARACTER.name)), alone)
        values = resolve(PARAMETERS + character_parameters(character), given)
        check_given(values, given)
        character.layout.mask(values.texts("commanded_joints"))  # they exist
    except (ConfigurationError, LayoutError) as error:
        raise ConfigurationError(f"character '{name}': {error}" if name else str(error)) from error
    return CharacterParameters(name, character, values)


def _of_character(character: Character) -> list[Parameter]:
    return [CHARACTER, PLACEMENT, *character_parameters(character)]


def make_character_setup(character: Character, values: Values, name: str = "") -> CharacterSetup:
    """The character's part in the simulation that the parameters' values say."""
    return CharacterSetup(
        character=character,
        commanded_joints=values.texts("commanded_joints"),
        initial_position=values.numbers(POSITION),
        initial_velocity=values.numbers(VELOCITY),
        name=name,
    )


def is_realtime(values: Values) -> bool:
    """Whether the wall clock decides when a tick is over, and not the commands."""
    return values.text("mode") == "realtime"


def tick_period(values: Values) -> float:
    """Wall time from tick to tick in s; 0 for as fast as it goes."""
    factor = values.number("real_time_factor") or float(is_realtime(values))
    return 1.0 / (factor * values.integer("rate")) if factor else 0.0


def command_timeout_ns(values: Values) -> int:
    """How long a command is held in real time, ns of simulated time."""
    return round(values.number("command_timeout") * NANOSECONDS_PER_SECOND)


def push_ticks(values: Values) -> int:
    """How many ticks a push lasts."""
    return max(round(values.number("wrench_duration") * values.integer("rate")), 1)


def ball_ticks(values: Values) -> int:
    """After how many ticks a ball is taken out of the way; 0: never."""
    lifetime = values.number("ball_lifetime")
    return max(round(lifetime * values.integer("rate")), 1) if lifetime else 0


def display_ticks(values: Values) -> int:
    """After how many ticks the markers are due again."""
    return max(round(values.integer("rate") / values.number("display_rate")), 1)


def make_settings(values: Values) -> SimulationSettings:
    """The settings of the simulation that the parameters' values say.

    Raises:
        CharacterError: the terrain's URDF cannot be read.
    """
    rate, substeps = values.integer("rate"), values.integer("substeps")
    terrain = values.text("terrain")
    return SimulationSettings(
        rate_hz=rate,
        substeps=substeps,
        speed_limit=values.number("speed_limit"),
        command_delay_ticks=values.integer("command_delay_ticks"),
        ball_ticks=ball_ticks(values),
        world=WorldSettings(
            step_s=1.0 / (rate * substeps),
            gravity=values.number("gravity"),
            friction=values.number("friction"),
            link_friction=values.number("link_friction"),
            solver_iterations=values.integer("solver_iterations"),
            ground=terrain == PLANE,
            terrain=None if terrain in (PLANE, NO_GROUND) else _read_terrain(terrain),
        ),
    )


def _read_terrain(path: str) -> UrdfOptions:
    urdf = files.resolve(path, Path.cwd(), CharacterError)
    text = files.read_text(urdf, CharacterError)
    check_urdf(urdf, text)
    return UrdfOptions(urdf, text, fixed_base=True)
