"""The coordinate frames that ROS' tools know a character by (REP 105)."""

from dataclasses import dataclass

from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.frame_names import BASE_FRAME, WORLD
from msgs_config.parameters import Parameter, Values

ODOM_FRAME = Parameter(
    "odom_frame", "odom", "the frame of `odom`, equal to `world`; of several characters below each"
)
BASE_FRAME_PARAMETER = Parameter(
    "base_frame",
    BASE_FRAME,
    "the frame of a character's base, z up and x forward; if a link has the name, the base link",
)


@dataclass(frozen=True)
class FrameNames:
    """Names of the frames above a character's links, without the character's prefix."""

    odom: str
    base: str  # the value of the parameter `base_frame`

    @classmethod
    def of(cls, values: Values) -> "FrameNames":
        """The names that the parameters give.

        Raises:
            ConfigurationError: a name cannot be a frame's, or both are one.
        """
        names = [values.text(each.name) for each in (ODOM_FRAME, BASE_FRAME_PARAMETER)]
        for parameter, name in zip((ODOM_FRAME, BASE_FRAME_PARAMETER), names, strict=True):
            if not name or name.startswith("/") or any(letter.isspace() for letter in name):
                raise ConfigurationError(
                    f"parameter '{parameter.name}' is {name!r}; it must be the name of a frame, "
                    f"without blanks and no '/' at its start, such as '{parameter.default}'"
                )
        odom, base = names
        if base in (odom, WORLD):
            raise ConfigurationError(
                f"parameter '{BASE_FRAME_PARAMETER.name}' is '{base}', which is the frame that "
                f"the base moves in; it must be another, such as '{BASE_FRAME}'"
            )
        return cls(odom, base)

    def check(self, character: Character) -> None:
        """Raise ConfigurationError if a frame is one of the character's links or sensors."""
        links = dict.fromkeys(character.frame_names, "a link")
        sensors = {sensor.name: "a sensor" for sensor in character.sensors}
        for parameter, name, taken in (
            (ODOM_FRAME, self.odom, links | sensors),
            (BASE_FRAME_PARAMETER, self.base, sensors),  # a link may be the base's frame
        ):
            if name in taken:
                raise ConfigurationError(
                    f"parameter '{parameter.name}' is '{name}', which is {taken[name]} of "
                    f"character '{character.name}'; it must be the name of no other frame"
                )
