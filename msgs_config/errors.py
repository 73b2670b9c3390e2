"""The project's own error types: each one is a line that a user can act on."""

from difflib import get_close_matches

_MAX_SHOWN = 200  # characters of a value


class ActuatedCharactersError(Exception):
    """Base of every error that a user can mend; its text is one clear line."""


class ConfigurationError(ActuatedCharactersError):
    """A parameter or a command-line argument cannot be used."""


class CharacterError(ActuatedCharactersError):
    """A character file, its URDF or a name in it cannot be used."""


class SkinError(ActuatedCharactersError):
    """A file of a character's skin cannot be used, or does not fit the character."""


class ClipError(ActuatedCharactersError):
    """A motion clip is missing or malformed, or does not fit the character."""


class EffortSeriesError(ActuatedCharactersError):
    """A file of efforts over time is missing or malformed, or does not fit the character."""


class MotionError(ActuatedCharactersError):
    """Keyframes, a trajectory or a test signal are malformed, or do not fit the character."""


class LayoutError(ActuatedCharactersError):
    """Names or arrays do not fit the joint layout."""


class MessageError(ActuatedCharactersError):
    """Bytes on a topic are not the message that they should be."""


class CommandError(ActuatedCharactersError):
    """A command of joint torques is refused as a whole; says which joint and why."""


class ClockError(ActuatedCharactersError):
    """A stamp is no tick of the clock at this rate."""


class RecordingError(ActuatedCharactersError):
    """A recording cannot be written or read."""


class ReplayError(ActuatedCharactersError):
    """A replay differs from its recording; says where first."""


class RunError(ActuatedCharactersError):
    """A run could not be started, or one of its processes failed."""


class RefusedError(RunError):
    """A node does not take what it is sent, or does not do what it is asked for."""


class SimulationError(ActuatedCharactersError):
    """The simulation cannot go on: it diverged, or a command never came."""


class ClosedError(ActuatedCharactersError):
    """Something with an engine, such as a simulation, is used after it was closed."""


def one_of(what: str, value: object, choices: list[str], prefix: str = "") -> str:
    """The sentence for a name that is not among the valid ones; `prefix` leads to its place."""
    name = str(value)[:_MAX_SHOWN]
    close = get_close_matches(name, choices, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"unknown {what} {(prefix + name)[:_MAX_SHOWN]!r}; {hint}there are: {', '.join(choices)}"
