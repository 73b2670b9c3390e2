"""The parameters that simulator and controller have in common, and must agree on."""

from collections.abc import Mapping

from msgs_config.character.model import Character, Placement
from msgs_config.errors import ConfigurationError
from msgs_config.settings import Settings, parameter

DEFAULT_CHARACTER = "humanoid"
PLANE, NO_GROUND = "plane", "none"  # values of a simulator's `terrain`; any other is a file
FROM_FILE, NO_COLLISIONS = "file", "none"
LINK_FRICTION = 0.5  # of a simulator's links, unless it is told otherwise


class CharacterSource(Settings):
    """Which character it is, and where it stands; all other parameters depend on these."""

    character: str = parameter(
        DEFAULT_CHARACTER,
        "name of a shipped character, or path of a .yaml, .urdf, .xacro or .xml file",
    )
    collision: str = parameter(
        FROM_FILE,
        "what the character collides with: as its file has it, or nothing, in which case meshes "
        "may be missing",
        choices=(FROM_FILE, NO_COLLISIONS),
    )
    placement: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0, 0.0),
        "where the character's own world stands: x, y, z, and its turn about z",
        unit="m, m, m, rad",
        minimum=-1e12,
    )


class SharedSettings(Settings):
    """What both sides are set to, whatever the character is."""

    rate: int = parameter(240, "control ticks a second", unit="Hz", minimum=1, maximum=100_000)
    gravity: float = parameter(
        9.81, "gravity along -z", unit="m/s^2", maximum=1000.0, at_reset=True
    )
    command_delay_ticks: int = parameter(
        0, "a command is applied this many ticks late; a planner counts with it", maximum=100_000
    )

    @property
    def period(self) -> float:
        """Length of a tick in s."""
        return 1.0 / self.rate


class KeyframeSettings(Settings):
    """How often a node publishes keyframes, and from which one it goes on."""

    period: float = parameter(
        5.0,
        "of the keyframes from which a fork can begin; a large one comes less often; 0: none",
        name="keyframe_period",
        unit="s",
        maximum=1e6,
    )
    budget: int = parameter(
        60,
        "of keyframes in simulated time: where they are larger, they come less often; the other "
        "messages of a humanoid take twenty times that, a keyframe of a planner 2,000 kB",
        name="keyframe_budget",
        unit="kB/s",
        minimum=1,
        maximum=1_000_000,
    )
    file: str = parameter("", "file of a keyframe, from which the run goes on", name="resume_from")


CHARACTER, COLLISION, PLACEMENT = CharacterSource.declared()
RATE, GRAVITY, COMMAND_DELAY = SharedSettings.declared()
KEYFRAME_PERIOD, KEYFRAME_BUDGET, RESUME_FROM = KeyframeSettings.declared()


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
