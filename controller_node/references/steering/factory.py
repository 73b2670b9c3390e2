"""The clips of the reference `steered`, and what they make."""

from controller_node.references.base import REFERENCES, Motion
from controller_node.references.clip import ClipReference
from controller_node.references.steering.gait import (
    Gait,
    cycle_of,
    standing_cycle,
    still_gait,
)
from controller_node.references.steering.reference import SteeredReference
from controller_node.references.steering.velocity import SteeringLimits
from msgs_config.character.model import Character
from msgs_config.clips.reading import expand_clips, read_clip
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Values
from msgs_config.settings import Settings, parameter
from msgs_config.shared_parameters import SharedSettings


class GaitSettings(Settings, prefix="steering."):
    """The clips that a steered character moves by."""

    walk: str = parameter("walk", "the clip that a steered character walks by")
    run: str = parameter("run", "the clip that it runs by")
    clips: tuple[str, ...] = parameter(
        (), "cycles to move by instead of these two: names, files, or folders of them"
    )


def clips_of_gait(character: Character, gait: GaitSettings) -> list[str]:
    """The clips to move by. Raises ClipError if one does not exist, or a folder has none."""
    return expand_clips(character, gait.clips) or [gait.walk, gait.run]


@REFERENCES.register("commanded", SteeringLimits)
def _commanded(character: Character, values: Values) -> Motion:
    _check_base("commanded", character)
    limits, rate = SteeringLimits.of(values), SharedSettings.of(values).rate
    return Motion(SteeredReference(character, still_gait(character), limits, rate_hz=rate))


def _check_base(reference: str, character: Character) -> None:
    if not character.layout.has_floating_base:
        raise ConfigurationError(
            f"reference '{reference}' needs a floating base; '{character.name}' is fixed to the "
            "world"
        )


@REFERENCES.register("steered", GaitSettings, SteeringLimits)
def _steered(character: Character, values: Values) -> Motion:
    _check_base("steered", character)
    gait = GaitSettings.of(values)
    names = clips_of_gait(character, gait)
    clamped: list[str] = []
    cycles = []
    for name in names:
        frames = read_clip(character, name)
        if not frames.wraps:
            raise ConfigurationError(f"clip '{name}' ends; to steer, it must wrap")
        clamped += frames.clamped
        clip = ClipReference(character.layout, frames)
        cycles.append(cycle_of(name, clip, float(frames.times[-1]), character))
    if gait.clips:
        cycles.sort(key=lambda cycle: cycle.speed)
    reference = SteeredReference(
        character,
        Gait(character.layout, [standing_cycle(character, cycles[0]), *cycles]),
        SteeringLimits.of(values),
        rate_hz=SharedSettings.of(values).rate,
    )
    warnings = (f"kept within joint limits: {', '.join(sorted(set(clamped)))}",) if clamped else ()
    return Motion(reference, warnings)
