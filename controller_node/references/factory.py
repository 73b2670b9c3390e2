"""Which motion to track: the parameters that say it, and the reference that they make."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller_node.references.base import Reference
from controller_node.references.clip import ClipReference
from controller_node.references.files.clip import read_clip
from controller_node.references.files.keyframes import read_keyframes
from controller_node.references.hold import HoldReference
from controller_node.references.keyframes import KeyframesReference
from controller_node.references.signals import SineReference, StepReference
from msgs_config.character.model import Character
from msgs_config.errors import MotionError, one_of
from msgs_config.messages.state import StampedState
from msgs_config.parameters import Parameter, Values

KEYFRAMES_DIRECTORY = Path(__file__).parent / "data"

MOTION_PARAMETERS = [
    Parameter(
        "reference",
        "hold",
        "what to track: the rest pose, keyframes, a motion clip, or a test signal from the rest "
        "pose; a message on ~/joint_trajectory replaces it",
        choices=("hold", "keyframes", "clip", "step", "sine"),
    ),
    Parameter("keyframes", "", "name of shipped keyframes, or path of a .yaml file"),
    Parameter("clip", "walk", "name of a clip of the character, or path of a .txt or .json file"),
    Parameter(
        "signal.dofs",
        [],
        "degrees of freedom that step or sine moves; none named: all that have a motor and may",
        texts=True,
    ),
    Parameter("step.size", 0.1, "how far the step goes", unit="rad or m", minimum=-1e6),
    Parameter("step.time", 0.5, "when, since the episode began", unit="s"),
    Parameter("sine.amplitude", 0.1, "how far the sine goes", unit="rad or m", minimum=-1e6),
    Parameter("sine.frequency", 0.5, "how often a second", unit="Hz"),
]


@dataclass(frozen=True)
class Motion:
    """A reference, and what the user should know of it."""

    reference: Reference
    warnings: tuple[str, ...] = ()

    def first_state(self) -> StampedState:
        """The state in which a character is to begin, so that it is where the reference is."""
        first = self.reference.sample(0.0)
        return StampedState(0, first.configuration.position, first.velocity, None)


def make_motion(character: Character, values: Values) -> Motion:
    """The motion that the parameters' values name.

    Raises:
        ActuatedCharactersError: a file or a name does not exist, or does not fit the character.
    """
    kind = values.text("reference")
    if kind == "clip":
        frames = read_clip(character, values.text("clip"))
        names = ", ".join(frames.clamped)
        kept = (f"kept within joint limits: {names}",) if names else ()
        return Motion(ClipReference(character.layout, frames), kept)
    if kind == "keyframes":
        keyframes = read_keyframes(character, str(_keyframes_path(values.text("keyframes"))))
        return Motion(KeyframesReference(character.layout, keyframes), keyframes.warnings)
    if kind == "step":
        size, time = values.number("step.size"), values.number("step.time")
        dofs, warnings = _signal_dofs(character, values, [size])
        return Motion(StepReference(character, dofs, size, time), warnings)
    if kind == "sine":
        amplitude, frequency = values.number("sine.amplitude"), values.number("sine.frequency")
        dofs, warnings = _signal_dofs(character, values, [amplitude, -amplitude])
        return Motion(SineReference(character, dofs, amplitude, frequency), warnings)
    return Motion(HoldReference(character))


def _signal_dofs(
    character: Character, values: Values, offsets: Sequence[float]
) -> tuple[list[str], tuple[str, ...]]:
    """The degrees of freedom that a signal moves, and a warning of those that it cannot move.

    If none are named: all that have a motor, save those whose limits an offset would leave.
    """
    named = list(values.texts("signal.dofs"))
    if named:
        return named, ()
    layout, rest = character.layout, np.array(character.rest_position)
    lower, upper = character.position_bounds()
    reached = [rest + offset for offset in offsets]
    free = np.all([(lower <= there) & (there <= upper) for there in reached], axis=0)
    actuated = layout.mask(layout.actuated_joint_names)
    chosen = [layout.dof_names[index] for index in np.flatnonzero(actuated & free)]
    fixed = [layout.dof_names[index] for index in np.flatnonzero(actuated & ~free)]
    warnings = (f"kept still within their limits: {', '.join(fixed)}",) if fixed else ()
    return chosen, warnings


def _keyframes_path(name_or_path: str) -> Path:
    if name_or_path.endswith((".yaml", ".yml")):
        return Path(name_or_path)
    shipped = sorted(path.stem for path in KEYFRAMES_DIRECTORY.glob("*.yaml"))
    if name_or_path not in shipped:
        raise MotionError(f"{one_of('keyframes', name_or_path, shipped)}, or the path of a .yaml")
    return KEYFRAMES_DIRECTORY / f"{name_or_path}.yaml"
