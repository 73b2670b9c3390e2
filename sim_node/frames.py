"""The coordinate frames that ROS' tools know a character by (REP 105)."""

from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.frame_names import BASE_FRAME, WORLD
from msgs_config.settings import Settings, parameter


class FrameNames(Settings):
    """Names of the frames above a character's links, without the character's prefix.

    Raises ConfigurationError if a name cannot be a frame's, or both are one.
    """

    odom: str = parameter(
        "odom",
        "the frame of `odom`, equal to `world`; of several characters below each",
        name="odom_frame",
    )
    base: str = parameter(
        BASE_FRAME,
        "the frame of a character's base, z up and x forward; if a link has the name, the base "
        "link",
        name="base_frame",
    )

    def __post_init__(self) -> None:
        for parameter_name, name, such in (
            ("odom_frame", self.odom, FrameNames.odom),
            ("base_frame", self.base, FrameNames.base),
        ):
            if not name or name.startswith("/") or any(letter.isspace() for letter in name):
                raise ConfigurationError(
                    f"parameter '{parameter_name}' is {name!r}; it must be the name of a frame, "
                    f"without blanks and no '/' at its start, such as '{such}'"
                )
        if self.base in (self.odom, WORLD):
            raise ConfigurationError(
                f"parameter 'base_frame' is '{self.base}', which is the frame that the base moves "
                f"in; it must be another, such as '{BASE_FRAME}'"
            )

    def check(self, character: Character) -> None:
        """Raise ConfigurationError if a frame is one of the character's links or sensors."""
        links = dict.fromkeys(character.frame_names, "a link")
        sensors = {sensor.name: "a sensor" for sensor in character.sensors}
        for parameter_name, name, taken in (
            ("odom_frame", self.odom, links | sensors),
            ("base_frame", self.base, sensors),  # a link may be the base's frame
        ):
            if name in taken:
                raise ConfigurationError(
                    f"parameter '{parameter_name}' is '{name}', which is {taken[name]} of "
                    f"character '{character.name}'; it must be the name of no other frame"
                )
