"""The parameters that simulator and controller have in common, and must agree on."""

from collections.abc import Mapping

from msgs_config.character.model import Character, Placement
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Parameter

DEFAULT_CHARACTER = "humanoid"
PLANE, NO_GROUND = "plane", "none"  # values of a simulator's `terrain`; any other is a URDF's path

CHARACTER = Parameter(
    "character",
    DEFAULT_CHARACTER,
    "name of a shipped character, or path of a .yaml, .urdf or .xacro file",
)
FROM_FILE, NO_COLLISIONS = "file", "none"
COLLISION = Parameter(
    "collision",
    FROM_FILE,
    "what the character collides with: as its file has it, or nothing, in which case meshes may be "
    "missing",
    choices=(FROM_FILE, NO_COLLISIONS),
)
RATE = Parameter("rate", 240, "control ticks a second", unit="Hz", minimum=1, maximum=100_000)
GRAVITY = Parameter(
    "gravity", 9.81, "gravity along -z", unit="m/s^2", maximum=1000.0, at_reset=True
)
COMMAND_DELAY = Parameter(
    "command_delay_ticks",
    0,
    "a command is applied this many ticks late; a planner counts with it",
    maximum=100_000,
)
PLACEMENT = Parameter(
    "placement",
    [0.0, 0.0, 0.0, 0.0],
    "where the character's own world stands: x, y, z, and its turn about z",
    unit="m, m, m, rad",
    minimum=-1e12,
)
KEYFRAME_PERIOD = Parameter(
    "keyframe_period",
    5.0,
    "of the keyframes from which a fork can begin; a large one comes less often; 0: none",
    unit="s",
    maximum=1e6,
)
KEYFRAME = Parameter("keyframe", "", "file of a keyframe, from which the run goes on")


def collides(given: Mapping[str, object]) -> bool:
    """Whether the parameters given let a character collide, as far as its file does.

    Raises:
        ConfigurationError: the parameter has another value.
    """
    return COLLISION.checked(given.get(COLLISION.name, COLLISION.default)) == FROM_FILE


def placed(character: Character, given: Mapping[str, object]) -> Character:
    """The character as loaded, where the parameters given say that it stands.

    Raises:
        ConfigurationError: the placement is not four numbers.
    """
    placement = PLACEMENT.checked(given.get(PLACEMENT.name, PLACEMENT.default))
    if not isinstance(placement, list) or len(placement) != 4:
        raise ConfigurationError(
            f"parameter '{PLACEMENT.name}' is {placement}; it must be four numbers: "
            "x, y, z in m and the turn about z in rad"
        )
    return character.placed(Placement(*(float(number) for number in placement)))
