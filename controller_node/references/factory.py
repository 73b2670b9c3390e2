"""Which motion to track: the parameters that say it, and the reference that they make."""

from controller_node.references import clip, hold, keyframes, signals  # noqa: F401  register their own
from controller_node.references.base import REFERENCES, Motion
from controller_node.references.steering import factory as steering  # noqa: F401  registers its own
from controller_node.references.timeline import motion  # noqa: F401  registers its own
from msgs_config.character.model import Character
from msgs_config.parameters import Values
from msgs_config.settings import Settings, parameter


class MotionSettings(Settings):
    """Which motion is tracked."""

    reference: str = parameter(
        "hold",
        "what to track: the rest pose, keyframes, a timeline, a motion clip, a test signal from "
        "the rest pose, a walk steered by cmd_vel, or the rest pose that goes where cmd_vel says; "
        "a message on ~/joint_trajectory replaces it",
        choices=REFERENCES.names,
    )


MOTION_PARAMETERS = [*MotionSettings.declared(), *REFERENCES.parameters]


def make_motion(character: Character, values: Values) -> Motion:
    """The motion that the parameters' values name.

    Raises:
        ActuatedCharactersError: a file or a name does not exist, or does not fit the character.
    """
    return REFERENCES[MotionSettings.of(values).reference](character, values)
